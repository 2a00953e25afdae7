//! Regions and known grips of objects, from files and for people.

use grasp_client::{
    Preference,
    v1::{KnownGrip, Region},
};

use crate::format::{list, name_of};

/// What a file of regions looks like.
pub(crate) const REGIONS: &str = r#"A file of regions is a list of the API's Region in protobuf's JSON; in each, "name" and "preference" are required, and one of
"groups", "triangles" and "shapes":
  [{"name": "handle", "preference": "PREFERENCE_PREFERRED", "weight": 0.8, "groups": ["grip"], "triangles": [7],
    "shapes": [{"tube": {"points": [{"x": 0.04}, {"x": 0.07, "y": 0.03}], "radii": [0.012]}}]},
   {"name": "rim", "preference": "PREFERENCE_AVOIDED", "shapes": [{"halfSpace": {"point": {"y": 0.09}, "normal": {"y": 1}}}]},
   {"name": "blade", "preference": "PREFERENCE_FORBIDDEN", "shapes": [{"tube": {"points": [{}], "radii": [0.03]}},
     {"box": {"pose": {"position": {"y": 0.1}}, "halfExtents": {"x": 0.01, "y": 0.05, "z": 0.02}}}]}]"#;

/// What a file of known grips looks like.
pub(crate) const KNOWN_GRIPS: &str = r#"A file of known grips is a list of the API's KnownGrip in protobuf's JSON; digits are for preferred ones, "near…" for forbidden
ones. "hand" of a grasp in the output of `grasp find --json` can be taken as it is:
  [{"name": "by the handle", "preference": "PREFERENCE_PREFERRED", "hand": {
     "rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "scale": 1,
     "objectFromWrist": {"position": {"x": 0.1}, "orientation": {"w": 1}},
     "thumb": {"basePitch": 0.3, "secondPitch": 0.4, "thirdPitch": 0.3}, "index": {}, "middle": {}, "ring": {}, "little": {}}},
   {"name": "through the cup", "preference": "PREFERENCE_FORBIDDEN", "nearDistance": 0.03, "nearAngle": 0.5, "hand": {
     "rig": "rigs/adult", "handedness": "HANDEDNESS_LEFT", "objectFromWrist": {"position": {"y": 0.1}}}}]"#;

/// The region that must not be touched, if options name groups of it.
pub(super) fn forbidden(groups: Vec<String>) -> Option<Region> {
    (!groups.is_empty()).then(|| Region {
        groups,
        ..Region::new("forbidden", Preference::Forbidden)
    })
}

/// Names and preferences of regions.
pub(super) fn list_regions(regions: &[Region]) -> String {
    list(regions.iter().map(|region| {
        let (name, preference) = (&region.name, name_of(region.preference()));
        match region.weight {
            Some(weight) => format!("{name} ({preference}, {weight})"),
            None => format!("{name} ({preference})"),
        }
    }))
}

/// Names and preferences of known grips.
pub(super) fn list_known_grips(grips: &[KnownGrip]) -> String {
    let named = |grip: &KnownGrip| format!("{} ({})", grip.name, name_of(grip.preference()));
    list(grips.iter().map(named))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::example_of;

    #[test]
    fn the_documented_files_can_be_read() {
        assert_eq!(
            list_regions(&example_of(REGIONS)),
            "handle (preferred, 0.8), rim (avoided), blade (forbidden)"
        );
        assert_eq!(
            list_known_grips(&example_of(KNOWN_GRIPS)),
            "by the handle (preferred), through the cup (forbidden)"
        );
    }
}
