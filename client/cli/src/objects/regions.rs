//! Regions of objects, from files and for people.

use grasp_client::{Region, RegionKind};

/// What a file of regions looks like.
pub(crate) const FORMAT: &str = r#"A file of regions is a list; in each, "name" and "kind" are required, and one of "groups", "triangles" and "shapes":
  [{"name": "handle", "kind": "prefer", "weight": 0.8, "groups": ["grip"], "triangles": [7],
    "shapes": [{"tube": {"points": [[0.04, 0, 0], [0.07, 0.03, 0]], "radius": 0.012}}]},
   {"name": "rim", "kind": "avoid", "shapes": [{"half_space": {"point": [0, 0.09, 0], "normal": [0, 1, 0]}}]},
   {"name": "blade", "kind": "forbidden", "shapes": [{"sphere": {"centre": [0, 0, 0], "radius": 0.03}},
     {"box": {"object_from_box": {"position": [0, 0.1, 0]}, "half_extents": [0.01, 0.05, 0.02]}}]}]"#;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documented_file_can_be_read() {
        let (_, example) = FORMAT.split_once("  [").expect("it has an example");
        let regions: Vec<Region> = serde_json::from_str(&format!("[{example}")).expect("it is right");
        assert_eq!(
            list(&regions),
            "handle (prefer, 0.8), rim (avoid), blade (forbidden)"
        );
    }
}
