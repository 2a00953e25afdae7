//! Objects and atlases for people.

use std::collections::BTreeMap;

use glam::Vec3;
use grasp_client::{
    GraspClient,
    v1::{self, AtlasGrowth},
};

use super::{
    atlas_of,
    marks::{list_known_grips, list_regions},
};
use crate::{
    Failure, Output,
    format::{list, yes_or_no},
    output::{pairs, write_line, write_message},
};

/// The edge lengths of an object's box in millimetres, longest first.
pub(super) fn size(object: &v1::GraspObject) -> String {
    let half_extents = object.bounding_box.as_ref().map(v1::BoxShape::half_extents);
    let mut edges = (half_extents.unwrap_or_default() * 2000.0).to_array();
    edges.sort_by(|a, b| b.total_cmp(a));
    let [long, middle, short] = edges;
    format!("{long:.0} × {middle:.0} × {short:.0} mm")
}

/// The state of an atlas: its number of grasps, whether it still grows, and why not.
pub(super) fn atlas(atlas: &v1::Atlas) -> String {
    let entries = atlas.entry_count;
    let growth = match atlas.growth() {
        AtlasGrowth::Unspecified if entries == 0 => "none".to_owned(),
        AtlasGrowth::Waiting => "waiting".to_owned(),
        AtlasGrowth::NothingFound => "no grip found".to_owned(),
        AtlasGrowth::AtRest => "at rest".to_owned(),
        AtlasGrowth::NoMemory if entries == 0 => "no memory".to_owned(),
        AtlasGrowth::Failed if entries == 0 => "failed".to_owned(),
        AtlasGrowth::Unspecified | AtlasGrowth::Growing => format!("{entries} grips so far"),
        _ => format!("{entries} grips"),
    };
    match atlas.learned_count {
        0 => growth,
        learned => format!("{growth}, {learned} learned"),
    }
}

/// Labels as `key=value`, and as `key` without a value.
pub(super) fn labels(labels: &BTreeMap<String, String>) -> String {
    list(labels.iter().map(|(key, value)| match value.as_str() {
        "" => key.clone(),
        value => format!("{key}={value}"),
    }))
}

/// Its friction, if it has its own.
pub(super) fn friction(object: &v1::GraspObject) -> String {
    let own = object.friction.map(|friction| friction.to_string());
    own.unwrap_or_else(|| "default".to_owned())
}

/// Shows everything about an object.
pub(super) async fn show(
    client: &GraspClient,
    object: &v1::GraspObject,
    output: Output,
) -> Result<(), Failure> {
    if output.json {
        return write_message(object);
    }
    let atlas = atlas_of(client, &object.name, "right").await?;
    write_line(&describe(object, &atlas))
}

fn describe(object: &v1::GraspObject, of_right: &v1::Atlas) -> String {
    let com = Vec3::from(object.center_of_mass.unwrap_or_default()) * 1000.0;
    let time = |time: Option<prost_types::Timestamp>| time.unwrap_or_default().to_string();
    let mut lines = vec![
        ("name", object.name.clone()),
        ("built in", yes_or_no(object.built_in)),
        ("mesh", format!("{} triangles", object.triangle_count)),
        ("box", size(object)),
        ("mass", format!("{:.1} g", object.mass_kg * 1000.0)),
        (
            "centre of mass",
            format!("{:.1}, {:.1}, {:.1} mm", com.x, com.y, com.z),
        ),
        ("friction", friction(object)),
        (
            "forbidden",
            format!("{} triangles", object.forbidden_triangle_count),
        ),
        ("regions", list_regions(&object.regions)),
        ("known grips", list_known_grips(&object.known_grips)),
        ("atlas", atlas(of_right)),
        ("content hash", object.content_hash.clone()),
        ("labels", labels(&object.labels)),
        ("created", time(object.create_time)),
        ("changed", time(object.update_time)),
        ("etag", object.etag.clone()),
    ];
    if let [x, y, z] = object.origin_in_file[..] {
        lines.push(("origin in file", format!("{x}, {y}, {z}")));
    }
    lines.extend(object.warnings.iter().map(|warning| ("warning", warning.clone())));
    pairs(&lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn atlas_state_shows_growth() {
        let state = |entry_count, growth: AtlasGrowth| v1::Atlas {
            entry_count,
            growth: growth.into(),
            ..v1::Atlas::default()
        };
        for (entries, growth, expected) in [
            (0, AtlasGrowth::Unspecified, "none"),
            (120, AtlasGrowth::Growing, "120 grips so far"),
            (120, AtlasGrowth::Unspecified, "120 grips so far"),
            (120, AtlasGrowth::Complete, "120 grips"),
            (120, AtlasGrowth::NoMemory, "120 grips"),
            (0, AtlasGrowth::Waiting, "waiting"),
            (0, AtlasGrowth::NothingFound, "no grip found"),
            (0, AtlasGrowth::AtRest, "at rest"),
            (0, AtlasGrowth::NoMemory, "no memory"),
            (0, AtlasGrowth::Failed, "failed"),
        ] {
            assert_eq!(atlas(&state(entries, growth)), expected);
        }
        let learned = v1::Atlas {
            learned_count: 2,
            ..state(120, AtlasGrowth::Complete)
        };
        assert_eq!(atlas(&learned), "120 grips, 2 learned");
    }

    #[test]
    fn labels_show_keys_and_values() {
        let of = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let both = [of("level", "kitchen"), of("fragile", "")].into();
        assert_eq!(labels(&both), "fragile, level=kitchen");
    }

    #[test]
    fn sizes_are_edges_in_millimetres_longest_first() {
        let object = v1::GraspObject {
            bounding_box: Some(v1::BoxShape {
                half_extents: Some(Vec3::new(0.01, 0.09, 0.02).into()),
                ..v1::BoxShape::default()
            }),
            ..v1::GraspObject::default()
        };
        assert_eq!(size(&object), "180 × 40 × 20 mm");
    }
}
