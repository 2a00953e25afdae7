//! How much memory reading a mesh takes at its peak, in every format.

use std::{fmt::Write as _, iter::repeat_n};

use crate::{ALLOCATOR, alone};
use base64::{Engine as _, prelude::BASE64_STANDARD};
use grasp_characters::glb;
use grasp_import::{Import, MeshLimits, read_mesh};
use serde_json::{Value, json};

/// Memory that reading may take at its peak, what it returns included, as a multiple of the file.
const BYTES_PER_BYTE: usize = 6;

/// Rows and columns of vertices: 100,352 triangles.
const SIDE: u32 = 224;

const LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 200_000,
    triangles: 200_000,
};

/// A torus of quads, which has neither rim nor poles.
struct Torus {
    positions: Vec<[f32; 3]>,
    quads: Vec<[u32; 4]>,
}

impl Torus {
    fn new() -> Self {
        let angle = |step: u32| std::f32::consts::TAU * step as f32 / SIDE as f32;
        let steps = || (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column)));
        let position = |(row, column)| {
            let ((sin, cos), (height, out)) = (angle(row).sin_cos(), angle(column).sin_cos());
            let radius = 0.05 + 0.02 * out;
            [radius * cos, radius * sin, 0.02 * height]
        };
        let vertex = |row: u32, column: u32| (row % SIDE) * SIDE + column % SIDE;
        let quad = |(row, column)| {
            [
                vertex(row, column),
                vertex(row + 1, column),
                vertex(row + 1, column + 1),
                vertex(row, column + 1),
            ]
        };
        Self {
            positions: steps().map(position).collect(),
            quads: steps().map(quad).collect(),
        }
    }

    fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
    }

    fn corners(&self) -> impl Iterator<Item = [[f32; 3]; 3]> {
        let position = |vertex: u32| self.positions[vertex as usize];
        self.triangles().map(move |corners| corners.map(position))
    }

    fn obj(&self, faces: impl Iterator<Item = String>) -> Vec<u8> {
        let mut text = String::new();
        for [x, y, z] in &self.positions {
            let _ = writeln!(text, "v {x:.5} {y:.5} {z:.5}");
        }
        text.extend(faces);
        text.into_bytes()
    }

    fn obj_of_triangles(&self) -> Vec<u8> {
        self.obj(
            self.triangles()
                .map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)),
        )
    }

    /// Its triangles and quads take turns.
    fn obj_of_both(&self) -> Vec<u8> {
        let quads = self.quads.iter().zip([true, false].into_iter().cycle());
        self.obj(quads.map(|([a, b, c, d], is_split)| {
            let [a, b, c, d] = [a, b, c, d].map(|vertex| vertex + 1);
            if is_split {
                format!("f {a} {b} {c}\nf {a} {c} {d}\n")
            } else {
                format!("f {a} {b} {c} {d}\n")
            }
        }))
    }

    fn stl_text(&self) -> Vec<u8> {
        let mut text = "solid torus\n".to_owned();
        for corners in self.corners() {
            text.push_str("facet normal 0 0 0\nouter loop\n");
            for [x, y, z] in corners {
                let _ = writeln!(text, "vertex {x:.5} {y:.5} {z:.5}");
            }
            text.push_str("endloop\nendfacet\n");
        }
        text.push_str("endsolid torus\n");
        text.into_bytes()
    }

    /// Binary STL whose header starts as text does.
    fn stl_binary(&self) -> Vec<u8> {
        let mut bytes = b"solid".to_vec();
        bytes.extend(repeat_n(0, 75));
        bytes.extend((self.triangles().count() as u32).to_le_bytes());
        for corners in self.corners() {
            bytes.extend([0; 12]);
            bytes.extend(corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ply_header(&self, format: &str) -> String {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangles().count()
        )
    }

    fn ply_text(&self) -> Vec<u8> {
        let mut text = self.ply_header("ascii");
        for [x, y, z] in &self.positions {
            let _ = writeln!(text, "{x:.5} {y:.5} {z:.5}");
        }
        for [a, b, c] in self.triangles() {
            let _ = writeln!(text, "3 {a} {b} {c}");
        }
        text.into_bytes()
    }

    fn ply_binary(&self) -> Vec<u8> {
        let mut bytes = self.ply_header("binary_little_endian").into_bytes();
        bytes.extend(self.coordinates());
        for corners in self.triangles() {
            bytes.push(3);
            bytes.extend(corners.iter().flat_map(|corner| corner.to_le_bytes()));
        }
        bytes
    }

    fn coordinates(&self) -> impl Iterator<Item = u8> {
        let coordinates = self.positions.as_flattened().iter();
        coordinates.flat_map(|x| x.to_le_bytes())
    }

    /// A scene with one primitive, and its buffer. `component` is the type of indices as glTF numbers it.
    fn gltf(&self, component: u32, indices: &[u8]) -> (Value, Vec<u8>) {
        let buffer: Vec<u8> = self.coordinates().chain(indices.iter().copied()).collect();
        let (vertices, of_positions) = (self.positions.len(), 12 * self.positions.len());
        let document = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
            "buffers": [{"byteLength": buffer.len()}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 0, "byteLength": of_positions},
                {"buffer": 0, "byteOffset": of_positions, "byteLength": indices.len()},
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
                 "min": [-0.07, -0.07, -0.02], "max": [0.07, 0.07, 0.02]},
                {"bufferView": 1, "componentType": component, "count": 3 * self.triangles().count(), "type": "SCALAR"},
            ],
        });
        (document, buffer)
    }

    fn glb_of_16_bits(&self) -> Vec<u8> {
        let indices = self.triangles().flatten().map(|index| index as u16);
        let (document, buffer) = self.gltf(5123, &indices.flat_map(u16::to_le_bytes).collect::<Vec<_>>());
        glb(&document, buffer)
    }

    fn gltf_text(&self) -> Vec<u8> {
        let indices: Vec<u8> = self.triangles().flatten().flat_map(u32::to_le_bytes).collect();
        let (mut document, buffer) = self.gltf(5125, &indices);
        let data = BASE64_STANDARD.encode(&buffer);
        document["buffers"][0]["uri"] = format!("data:application/octet-stream;base64,{data}").into();
        document.to_string().into_bytes()
    }
}

