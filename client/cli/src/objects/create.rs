//! `grasp objects create`

use std::path::{Path, PathBuf};

use clap::{ArgAction, Args};
use grasp_client::v1;

use super::{describe::show, marks, properties::Properties};
use crate::{
    Failure, Output, ServerOptions,
    format::joined,
    input::read_file,
    values::{Choice, one_of},
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
#[command(after_long_help = format!("{}\n\n{}", marks::REGIONS, marks::KNOWN_GRIPS))]
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
    #[arg(long = "up-axis", value_name = "AXIS", value_parser = one_of(UP_AXES), default_value = "y")]
    #[arg(action = ArgAction::Set)]
    z_up: bool,
    /// A part of the file that is the object, by the name of a group, object or node; may be repeated. Default: all parts that are
    /// seen, without colliders and lower levels of detail.
    #[arg(long = "part", value_name = "NAME")]
    parts: Vec<String>,
    #[command(flatten)]
    properties: Properties,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let mesh = read_file(&arguments.mesh)?;
    let id = arguments.id.unwrap_or_else(|| id_from_file(&arguments.mesh));
    let object = v1::GraspObject {
        mass_kg: arguments.mass,
        meters_per_unit: arguments.unit_metres,
        z_up: arguments.z_up,
        parts: arguments.parts,
        ..arguments.properties.object(&id)?
    };
    let request = v1::CreateObjectRequest {
        object: Some(object),
        mesh,
        request_id: String::new(),
    };
    let client = arguments.server.connect().await?;
    let object = client.create_object(&request).await?;
    show(&client, &object, output).await
}

/// The file's name without its extension, in lower case, with hyphens for runs of other characters.
pub(crate) fn id_from_file(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = stem.to_lowercase();
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    joined("-", words.filter(|word| !word.is_empty()))
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
