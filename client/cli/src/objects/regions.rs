//! Regions of objects, from files and for people.

use grasp_client::{Region, RegionKind};

/// What a file of regions looks like.
pub(crate) const FORMAT: &str = r#"A file of regions is a list of the API's Region in protobuf's JSON; in each, "name" and "kind" are required, and one of
"groups", "triangles" and "shapes":
  [{"name": "handle", "kind": "REGION_KIND_PREFER", "weight": 0.8, "groups": ["grip"], "triangles": [7],
    "shapes": [{"tube": {"points": [{"x": 0.04}, {"x": 0.07, "y": 0.03}], "radius": 0.012}}]},
   {"name": "rim", "kind": "REGION_KIND_AVOID", "shapes": [{"halfSpace": {"point": {"y": 0.09}, "normal": {"y": 1}}}]},
   {"name": "blade", "kind": "REGION_KIND_FORBIDDEN", "shapes": [{"sphere": {"centre": {}, "radius": 0.03}},
     {"box": {"objectFromBox": {"position": {"y": 0.1}}, "halfExtents": {"x": 0.01, "y": 0.05, "z": 0.02}}}]}]"#;

/// Names and kinds of regions.
pub(super) fn list(regions: &[Region]) -> String {
    let written = regions.iter().map(
        |Region {
             name, kind, weight, ..
         }| {
            let kind = match kind {
                RegionKind::Forbidden => "forbidden",
                RegionKind::Avoid => "avoid",
                RegionKind::Prefer => "prefer",
            };
            match weight {
                Some(weight) => format!("{name} ({kind}, {weight})"),
                None => format!("{name} ({kind})"),
            }
        },
    );
    written.collect::<Vec<_>>().join(", ")
}

/// The regions of the documentation's example.
#[cfg(test)]
pub(crate) fn example() -> Vec<Region> {
    crate::input::example_of("Region", FORMAT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_file_can_be_read() {
        assert_eq!(
            list(&example()),
            "handle (prefer, 0.8), rim (avoid), blade (forbidden)"
        );
    }
}
