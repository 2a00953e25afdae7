//! An object's mesh as a GLB file, made piece by piece when a piece is needed: of the file, nothing is kept in memory.

use std::{iter, sync::Arc};

use glam::Vec3;
use grasp_synthesis::{
    geometry::{boxes::Aabb, mesh::TriangleMesh},
    model::plain_object::PlainObject,
};
use serde_json::json;

use super::{StoredObject, count};

/// Largest number of bytes in a piece: as much as the transport takes at once.
const PIECE_BYTES: usize = 32 << 10;

/// Bytes of the file's header and of the header of each of its two chunks.
const HEADERS: usize = 12 + 8 + 8;

/// Bytes of a position, and of a triangle's indices.
const TRIPLE: usize = 12;

/// Positions or triangles in a piece. The runs of forbidden triangles that begin among so many fit, too: at most every other begins
/// one, which has up to 24 bytes in the JSON.
const PER_PIECE: usize = PIECE_BYTES / TRIPLE;

/// Placeholder for the runs of forbidden triangles in the JSON. No id of an object has such a character.
const RUNS: &str = "*";

/// The same in quotes, as the JSON has it.
const QUOTED_RUNS: &str = "\"*\"";

/// Base colours of the two materials, linear: a light grey, and red for forbidden triangles.
const ALLOWED_COLOUR: [f32; 4] = [0.6, 0.6, 0.6, 1.0];
const FORBIDDEN_COLOUR: [f32; 4] = [0.7, 0.05, 0.05, 1.0];

/// The file in pieces of at most [`PIECE_BYTES`], which keep the object from being evicted: that would free nothing meanwhile. Takes
/// milliseconds for the largest meshes.
pub(crate) fn glb_pieces(object: &Arc<StoredObject>) -> impl Iterator<Item = Vec<u8>> + Send + use<> {
    let held = object.hold();
    let mesh = &object.object.mesh;
    let [before, after] = document(&object.object, &object.id);
    let runs = parts_of(object, mesh.triangles().len(), runs_from);
    let json_bytes = before.len() + runs.clone().map(|text| text.len()).sum::<usize>() + after.len();
    let padding = json_bytes.next_multiple_of(4) - json_bytes;
    let [json, binary] = [json_bytes + padding, binary_bytes(mesh)];
    let [all, json, binary] = [HEADERS + json + binary, json, binary].map(|bytes| count(bytes).to_le_bytes());
    let start = [*b"glTF", 2_u32.to_le_bytes(), all, json, *b"JSON"].concat();
    let json_end = [
        after.into_bytes(),
        vec![b' '; padding],
        binary.to_vec(),
        b"BIN\0".to_vec(),
    ];
    let positions = parts_of(object, mesh.positions().len(), |object, from| {
        let positions = object.mesh.positions()[from..].iter().take(PER_PIECE);
        let numbers = positions.flat_map(Vec3::to_array);
        numbers.flat_map(f32::to_le_bytes).collect()
    });
    let triangles = [false, true].map(|forbidden| {
        parts_of(object, mesh.triangles().len(), move |object, from| {
            let triangles = object.mesh.triangles().iter().enumerate();
            let triangles = triangles.skip(from).take(PER_PIECE);
            let part = triangles.filter(|(place, _)| object.is_forbidden(count(*place)) == forbidden);
            let numbers = part.flat_map(|(_, corners)| *corners);
            numbers.flat_map(u32::to_le_bytes).collect()
        })
    });
    iter::once([start, before.into_bytes()].concat())
        .chain(runs)
        .chain([json_end.concat()])
        .chain(positions)
        .chain(triangles.into_iter().flatten())
        .filter(|piece| !piece.is_empty())
        .zip(iter::repeat(held))
        .map(|(piece, _)| piece)
}

/// `part` of an object from every [`PER_PIECE`]th of its `count` elements on.
fn parts_of<F: Fn(&PlainObject, usize) -> Vec<u8> + Clone>(
    object: &Arc<StoredObject>,
    count: usize,
    part: F,
) -> impl Iterator<Item = Vec<u8>> + Clone + use<F> {
    let object = Arc::clone(object);
    let places = (0..count).step_by(PER_PIECE);
    places.map(move |from| part(&object.object, from))
}

fn binary_bytes(mesh: &TriangleMesh) -> usize {
    TRIPLE * (mesh.positions().len() + mesh.triangles().len())
}

/// The file's JSON before and after the runs of forbidden triangles: one mesh, with allowed triangles before forbidden ones.
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

/// Elements of the JSON's list, first triangle and length, for the forbidden runs that begin among [`PER_PIECE`] triangles.
fn runs_from(object: &PlainObject, from: usize) -> Vec<u8> {
    let all = count(object.mesh.triangles().len());
    let is_forbidden = |&triangle: &u32| object.is_forbidden(triangle);
    let begins = |&first: &u32| is_forbidden(&first) && (first == 0 || !is_forbidden(&(first - 1)));
    let runs = (count(from)..all).take(PER_PIECE).filter(begins).map(|first| {
        let length = (first..all).take_while(is_forbidden).count();
        let mut later = first + count(length)..all;
        let comma = if later.any(|triangle| is_forbidden(&triangle)) {
            ","
        } else {
            ""
        };
        format!("[{first},{length}]{comma}")
    });
    runs.collect::<String>().into_bytes()
}

#[cfg(test)]
mod tests {
    use grasp_import::{Import, MeshLimits, read_mesh};
    use grasp_synthesis::base::stop::unstopped;

    use super::*;
    use crate::objects::tests::tetrahedron;

    /// The whole file, which has the length that its header says.
    fn file(object: &Arc<StoredObject>) -> Vec<u8> {
        let pieces: Vec<Vec<u8>> = glb_pieces(object).collect();
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
