//! STL, PLY and glTF: the same solid in every format, files from elsewhere, damaged files.

mod files;
mod gltf;
mod parts;
mod plain_formats;
mod solid;

use crate::{Import, ImportError, ImportedMesh, MeshLimits, read_mesh};

/// Ample for every file of these tests.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 16 << 20,
    vertices: 100_000,
    triangles: 100_000,
};

fn read(bytes: &[u8]) -> Result<ImportedMesh, Vec<ImportError>> {
    read_mesh(bytes, Import::METRES, LIMITS)
}

/// The only message for bytes that are rejected.
fn message(bytes: &[u8]) -> String {
    let errors = read(bytes).expect_err("must be rejected");
    assert_eq!(errors.len(), 1, "{errors:?}");
    errors[0].to_string()
}

/// The volume enclosed by a mesh, by the divergence theorem.
fn volume(read: &ImportedMesh) -> f64 {
    let triangles = 0..read.mesh.triangles().len();
    let signed = triangles.map(|triangle| {
        let [a, b, c] = read.mesh.corners(triangle).map(glam::Vec3::as_dvec3);
        a.dot(b.cross(c)) / 6.0
    });
    signed.sum()
}
