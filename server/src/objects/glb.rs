//! An object's mesh as a GLB file, made piece by piece when a piece is needed: of the file, nothing is kept in memory.

use std::sync::Arc;

use glam::Vec3;
use grasp_synthesis::{
    geometry::{boxes::Aabb, mesh::TriangleMesh},
    model::plain_object::PlainObject,
};
use serde_json::json;

use super::{StoredObject, count};

/// Largest number of bytes in a piece: as much as the transport takes at once.
pub(crate) const PIECE_BYTES: usize = 32 << 10;

/// Bytes of the file's header and of the header of each of its two chunks.
const HEADERS: usize = 12 + 8 + 8;

/// Bytes of a position, and of a triangle's indices.
const TRIPLE: usize = 12;

/// Largest number of bytes of a run of forbidden triangles in the JSON, with a comma: two numbers of up to ten digits.
const RUN_BYTES: usize = 24;

/// Stands for the runs of forbidden triangles in the JSON. No id of an object has such a character.
const RUNS: &str = "*";

/// The same in quotes, as the JSON has it.
const QUOTED_RUNS: &str = "\"*\"";

/// Base colours of the two materials, linear: a light grey, and red for what must not be touched.
const ALLOWED_COLOUR: [f32; 4] = [0.6, 0.6, 0.6, 1.0];
const FORBIDDEN_COLOUR: [f32; 4] = [0.7, 0.05, 0.05, 1.0];

/// The file in pieces of at most [`PIECE_BYTES`].
#[derive(Debug)]
pub(crate) struct GlbPieces {
    object: Arc<StoredObject>,
    /// Keeps the object from being evicted, which would free nothing meanwhile.
    _held: Arc<()>,
    /// Size of the file.
    bytes: usize,
    /// Its JSON before and after the runs of forbidden triangles.
    json: [String; 2],
    /// Size of its JSON, padded with spaces to a multiple of four bytes.
    json_bytes: usize,
    next: Part,
    /// Bytes of JSON so far.
    sent_json: usize,
}

/// The part of the file that comes next.
#[derive(Clone, Copy, Debug)]
enum Part {
    /// The headers, and the JSON up to the runs of forbidden triangles.
    Start,
    /// The runs from a triangle on.
    Runs(u32),
    /// The rest of the JSON, and the header of what follows.
    JsonEnd,
    /// The positions from one on.
    Positions(usize),
    /// The triangles from one on, of those that may be touched or of the others.
    Triangles { from: u32, forbidden: bool },
    /// Nothing.
    End,
}

impl GlbPieces {
    /// All pieces. Takes milliseconds for the largest meshes.
    pub(crate) fn new(object: Arc<StoredObject>) -> Self {
        let json = document(&object.object, &object.id);
        let runs = runs_from(&object.object, 0).enumerate();
        let runs: usize = runs.map(|(place, run)| run_text(run, place == 0).len()).sum();
        let json_bytes = (json[0].len() + runs + json[1].len()).next_multiple_of(4);
        Self {
            _held: object.hold(),
            bytes: HEADERS + json_bytes + binary_bytes(&object.object.mesh),
            json,
            json_bytes,
            object,
            next: Part::Start,
            sent_json: 0,
        }
    }

    /// The bytes of the next part, or of its beginning, and what follows them.
    fn part(&mut self) -> (Vec<u8>, Part) {
        let object = &self.object.object;
        let mesh = &*object.mesh;
        match self.next {
            Part::Start => {
                let before = self.json[0].as_bytes();
                self.sent_json += before.len();
                let mut piece = b"glTF".to_vec();
                for number in [2, count(self.bytes), count(self.json_bytes)] {
                    piece.extend(number.to_le_bytes());
                }
                piece.extend(*b"JSON");
                piece.extend(before);
                (piece, Part::Runs(0))
            }
            Part::Runs(from) => {
                let mut piece = String::new();
                let mut next = Part::JsonEnd;
                for run in runs_from(object, from) {
                    if piece.len() + RUN_BYTES > PIECE_BYTES {
                        next = Part::Runs(run[0]);
                        break;
                    }
                    piece += &run_text(run, from == 0 && piece.is_empty());
                }
                self.sent_json += piece.len();
                (piece.into_bytes(), next)
            }
            Part::JsonEnd => {
                let mut piece = self.json[1].as_bytes().to_vec();
                piece.resize(self.json_bytes - self.sent_json, b' ');
                piece.extend(count(binary_bytes(mesh)).to_le_bytes());
                piece.extend(*b"BIN\0");
                (piece, Part::Positions(0))
            }
            Part::Positions(from) => {
                let positions = mesh.positions()[from..].iter().take(PIECE_BYTES / TRIPLE);
                let piece: Vec<u8> = positions
                    .flat_map(Vec3::to_array)
                    .flat_map(f32::to_le_bytes)
                    .collect();
                let next = if piece.is_empty() {
                    let forbidden = false;
                    Part::Triangles { from: 0, forbidden }
                } else {
                    Part::Positions(from + piece.len() / TRIPLE)
                };
                (piece, next)
            }
            Part::Triangles { from, forbidden } => {
                let mut next = from;
                let triangles = (from..count(mesh.triangles().len()))
                    .filter(|&triangle| object.is_forbidden(triangle) == forbidden)
                    .take(PIECE_BYTES / TRIPLE)
                    .inspect(|triangle| next = triangle + 1);
                let corners = triangles.flat_map(|triangle| mesh.triangles()[triangle as usize]);
                let piece: Vec<u8> = corners.flat_map(u32::to_le_bytes).collect();
                let next = match (piece.is_empty(), forbidden) {
                    (false, _) => Part::Triangles {
                        from: next,
                        forbidden,
                    },
                    (true, false) => Part::Triangles {
                        from: 0,
                        forbidden: true,
                    },
                    (true, true) => Part::End,
                };
                (piece, next)
            }
            Part::End => (Vec::new(), Part::End),
        }
    }
}

