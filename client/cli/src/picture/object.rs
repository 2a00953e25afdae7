//! The object of a picture. The server does not return meshes: they come from the built-in assets or from a file.

use std::{
    fmt::Display,
    path::{Path, PathBuf},
};

use clap::Args;
use grasp_everyday::{EverydayObject, Surface};
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
use grasp_scene::{Finish, client::ObjectLook, linear_from_srgb};

use crate::failure::Failure;

/// Limits of a mesh file for a picture: ample for detailed scans; larger ones would take minutes to draw.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 1_000_000,
    triangles: 1_000_000,
};

/// Where the mesh of a picture's object comes from.
#[derive(Args, Debug)]
pub(crate) struct MeshOptions {
    /// The object's mesh file, for pictures of objects that are not built in.
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Metres per unit of the mesh: 0.001 for millimetres.
    #[arg(long, value_name = "METRES", default_value_t = 1.0, requires = "mesh")]
    mesh_unit_metres: f32,
}

impl MeshOptions {
    /// A request's object as it is drawn: by its name and scale.
    pub(crate) fn look(&self, object: &str, scale: Option<f32>) -> Result<ObjectLook, Failure> {
        let look = match &self.mesh {
            Some(path) => look_of_file(path, self.mesh_unit_metres)?,
            None => ObjectLook::built_in(object).ok_or_else(|| {
                Failure::Usage(format!(
                    "{object} is not built in; pass its mesh with --mesh to draw it"
                ))
            })?,
        };
        Ok(look.scaled(scale.unwrap_or(1.0))?)
    }
}

/// An everyday object.
pub(crate) fn everyday_look(object: &EverydayObject) -> Result<ObjectLook, Failure> {
    let read = read(object.obj().as_bytes(), 1.0, object.name)?;
    let is_forbidden = |name: &String| object.forbidden.contains(&name.as_str());
    let groups = read.groups.iter().filter(|(name, _)| is_forbidden(name));
    let forbidden = groups.flat_map(|(_, triangles)| triangles).copied().collect();
    let (colour, finish) = colour_and_finish(object.surface);
    Ok(ObjectLook::new(read.mesh, forbidden, colour, finish))
}

/// The mesh of a file with units of `unit_metres`.
fn look_of_file(path: &Path, unit_metres: f32) -> Result<ObjectLook, Failure> {
    let text = std::fs::read(path)
        .map_err(|error| Failure::other(format!("cannot read {}", path.display()), error))?;
    let read = read(&text, unit_metres, path.display())?;
    let colour = linear_from_srgb(186, 176, 150);
    Ok(ObjectLook::new(read.mesh, Vec::new(), colour, Finish::Satin))
}

/// Reads a mesh; an error names its `source`.
fn read(bytes: &[u8], unit_metres: f32, source: impl Display) -> Result<ImportedMesh, Failure> {
    read_mesh(bytes, Import::with_unit(unit_metres), LIMITS).map_err(|errors| {
        let errors: Vec<_> = errors.iter().map(ToString::to_string).collect();
        Failure::other(format!("cannot read {source}"), errors.join("; "))
    })
}

/// Colour and finish of what everyday objects are made of.
fn colour_and_finish(material: Surface) -> ([f32; 4], Finish) {
    let ([red, green, blue], finish) = match material {
        Surface::Metal => ([198, 203, 210], Finish::Metal),
        Surface::Glass => ([202, 216, 222], Finish::Satin),
        Surface::Plastic => ([92, 128, 168], Finish::Satin),
        Surface::Rubber => ([84, 88, 94], Finish::Satin),
        Surface::Wood => ([186, 148, 98], Finish::Satin),
        Surface::Paper => ([226, 220, 202], Finish::Cloth),
        Surface::Cloth => ([146, 168, 96], Finish::Cloth),
        Surface::Leather => ([142, 86, 54], Finish::Satin),
        Surface::Rough => ([168, 84, 62], Finish::Cloth),
        Surface::Natural => ([214, 186, 92], Finish::Satin),
    };
    (linear_from_srgb(red, green, blue), finish)
}
