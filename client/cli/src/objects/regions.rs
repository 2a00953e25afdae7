//! Regions of objects, from files and for people.

use std::ops::RangeInclusive;

use grasp_client::{Preference, v1::Region};

use crate::format::name_of;

/// The name of the region that options make.
pub(super) const FORBIDDEN: &str = "forbidden";

/// What a file of regions looks like.
pub(crate) const FORMAT: &str = r#"A file of regions is a list of the API's Region in protobuf's JSON; in each, "name" and "preference" are required, and one of
"groups", "triangles" and "shapes":
  [{"name": "handle", "preference": "PREFERENCE_PREFERRED", "weight": 0.8, "groups": ["grip"], "triangles": [7],
    "shapes": [{"tube": {"points": [{"x": 0.04}, {"x": 0.07, "y": 0.03}], "radii": [0.012]}}]},
   {"name": "rim", "preference": "PREFERENCE_AVOIDED", "shapes": [{"halfSpace": {"point": {"y": 0.09}, "normal": {"y": 1}}}]},
   {"name": "blade", "preference": "PREFERENCE_FORBIDDEN", "shapes": [{"tube": {"points": [{}], "radii": [0.03]}},
     {"box": {"pose": {"position": {"y": 0.1}}, "halfExtents": {"x": 0.01, "y": 0.05, "z": 0.02}}}]}]"#;

/// The region that must not be touched, if options name groups or triangles of it.
pub(super) fn forbidden(groups: Vec<String>, triangles: &[RangeInclusive<u32>]) -> Option<Region> {
    let triangles: Vec<u32> = triangles.iter().flat_map(|range| range.clone()).collect();
    (!groups.is_empty() || !triangles.is_empty()).then(|| Region {
        groups,
        triangles,
        ..Region::new(FORBIDDEN, Preference::Forbidden)
    })
}

/// Names and preferences of regions.
pub(super) fn list(regions: &[Region]) -> String {
    let written = regions.iter().map(|region| {
        let (name, preference) = (&region.name, name_of(region.preference()));
        match region.weight {
            Some(weight) => format!("{name} ({preference}, {weight})"),
            None => format!("{name} ({preference})"),
        }
    });
    written.collect::<Vec<_>>().join(", ")
}

/// The regions of the documentation's example.
#[cfg(test)]
pub(crate) fn example() -> Vec<Region> {
    crate::input::example_of(FORMAT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_file_can_be_read() {
        assert_eq!(
            list(&example()),
            "handle (preferred, 0.8), rim (avoided), blade (forbidden)"
        );
    }
}
