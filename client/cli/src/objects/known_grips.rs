//! Known grips of objects, from files and for people.

use grasp_client::v1;

use crate::format::name_of;

/// What a file of known grips looks like.
pub(crate) const FORMAT: &str = r#"A file of known grips is a list of the API's KnownGrip in protobuf's JSON; digits are for preferred ones, "near…" for forbidden
ones. "hand" of a grasp in the output of `grasp find --json` can be taken as it is:
  [{"name": "by the handle", "preference": "PREFERENCE_PREFERRED", "hand": {
     "rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "scale": 1,
     "objectFromWrist": {"position": {"x": 0.1}, "orientation": {"w": 1}},
     "thumb": {"basePitch": 0.3, "secondPitch": 0.4, "thirdPitch": 0.3}, "index": {}, "middle": {}, "ring": {}, "little": {}}},
   {"name": "through the cup", "preference": "PREFERENCE_FORBIDDEN", "nearDistance": 0.03, "nearAngle": 0.5, "hand": {
     "rig": "rigs/adult", "handedness": "HANDEDNESS_LEFT", "objectFromWrist": {"position": {"y": 0.1}}}}]"#;

/// Names and preferences of known grips.
pub(super) fn list(grips: &[v1::KnownGrip]) -> String {
    let written = grips
        .iter()
        .map(|grip| format!("{} ({})", grip.name, name_of(grip.preference())));
    written.collect::<Vec<_>>().join(", ")
}

/// The grips of the documentation's example.
#[cfg(test)]
pub(crate) fn example() -> Vec<v1::KnownGrip> {
    crate::input::example_of(FORMAT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_file_can_be_read() {
        assert_eq!(
            list(&example()),
            "by the handle (preferred), through the cup (forbidden)"
        );
    }
}
