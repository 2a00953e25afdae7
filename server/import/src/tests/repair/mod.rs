//! What the reader makes of meshes that are far away, inside out, doubled or inconsistent.

mod doubles;
mod placement;
mod solids;
mod winding;

use crate::{Import, ImportedMesh, MeshLimits, read_mesh};

/// Ample for every file of these tests.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 16 << 20,
    vertices: 100_000,
    triangles: 100_000,
};

fn read(text: &str) -> ImportedMesh {
    read_mesh(text.as_bytes(), Import::METRES, LIMITS).unwrap_or_else(|errors| panic!("{errors:?}"))
}

/// The volume enclosed by a mesh, by the divergence theorem.
fn volume(read: &ImportedMesh) -> f64 {
    (0..read.mesh.triangles().len())
        .map(|triangle| {
            let [a, b, c] = read.mesh.corners(triangle).map(glam::Vec3::as_dvec3);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}
