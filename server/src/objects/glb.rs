//! An object's mesh as a GLB file, made piece by piece, so that it is never in memory as a whole.

use glam::Vec3;
use grasp_synthesis::{geometry::mesh::TriangleMesh, model::plain_object::PlainObject};
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::count;

/// Largest number of bytes in a piece.
pub(crate) const PIECE_BYTES: usize = 128 << 10;

/// Bytes of the file's header and of the header of each of its two chunks.
const HEADERS: usize = 12 + 8 + 8;

/// Bytes of a position, and of a triangle's indices.
const TRIPLE: usize = 12;

/// Base colours of the two materials, linear: a light grey, and red for what must not be touched.
const ALLOWED_COLOUR: [f32; 4] = [0.6, 0.6, 0.6, 1.0];
const FORBIDDEN_COLOUR: [f32; 4] = [0.7, 0.05, 0.05, 1.0];

/// The file of an object's mesh.
#[derive(Debug)]
pub(crate) struct MeshGlb<'a> {
    object: &'a PlainObject,
    /// The file's JSON, padded with spaces to a multiple of four bytes.
    document: Vec<u8>,
}

impl<'a> MeshGlb<'a> {
    /// Prepares the file, without its mesh.
    pub(crate) fn new(object: &'a PlainObject, name: &str) -> Self {
        let mut document = document(object, name).to_string().into_bytes();
        document.resize(document.len().next_multiple_of(4), b' ');
        Self { object, document }
    }

    /// Its size in bytes. Meshes are bounded far below the 4 GiB of the format.
    pub(crate) fn bytes(&self) -> usize {
        HEADERS + self.document.len() + binary_bytes(self.mesh())
    }

    /// The SHA-256 of all pieces.
    pub(crate) fn sha256(&self) -> [u8; 32] {
        let mut hash = Sha256::new();
        self.pieces().for_each(|piece| hash.update(piece));
        hash.finalize().into()
    }

    /// The file in pieces of at most [`PIECE_BYTES`].
    pub(crate) fn pieces(&self) -> impl Iterator<Item = Vec<u8>> {
        let head = self.head();
        let head: Vec<Vec<u8>> = head.chunks(PIECE_BYTES).map(<[u8]>::to_vec).collect();
        let mesh = self.mesh();
        let per_piece = PIECE_BYTES / TRIPLE;
        let positions = mesh.positions().chunks(per_piece).map(|positions| {
            let numbers = positions.iter().flat_map(Vec3::to_array);
            numbers.flat_map(f32::to_le_bytes).collect()
        });
        let of_kind = move |forbidden: bool| {
            let triangles = (0..count(mesh.triangles().len()))
                .filter(move |&triangle| self.object.is_forbidden(triangle) == forbidden);
            Indices {
                mesh,
                triangles: Box::new(triangles),
            }
        };
        head.into_iter()
            .chain(positions)
            .chain(of_kind(false))
            .chain(of_kind(true))
    }

    /// Everything before the positions.
    fn head(&self) -> Vec<u8> {
        let binary = count(binary_bytes(self.mesh()));
        let mut head = Vec::with_capacity(HEADERS + self.document.len());
        head.extend(*b"glTF");
        for number in [2, count(self.bytes()), count(self.document.len())] {
            head.extend(number.to_le_bytes());
        }
        head.extend(*b"JSON");
        head.extend(&self.document);
        head.extend(binary.to_le_bytes());
        head.extend(*b"BIN\0");
        head
    }

    fn mesh(&self) -> &'a TriangleMesh {
        &self.object.mesh
    }
}

/// The indices of some triangles, in pieces.
struct Indices<'a> {
    mesh: &'a TriangleMesh,
    triangles: Box<dyn Iterator<Item = u32> + Send + 'a>,
}

impl Iterator for Indices<'_> {
    type Item = Vec<u8>;

    fn next(&mut self) -> Option<Vec<u8>> {
        let triangles = self.triangles.by_ref().take(PIECE_BYTES / TRIPLE);
        let corners = triangles.flat_map(|triangle| self.mesh.triangles()[triangle as usize]);
        let piece: Vec<u8> = corners.flat_map(u32::to_le_bytes).collect();
        (!piece.is_empty()).then_some(piece)
    }
}

fn binary_bytes(mesh: &TriangleMesh) -> usize {
    TRIPLE * (mesh.positions().len() + mesh.triangles().len())
}

