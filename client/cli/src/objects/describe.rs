//! Text of objects and atlases, and help on the files of regions and known grips.

use std::collections::BTreeMap;

use glam::Vec3;
use grasp_client::{
    GraspClient,
    v1::{self, AtlasGrowth},
};

use super::atlas_of;
use crate::{
    Failure, Output,
    output::{list, name_of, pairs, warnings, write_line, write_message, yes_or_no},
};

pub(super) const REGIONS: &str = r#"A file of regions is a list of the API's Region in protobuf's JSON; in each, "name" and "preference" are required, and one of
"groups", "triangles" and "shapes":
  [{"name": "handle", "preference": "PREFERENCE_PREFERRED", "weight": 0.8, "groups": ["grip"], "triangles": [7],
    "shapes": [{"tube": {"points": [{"x": 0.04}, {"x": 0.07, "y": 0.03}], "radii": [0.012]}}]},
   {"name": "rim", "preference": "PREFERENCE_AVOIDED", "shapes": [{"halfSpace": {"point": {"y": 0.09}, "normal": {"y": 1}}}]},
   {"name": "blade", "preference": "PREFERENCE_FORBIDDEN", "shapes": [{"tube": {"points": [{}], "radii": [0.03]}},
     {"box": {"pose": {"position": {"y": 0.1}}, "halfExtents": {"x": 0.01, "y": 0.05, "z": 0.02}}}]}]"#;

pub(super) const KNOWN_GRIPS: &str = r#"A file of known grips is a list of the API's KnownGrip in protobuf's JSON; digits are for preferred ones, "near…" for forbidden
ones. "hand" of a grasp in the output of `grasp find --json` can be taken as it is:
  [{"name": "by the handle", "preference": "PREFERENCE_PREFERRED", "hand": {
     "rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "scale": 1,
     "objectFromWrist": {"position": {"x": 0.1}, "orientation": {"w": 1}},
     "thumb": {"basePitch": 0.3, "secondPitch": 0.4, "thirdPitch": 0.3}, "index": {}, "middle": {}, "ring": {}, "little": {}}},
   {"name": "through the cup", "preference": "PREFERENCE_FORBIDDEN", "nearDistance": 0.03, "nearAngle": 0.5, "hand": {
     "rig": "rigs/adult", "handedness": "HANDEDNESS_LEFT", "objectFromWrist": {"position": {"y": 0.1}}}}]"#;

/// The edge lengths of an object's bounding box in millimetres, longest first.
pub(super) fn size(object: &v1::GraspObject) -> String {
    let half_extents = object.bounding_box.as_ref().map(v1::BoxShape::half_extents);
    let mut edges = (half_extents.unwrap_or_default() * 2000.0).to_array();
    edges.sort_by(|a, b| b.total_cmp(a));
    let [long, middle, short] = edges;
    format!("{long:.0} × {middle:.0} × {short:.0} mm")
}

/// The state of an atlas: its number of grasps, whether it still grows, and why not.
pub(super) fn atlas_state(atlas: &v1::Atlas) -> String {
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

pub(super) fn friction(object: &v1::GraspObject) -> String {
    let own = object.friction.map(|friction| friction.to_string());
    own.unwrap_or_else(|| "default".to_owned())
}

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
        ("atlas", atlas_state(of_right)),
        ("content hash", object.content_hash.clone()),
        ("labels", labels(&object.labels)),
        ("created", time(object.create_time)),
        ("changed", time(object.update_time)),
        ("etag", object.etag.clone()),
    ];
    if let [x, y, z] = object.origin_in_file[..] {
        lines.push(("origin in file", format!("{x}, {y}, {z}")));
    }
    if !object.owner.is_empty() {
        lines.push(("owner", object.owner.clone()));
    }
    lines.extend(warnings(&object.warnings));
    pairs(&lines)
}

fn list_regions(regions: &[v1::Region]) -> String {
    list(regions.iter().map(|region| {
        let (name, preference) = (&region.name, name_of(region.preference()));
        match region.weight {
            Some(weight) => format!("{name} ({preference}, {weight})"),
            None => format!("{name} ({preference})"),
        }
    }))
}

fn list_known_grips(grips: &[v1::KnownGrip]) -> String {
    let named = |grip: &v1::KnownGrip| format!("{} ({})", grip.name, name_of(grip.preference()));
    list(grips.iter().map(named))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::messages_of;

    /// The messages of the example at the end of a file's documentation.
    fn example_of<M: prost::Message + prost::Name + Default>(documentation: &str) -> Vec<M> {
        let start = documentation.find("  [").expect("it has an example");
        let values: Vec<_> = serde_json::from_str(&documentation[start..]).expect("it is JSON");
        messages_of(&values).expect("they are right")
    }

    #[test]
    fn atlas_state_shows_growth() {
        for (entry_count, growth, expected) in [
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
            let mut atlas = v1::Atlas {
                entry_count,
                growth: growth.into(),
                ..v1::Atlas::default()
            };
            assert_eq!(atlas_state(&atlas), expected);
            atlas.learned_count = 2;
            assert_eq!(atlas_state(&atlas), format!("{expected}, 2 learned"));
        }
    }

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
