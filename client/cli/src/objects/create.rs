//! `grasp objects create`

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use clap::{ArgAction, Args};
use glam::Vec3;
use grasp_client::v1;

use super::{full_name, known_grips, known_grips_in, regions, regions_in};
use crate::{
    Ending,
    failure::Failure,
    output::Output,
    server_options::ServerOptions,
    values::{Choice, one_of, parse_label, parse_triangles, parse_vector},
};

/// Whether +Z points up.
const UP_AXES: [Choice<bool>; 2] = [
    ("y", false, "+Y"),
    ("z", true, "+Z, as in CAD and modelling tools"),
];

/// Create an object from a mesh: OBJ, STL, PLY, GLB or glTF.
///
/// Shows the new object, like `grasp objects get`.
#[derive(Args, Debug)]
#[command(after_long_help = format!("{}\n\n{}", regions::FORMAT, known_grips::FORMAT))]
pub(crate) struct Arguments {
    /// Last part of the object's name. Default: the file's name in lower case, with hyphens.
    id: Option<String>,
    /// The mesh.
    #[arg(long, value_name = "FILE", alias = "obj")]
    mesh: PathBuf,
    /// Mass in kilograms.
    #[arg(long, value_name = "KG")]
    mass: f32,
    /// Metres per unit of the mesh: 0.001 for millimetres. Default: 1.
    #[arg(long, value_name = "METRES")]
    unit_metres: Option<f32>,
    /// The axis that points up in the file.
    #[arg(long = "up-axis", value_name = "AXIS", value_parser = one_of(UP_AXES), default_value = "y", action = ArgAction::Set)]
    z_up: bool,
    /// A part of the file that is the object, by the name of a group, object or node; may be repeated. Default: all parts that are
    /// seen, without colliders and lower levels of detail.
    #[arg(long = "part", value_name = "NAME")]
    parts: Vec<String>,
    /// Centre of mass in metres after scaling and turning. Default: that of the mesh's volume.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction between skin and surface. Default: the server's.
    #[arg(long, value_name = "MU")]
    friction: Option<f32>,
    /// A group, object or material of the file that must not be touched; may be repeated.
    #[arg(long, value_name = "NAME")]
    forbidden_group: Vec<String>,
    /// Triangles that must not be touched: indices and ranges, such as 7,10-20.
    #[arg(long, value_name = "INDICES", value_parser = parse_triangles, value_delimiter = ',')]
    forbidden_triangles: Vec<RangeInclusive<u32>>,
    /// A JSON file with the object's regions, which hands should take, leave, or not touch; see below.
    #[arg(long, value_name = "FILE")]
    regions: Option<PathBuf>,
    /// A JSON file with grips of the object, to try first or not to answer; see below.
    #[arg(long, value_name = "FILE")]
    known_grips: Option<PathBuf>,
    /// A label, such as level=kitchen; may be repeated.
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = parse_label)]
    labels: Vec<(String, String)>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let mesh = std::fs::read(&arguments.mesh)
        .map_err(|error| Failure::other(format!("cannot read {}", arguments.mesh.display()), error))?;
    let id = match arguments.id {
        Some(id) => id,
        None => id_from_file(&arguments.mesh),
    };
    let mut regions = regions_in(arguments.regions.as_deref())?.unwrap_or_default();
    regions.extend(regions::forbidden(
        arguments.forbidden_group,
        &arguments.forbidden_triangles,
    ));
    let object = v1::GraspObject {
        name: full_name(&id),
        labels: arguments.labels.into_iter().collect(),
        mass_kg: arguments.mass,
        center_of_mass: arguments.centre_of_mass.map(Into::into),
        friction: arguments.friction,
        regions,
        known_grips: known_grips_in(arguments.known_grips.as_deref())?.unwrap_or_default(),
        meters_per_unit: arguments.unit_metres,
        z_up: arguments.z_up,
        parts: arguments.parts,
        ..v1::GraspObject::default()
    };
    let request = v1::CreateObjectRequest {
        object: Some(object),
        mesh,
        request_id: String::new(),
    };
    let client = arguments.server.connect().await?;
    let object = client.create_object(&request).await?;
    super::show(&client, &object, output).await
}

/// The file's name without its extension, in lower case, with hyphens for runs of other characters.
pub(crate) fn id_from_file(path: &Path) -> String {
    let stem = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let words: Vec<_> = stem
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty())
        .collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derives_id_from_file_name() {
        let id = |path: &str| id_from_file(Path::new(path));
        assert_eq!(id("/tmp/Coffee Mug (v2).obj"), "coffee-mug-v2");
        assert_eq!(id("osim_banana.obj"), "osim-banana");
        assert_eq!(id("/"), "");
    }
}