/// Writes a file.
type Write = fn(&Torus) -> Vec<u8>;

#[test]
fn reading_takes_at_most_six_times_the_file() {
    let _alone = alone();
    let torus = Torus::new();
    let files: [(&str, Write); 8] = [
        ("OBJ of triangles", Torus::obj_of_triangles),
        ("OBJ of both", Torus::obj_of_both),
        ("STL text", Torus::stl_text),
        ("binary STL", Torus::stl_binary),
        ("PLY text", Torus::ply_text),
        ("binary PLY", Torus::ply_binary),
        ("GLB of 16 bits", Torus::glb_of_16_bits),
        ("glTF text", Torus::gltf_text),
    ];
    let mut too_much = Vec::new();
    for (name, write) in files {
        let file = write(&torus);
        let before = ALLOCATOR.current_usage();
        ALLOCATOR.reset_peak_usage();
        let read = read_mesh(&file, Import::METRES, LIMITS).expect("the torus is sound");
        let peak = ALLOCATOR.peak_usage() - before;
        let share = peak as f64 / file.len() as f64;
        println!("{name}: {share:.2} times {} bytes", file.len());
        assert_eq!(read.mesh.triangles().len(), torus.triangles().count(), "{name}");
        assert_eq!(read.warnings, [""; 0], "{name}");
        if peak > BYTES_PER_BYTE * file.len() {
            too_much.push(format!("{name}: {share:.2}"));
        }
    }
    assert_eq!(too_much, [""; 0]);
}