impl Iterator for GlbPieces {
    type Item = Vec<u8>;

    fn next(&mut self) -> Option<Vec<u8>> {
        while !matches!(self.next, Part::End) {
            let (piece, next) = self.part();
            self.next = next;
            if !piece.is_empty() {
                return Some(piece);
            }
        }
        None
    }
}

fn binary_bytes(mesh: &TriangleMesh) -> usize {
    TRIPLE * (mesh.positions().len() + mesh.triangles().len())
}

/// The file's JSON before and after the runs of forbidden triangles: one mesh of up to two primitives that share their vertices,
/// triangles that may be touched before those that must not.
fn document(object: &PlainObject, name: &str) -> [String; 2] {
    let mesh = &object.mesh;
    let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
    let forbidden = object.forbidden_count();
    let Aabb { min, max } = Aabb::around(mesh.positions().iter().copied());
    let parts = [
        ("surface", triangles - forbidden, ALLOWED_COLOUR, 0),
        ("forbidden", forbidden, FORBIDDEN_COLOUR, triangles - forbidden),
    ];
    let parts: Vec<_> = parts.into_iter().filter(|(_, count, ..)| *count > 0).collect();
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": vertices,
        "min": min.to_array(), "max": max.to_array(),
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
                primitive["extras"] = json!({"triangles": [RUNS]});
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
    let document = json!({
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
    .to_string();
    match document.split_once(QUOTED_RUNS) {
        Some((before, after)) => [before.to_owned(), after.to_owned()],
        None => [document, String::new()],
    }
}

/// Where the forbidden triangles are among all of the mesh, whose indices contacts name, from one on: the first of each run and
/// how many follow one another.
fn runs_from(object: &PlainObject, from: u32) -> impl Iterator<Item = [u32; 2]> {
    let end = count(object.mesh.triangles().len());
    let mut from = from;
    std::iter::from_fn(move || {
        let first = (from..end).find(|&triangle| object.is_forbidden(triangle))?;
        from = (first..end)
            .find(|&triangle| !object.is_forbidden(triangle))
            .unwrap_or(end);
        Some([first, from - first])
    })
}

/// A run in the list of the JSON.
fn run_text([first, count]: [u32; 2], is_first: bool) -> String {
    let comma = if is_first { "" } else { "," };
    format!("{comma}[{first},{count}]")
}

#[cfg(test)]
mod tests {
    use grasp_import::{Import, MeshLimits, read_mesh};
    use grasp_synthesis::base::stop::unstopped;

    use super::*;
    use crate::objects::tests::tetrahedron;

    /// The whole file, which has the length that its header says.
    fn file(object: &Arc<StoredObject>) -> Vec<u8> {
        let pieces: Vec<Vec<u8>> = GlbPieces::new(Arc::clone(object)).collect();
        assert!(pieces.iter().all(|piece| piece.len() <= PIECE_BYTES));
        let file = pieces.concat();
        let length = u32::from_le_bytes(file[8..12].try_into().unwrap());
        assert_eq!(file.len(), length as usize);
        file
    }

    #[test]
    fn the_file_reads_back_as_the_mesh_with_its_forbidden_part() {
        let stored = Arc::new(tetrahedron("small", 0.1, &[1, 2]));
        let file = file(&stored);
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

    /// The file's JSON.
    fn json_of(file: &[u8]) -> serde_json::Value {
        let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        serde_json::from_slice(&file[20..20 + length]).unwrap()
    }

    #[test]
    fn names_the_runs_of_forbidden_triangles() {
        for (forbidden, runs) in [
            (&[0, 2, 3][..], json!([[0, 1], [2, 2]])),
            (&[1], json!([[1, 1]])),
            (&[0, 1, 2, 3], json!([[0, 4]])),
        ] {
            let json = json_of(&file(&Arc::new(tetrahedron("runs", 0.1, forbidden))));
            let primitives = json["meshes"][0]["primitives"].as_array().unwrap();
            assert_eq!(primitives.last().unwrap()["extras"]["triangles"], runs);
        }
        let json = json_of(&file(&Arc::new(tetrahedron("free", 0.1, &[]))));
        assert_eq!(json["meshes"][0]["primitives"].as_array().unwrap().len(), 1);
    }

    #[test]
    fn a_long_list_of_runs_comes_in_pieces() {
        let triangles: u32 = 20_000;
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mesh = TriangleMesh::new(positions, vec![[0, 1, 2]; triangles as usize]).unwrap();
        let forbidden: Vec<u32> = (0..triangles).step_by(2).collect();
        let object = unstopped(|stop| PlainObject::new_until(mesh, 0.1, Vec3::ZERO, None, &forbidden, stop));
        let file = file(&Arc::new(StoredObject::plain("striped", object.unwrap())));
        let json = json_of(&file);
        let runs = json["meshes"][0]["primitives"][1]["extras"]["triangles"]
            .as_array()
            .unwrap();
        let expected = forbidden.iter().map(|&first| json!([first, 1]));
        assert!(runs.iter().cloned().eq(expected), "{} runs", runs.len());
    }
}
