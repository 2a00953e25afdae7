//! `grasp objects`

mod create;
mod delete;
mod get;
pub(crate) mod known_grips;
mod list;
mod mesh;
pub(crate) mod regions;
mod update;
mod watch;

use std::{collections::BTreeMap, path::Path};

pub(crate) use create::{create_or_upload, id_from_file};

use clap::Subcommand;
use glam::Vec3;
use grasp_client::{AtlasGrowth, AtlasState, KnownGrip, Object, Region, rfc3339};

use crate::{
    Ending,
    failure::Failure,
    input::read_messages,
    output::{Output, pairs},
};

/// List, show, create, change, delete and watch objects, and save their meshes.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    List(list::Arguments),
    Get(get::Arguments),
    Create(create::Arguments),
    Update(update::Arguments),
    Delete(delete::Arguments),
    Watch(watch::Arguments),
    Mesh(mesh::Arguments),
}

pub(crate) async fn run(command: Command, output: Output) -> Result<Ending, Failure> {
    match command {
        Command::List(arguments) => list::run(arguments, output).await,
        Command::Get(arguments) => get::run(arguments, output).await,
        Command::Create(arguments) => create::run(arguments, output).await,
        Command::Update(arguments) => update::run(arguments, output).await,
        Command::Delete(arguments) => delete::run(arguments, output).await,
        Command::Watch(arguments) => watch::run(arguments, output).await,
        Command::Mesh(arguments) => mesh::run(arguments, output).await,
    }
}

/// The full name of an object; "remote" is short for "objects/remote".
pub(crate) fn full_name(name: &str) -> String {
    if name.starts_with("objects/") {
        name.to_owned()
    } else {
        format!("objects/{name}")
    }
}

/// The regions that a JSON file lists, if one is given.
fn regions_in(path: Option<&Path>) -> Result<Option<Vec<Region>>, Failure> {
    path.map(|path| read_messages("regions", "Region", path))
        .transpose()
}

/// The known grips that a JSON file lists, if one is given.
fn known_grips_in(path: Option<&Path>) -> Result<Option<Vec<KnownGrip>>, Failure> {
    path.map(|path| read_messages("known grips", "KnownGrip", path))
        .transpose()
}

/// The edge lengths of a box in millimetres, longest first.
fn size(half_extents: Vec3) -> String {
    let mut edges = (half_extents * 2000.0).to_array();
    edges.sort_by(|a, b| b.total_cmp(a));
    let [long, middle, short] = edges;
    format!("{long:.0} × {middle:.0} × {short:.0} mm")
}

/// The state of an atlas: its number of grasps, whether it still grows, and why not.
fn atlas(atlas: Option<&AtlasState>) -> String {
    let Some(atlas) = atlas else {
        return "none".to_owned();
    };
    let growth = match atlas.growth {
        AtlasGrowth::Waiting => "waiting".to_owned(),
        AtlasGrowth::NothingFound => "no grip found".to_owned(),
        AtlasGrowth::AtRest => "at rest".to_owned(),
        AtlasGrowth::NoMemory if atlas.entries == 0 => "no memory".to_owned(),
        AtlasGrowth::Failed if atlas.entries == 0 => "failed".to_owned(),
        AtlasGrowth::Unrecognised if !atlas.complete => format!("{} grips so far", atlas.entries),
        AtlasGrowth::Growing => format!("{} grips so far", atlas.entries),
        _ => format!("{} grips", atlas.entries),
    };
    match atlas.learned {
        0 => growth,
        learned => format!("{growth}, {learned} learned"),
    }
}

/// Labels as `key=value`, and as `key` without a value.
fn labels(labels: &BTreeMap<String, String>) -> String {
    let written = labels.iter().map(|(key, value)| match value.as_str() {
        "" => key.clone(),
        value => format!("{key}={value}"),
    });
    written.collect::<Vec<_>>().join(", ")
}

/// Its friction, if it has its own.
fn friction(object: &Object) -> String {
    object
        .friction
        .map_or_else(|| "default".to_owned(), |friction| friction.to_string())
}

/// Everything about an object, for people.
fn describe(object: &Object) -> String {
    let com = object.centre_of_mass * 1000.0;
    let mut lines = vec![
        ("name", object.name.clone()),
        ("built in", if object.built_in { "yes" } else { "no" }.to_owned()),
        (
            "mesh",
            format!(
                "{} triangles, {} vertices",
                object.triangle_count, object.vertex_count
            ),
        ),
        ("box", size(object.box_half_extents)),
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
        ("regions", regions::list(&object.regions)),
        ("known grips", known_grips::list(&object.known_grips)),
        ("atlas", atlas(object.atlas.as_ref())),
        ("content hash", object.content_hash.clone()),
        ("labels", labels(&object.labels)),
        ("created", rfc3339(object.create_time)),
        ("changed", rfc3339(object.update_time)),
        ("etag", object.etag.clone()),
    ];
    if let Some(origin) = object.origin_in_file {
        lines.push((
            "origin in file",
            format!("{}, {}, {}", origin.x, origin.y, origin.z),
        ));
    }
    lines.extend(object.warnings.iter().map(|warning| ("warning", warning.clone())));
    pairs(&lines)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn collection_of_names_is_optional() {
        assert_eq!(full_name("remote"), "objects/remote");
        assert_eq!(full_name("objects/remote"), "objects/remote");
    }

    #[test]
    fn atlas_state_shows_growth() {
        let state = |entries, growth| AtlasState {
            entries,
            complete: matches!(growth, AtlasGrowth::Complete | AtlasGrowth::NothingFound),
            stamp: "a7".to_owned(),
            build_time: Duration::ZERO,
            growth,
            learned: 0,
        };
        assert_eq!(atlas(None), "none");
        for (entries, growth, expected) in [
            (120, AtlasGrowth::Growing, "120 grips so far"),
            (120, AtlasGrowth::Unrecognised, "120 grips so far"),
            (120, AtlasGrowth::Complete, "120 grips"),
            (120, AtlasGrowth::NoMemory, "120 grips"),
            (0, AtlasGrowth::Waiting, "waiting"),
            (0, AtlasGrowth::NothingFound, "no grip found"),
            (0, AtlasGrowth::AtRest, "at rest"),
            (0, AtlasGrowth::NoMemory, "no memory"),
            (0, AtlasGrowth::Failed, "failed"),
        ] {
            assert_eq!(atlas(Some(&state(entries, growth))), expected);
        }
        let learned = AtlasState {
            learned: 2,
            ..state(120, AtlasGrowth::Complete)
        };
        assert_eq!(atlas(Some(&learned)), "120 grips, 2 learned");
    }

    #[test]
    fn labels_show_keys_and_values() {
        let of = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let both = [of("level", "kitchen"), of("fragile", "")].into();
        assert_eq!(labels(&both), "fragile, level=kitchen");
    }

    #[test]
    fn sizes_are_edges_in_millimetres_longest_first() {
        assert_eq!(size(Vec3::new(0.01, 0.09, 0.02)), "180 × 40 × 20 mm");
    }
}
