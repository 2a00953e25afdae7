//! Known grips of objects, from files and for people.

use grasp_client::{KnownGrip, KnownGripUse};

/// What a file of known grips looks like.
pub(crate) const FORMAT: &str = r#"A file of known grips is a list; "digits" and "rig" are for preferred ones, "near_…" for banned ones. `grasp find --json` shows
"object_from_wrist" and "digits" of a grasp:
  [{"name": "by the handle", "use": "preferred", "rig": "adult", "handedness": "right", "hand_scale": 1,
    "object_from_wrist": {"position": [0.1, 0, 0], "orientation": [0, 0, 0, 1]},
    "digits": [{"base_yaw": 0, "base_pitch": 0.3, "second_pitch": 0.4, "third_pitch": 0.3}, {}, {}, {}, {}]},
   {"name": "through the cup", "use": "banned", "handedness": "left",
    "object_from_wrist": {"position": [0, 0.1, 0]}, "near_metres": 0.03, "near_radians": 0.5}]"#;

/// Names and uses of known grips.
pub(super) fn list(grips: &[KnownGrip]) -> String {
    let written = grips.iter().map(|KnownGrip { name, used, .. }| match used {
        KnownGripUse::Preferred => format!("{name} (preferred)"),
        KnownGripUse::Banned => format!("{name} (banned)"),
    });
    written.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_file_can_be_read() {
        let (_, example) = FORMAT.split_once("  [").expect("it has an example");
        let grips: Vec<KnownGrip> = serde_json::from_str(&format!("[{example}")).expect("it is right");
        assert_eq!(
            list(&grips),
            "by the handle (preferred), through the cup (banned)"
        );
    }
}