/// The file's JSON: one mesh of up to two primitives that share their vertices, triangles that may be touched before those
/// that must not.
fn document(object: &PlainObject, name: &str) -> serde_json::Value {
    let mesh = &object.mesh;
    let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
    let forbidden = object.forbidden_count();
    let (low, high) = bounds(mesh);
    let parts = [
        ("surface", triangles - forbidden, ALLOWED_COLOUR, 0),
        ("forbidden", forbidden, FORBIDDEN_COLOUR, triangles - forbidden),
    ];
    let parts: Vec<_> = parts.into_iter().filter(|(_, count, ..)| *count > 0).collect();
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": vertices,
        "min": low.to_array(), "max": high.to_array(),
    })];
    accessors.extend(parts.iter().map(|(_, count, _, first)| {
        json!({
            "bufferView": 1, "byteOffset": TRIPLE * first,
            "componentType": 5125, "type": "SCALAR", "count": 3 * count,
        })
    }));
    let primitives: Vec<_> = (0..parts.len())
        .map(|part| {
            let mut primitive = json!({
                "attributes": {"POSITION": 0}, "indices": part + 1, "material": part,
            });
            if parts[part].0 == "forbidden" {
                primitive["extras"] = json!({"triangles": runs(object)});
            }
            primitive
        })
        .collect();
    let materials: Vec<_> = parts
        .iter()
        .map(|(name, _, colour, _)| {
            json!({
                "name": name,
                "doubleSided": true,
                "pbrMetallicRoughness": {
                    "baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.6,
                },
            })
        })
        .collect();
    json!({
        "asset": {"version": "2.0", "generator": "grasp"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"name": name, "primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": TRIPLE * vertices, "target": 34962},
            {"buffer": 0, "byteOffset": TRIPLE * vertices, "byteLength": TRIPLE * triangles, "target": 34963},
        ],
        "buffers": [{"byteLength": binary_bytes(mesh)}],
    })
}

/// The corners of the box around all vertices.
fn bounds(mesh: &TriangleMesh) -> (Vec3, Vec3) {
    let all = mesh.positions().iter();
    all.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &position| {
        (low.min(position), high.max(position))
    })
}

/// Where the forbidden triangles are among all of the mesh, whose indices contacts name: the first of each run and how many
/// follow one another.
fn runs(object: &PlainObject) -> Vec<[u32; 2]> {
    let mut runs: Vec<[u32; 2]> = Vec::new();
    for triangle in 0..count(object.mesh.triangles().len()) {
        if !object.is_forbidden(triangle) {
            continue;
        }
        match runs.last_mut() {
            Some([first, count]) if *first + *count == triangle => *count += 1,
            _ => runs.push([triangle, 1]),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use grasp_import::{Import, MeshLimits, read_mesh};

    use super::*;
    use crate::objects::tests::tetrahedron;

    #[test]
    fn the_file_reads_back_as_the_mesh_with_its_forbidden_part() {
        let stored = tetrahedron("small", 0.1, &[1, 2]);
        let glb = MeshGlb::new(&stored.object, "small");
        let pieces: Vec<Vec<u8>> = glb.pieces().collect();
        assert!(pieces.iter().all(|piece| piece.len() <= PIECE_BYTES));
        let file = pieces.concat();
        assert_eq!(file.len(), glb.bytes());
        assert_eq!(<[u8; 32]>::from(Sha256::digest(&file)), glb.sha256());
        let limits = MeshLimits {
            bytes: 1 << 20,
            vertices: 100,
            triangles: 100,
        };
        let read = read_mesh(&file, Import::METRES, limits).expect("it is a GLB file");
        assert_eq!(read.mesh.triangles().len(), 4);
        let original = &stored.object.mesh;
        assert_eq!(read.mesh.positions().len(), original.positions().len());
        let (_, forbidden) = read
            .groups
            .iter()
            .find(|(name, _)| name == "forbidden")
            .expect("the material is a group");
        // Allowed triangles come first.
        assert_eq!(forbidden, &[2, 3]);
        let corners = |mesh: &TriangleMesh, triangle: usize| {
            let mut corners = mesh
                .corners(triangle)
                .map(|corner| corner.to_array().map(f32::to_bits));
            corners.sort_unstable();
            corners
        };
        for (in_file, in_mesh) in [(0, 0), (1, 3), (2, 1), (3, 2)] {
            assert_eq!(corners(&read.mesh, in_file), corners(original, in_mesh));
        }
    }

    #[test]
    fn names_the_runs_of_forbidden_triangles() {
        let stored = tetrahedron("small", 0.1, &[0, 2, 3]);
        assert_eq!(runs(&stored.object), [[0, 1], [2, 2]]);
        let free = tetrahedron("free", 0.1, &[]);
        let document = document(&free.object, "free");
        assert_eq!(document["meshes"][0]["primitives"].as_array().unwrap().len(), 1);
    }
}
