//! Known grips of objects, from files and for people.

use grasp_client::{KnownGrip, KnownGripUse};

/// What a file of known grips looks like.
pub(crate) const FORMAT: &str = r#"A file of known grips is a list of the API's KnownGrip in protobuf's JSON; "digits" and "rig" are for preferred ones, "near…" for
banned ones. `grasp find --json` shows "objectFromWrist" and "digits" of a grasp, and "convention" says if it was answered in an engine's axes (CONVENTION_UNITY, …):
  [{"name": "by the handle", "use": "KNOWN_GRIP_USE_PREFERRED", "rig": "adult", "handedness": "HANDEDNESS_RIGHT", "handScale": 1,
    "objectFromWrist": {"position": {"x": 0.1}, "orientation": {"w": 1}},
    "digits": [{"basePitch": 0.3, "secondPitch": 0.4, "thirdPitch": 0.3}, {}, {}, {}, {}]},
   {"name": "through the cup", "use": "KNOWN_GRIP_USE_BANNED", "handedness": "HANDEDNESS_LEFT",
    "objectFromWrist": {"position": {"y": 0.1}}, "nearMetres": 0.03, "nearRadians": 0.5}]"#;

/// Names and uses of known grips.
pub(super) fn list(grips: &[KnownGrip]) -> String {
    let written = grips.iter().map(|KnownGrip { name, used, .. }| match used {
        KnownGripUse::Preferred => format!("{name} (preferred)"),
        KnownGripUse::Banned => format!("{name} (banned)"),
    });
    written.collect::<Vec<_>>().join(", ")
}

/// The grips of the documentation's example.
#[cfg(test)]
pub(crate) fn example() -> Vec<KnownGrip> {
    crate::input::example_of("KnownGrip", FORMAT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_file_can_be_read() {
        assert_eq!(
            list(&example()),
            "by the handle (preferred), through the cup (banned)"
        );
    }
}
