//! The object of a picture.

use std::fmt::Display;

use grasp_client::{GraspClient, v1};
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
