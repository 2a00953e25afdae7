//! The object of a picture.

use std::fmt::Display;

use glam::Vec3;
use grasp_client::{GraspClient, v1};
use grasp_everyday::{EverydayObject, Surface};
use grasp_import::{Import, ImportedMesh, MeshLimits, read_mesh};
use grasp_scene::{Finish, client::ObjectLook, linear_from_srgb};

use crate::{Failure, blocking, format::joined};

/// Limits of a mesh for a picture: ample for detailed scans; larger ones would take minutes to draw.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 1_000_000,
    triangles: 1_000_000,
};

/// A holdout's object as it is drawn: a built-in one as it looks, any other by the mesh that the server has of it.
pub(crate) async fn object_look(client: &GraspClient, holdout: &v1::Holdout) -> Result<ObjectLook, Failure> {
    let object = &holdout.object;
    let look = match ObjectLook::built_in(object) {
        Some(look) => look,
        None => look_of_mesh(object.clone(), client.get_mesh(object).await?.glb).await?,
    };
    Ok(look.scaled(holdout.scale.unwrap_or(1.0))?)
}

/// An everyday object.
pub(crate) fn everyday_look(object: &EverydayObject) -> Result<ObjectLook, Failure> {
    let read = read(object.obj().as_bytes(), object.name)?;
    let is_forbidden = |name: &String| object.forbidden.contains(&name.as_str());
    let groups = read.groups.iter().filter(|(name, _)| is_forbidden(name));
    let forbidden = groups.flat_map(|(_, triangles)| triangles).copied().collect();
    let (colour, finish) = colour_and_finish(object.surface);
    Ok(ObjectLook::new(read.mesh, forbidden, colour, finish))
}

/// A mesh of the server's.
async fn look_of_mesh(object: String, glb: Vec<u8>) -> Result<ObjectLook, Failure> {
    blocking(move || {
        let read = read(&glb, object)?;
        let forbidden = read.groups.into_iter().find(|(name, _)| name == "forbidden");
        let forbidden = forbidden.map(|(_, triangles)| triangles).unwrap_or_default();
        let colour = linear_from_srgb(186, 176, 150);
        Ok(ObjectLook::new(read.mesh, forbidden, colour, Finish::Satin))
    })
    .await
}

/// Reads a mesh; an error names its `source`.
fn read(bytes: &[u8], source: impl Display) -> Result<ImportedMesh, Failure> {
    let read = read_mesh(bytes, Import::METRES, LIMITS);
    read.map_err(|errors| Failure::other(format!("cannot read {source}"), joined("; ", errors)))
}

/// Colour and finish of what everyday objects are made of.
fn colour_and_finish(material: Surface) -> (Vec3, Finish) {
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
