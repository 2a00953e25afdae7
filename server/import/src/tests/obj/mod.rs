//! The OBJ reader: accepted and rejected text, robustness, files from elsewhere.

mod files;
mod polygons;
mod reading;
mod reference;
mod rejecting;

use crate::{Import, ImportError, ImportedMesh, MeshLimits, read_mesh};

/// Ample for every file of these tests.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 16 << 20,
    vertices: 100_000,
    triangles: 100_000,
};

fn read(text: &str) -> Result<ImportedMesh, Vec<ImportError>> {
    read_mesh(text.as_bytes(), Import::METRES, LIMITS)
}

/// A cube of 2 m, by quads, wound outward.
const CUBE: &str = "\
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// The volume enclosed by a mesh, by the divergence theorem.
fn volume(read: &ImportedMesh) -> f64 {
    (0..read.mesh.triangles().len())
        .map(|triangle| {
            let [a, b, c] = read.mesh.corners(triangle).map(glam::Vec3::as_dvec3);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}
