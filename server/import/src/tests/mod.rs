//! Reading meshes and rigs from the bytes of clients.

mod formats;
mod gltf;
mod obj_reading;
mod obj_rejecting;
mod parts;
mod polygons;
mod reference;
mod repair;
mod rigs;

use crate::{Import, ImportError, ImportedMesh, MeshLimits, read_mesh};
use glam::Vec3;
use grasp_characters::ring::{Ring, floats};

/// Ample for every file of these tests.
const LIMITS: MeshLimits = MeshLimits {
    bytes: 16 << 20,
    vertices: 100_000,
    triangles: 100_000,
};

/// A cube of 2 m, by quads, wound outward.
const CUBE: &str = "\
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn read(bytes: impl AsRef<[u8]>) -> Result<ImportedMesh, Vec<ImportError>> {
    read_mesh(bytes.as_ref(), Import::METRES, LIMITS)
}

fn messages<T>(read: Result<T, Vec<ImportError>>) -> Vec<String> {
    let errors = read.err().expect("must be rejected");
    errors.iter().map(ToString::to_string).collect()
}

/// The only message for bytes that are rejected.
fn message(bytes: impl AsRef<[u8]>) -> String {
    let [message] = messages(read(bytes)).try_into().expect("one message");
    message
}

/// Asserts that one message contains all of some words.
#[track_caller]
fn assert_mentioned(messages: &[String], words: &[&str]) {
    let says = |message: &String| words.iter().all(|word| message.contains(word));
    assert!(messages.iter().any(says), "{words:?} in {messages:?}");
}

/// The volume enclosed by a mesh, by the divergence theorem.
fn volume(read: &ImportedMesh) -> f64 {
    let corners = corners(read).into_iter();
    let signed = corners.map(|corners| {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        a.dot(b.cross(c)) / 6.0
    });
    signed.sum()
}

/// The corners of all triangles.
fn corners(read: &ImportedMesh) -> Vec<[Vec3; 3]> {
    let triangles = 0..read.mesh.triangles().len();
    triangles.map(|triangle| read.mesh.corners(triangle)).collect()
}

/// A GLB container.
pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let document = serde_json::from_str(json).expect("it is JSON");
    grasp_characters::glb(&document, binary.to_vec())
}
