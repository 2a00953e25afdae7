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

use std::{f64::consts::TAU, fmt::Write as _};

use crate::{Import, ImportError, ImportedMesh, MeshLimits, read_mesh};

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
    let triangles = 0..read.mesh.triangles().len();
    let signed = triangles.map(|triangle| {
        let [a, b, c] = read.mesh.corners(triangle).map(glam::Vec3::as_dvec3);
        a.dot(b.cross(c)) / 6.0
    });
    signed.sum()
}

/// A ring with a round section, whose volume has a closed form.
pub(crate) struct Ring {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Radius of the ring and of its section, in metres, and the number of sides of both.
const RADIUS: f64 = 0.03;
const SECTION: f64 = 0.01;
const SIDES: u32 = 24;

impl Ring {
    /// A ring about +Y, wound outward.
    pub(crate) fn new() -> Self {
        Self::at([0.0; 3])
    }

    /// The same around a place.
    pub(crate) fn at(place: [f64; 3]) -> Self {
        let angle = |side: u32| TAU * f64::from(side) / f64::from(SIDES);
        let position = |around: u32, across: u32| {
            let ((s, c), (v, u)) = (angle(around).sin_cos(), angle(across).sin_cos());
            let out = RADIUS + SECTION * u;
            [place[0] + out * c, place[1] + SECTION * v, place[2] - out * s]
        };
        let places = || (0..SIDES).flat_map(|around| (0..SIDES).map(move |across| (around, across)));
        let index = |around: u32, across: u32| (around % SIDES) * SIDES + across % SIDES;
        Self {
            positions: places()
                .map(|(around, across)| position(around, across))
                .collect(),
            triangles: places()
                .flat_map(|(i, j)| {
                    let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
                    [[a, b, c], [a, c, d]]
                })
                .collect(),
        }
    }

    /// The volume of the faceted ring: a regular polygon's area times the way of its middle along a regular polygon (Pappus).
    pub(crate) fn volume() -> f64 {
        let step = TAU / f64::from(SIDES);
        let area = 0.5 * f64::from(SIDES) * SECTION * SECTION * step.sin();
        // Between two sections, the middle goes along a chord's projection: the sine over the angle.
        area * TAU * RADIUS * step.sin() / step
    }

    pub(crate) fn corners(&self) -> impl Iterator<Item = [[f64; 3]; 3]> {
        let position = |vertex: u32| self.positions[vertex as usize];
        self.triangles.iter().map(move |triangle| triangle.map(position))
    }

    pub(crate) fn obj(&self) -> Vec<u8> {
        let mut text = String::new();
        for [x, y, z] in &self.positions {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        for [a, b, c] in &self.triangles {
            writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
        }
        text.into_bytes()
    }

    pub(crate) fn stl_text(&self) -> Vec<u8> {
        let mut text = "solid ring of a test\n".to_owned();
        for corners in self.corners() {
            text += "  facet normal nan 0 1\n    outer loop\n";
            for [x, y, z] in corners {
                writeln!(text, "      vertex {x:e} {y:e} {z:e}").unwrap();
            }
            text += "    endloop\n  endfacet\n";
        }
        (text + "endsolid ring of a test\n").into_bytes()
    }

    pub(crate) fn stl_binary(&self) -> Vec<u8> {
        let mut bytes = b"solid by a careless exporter".to_vec();
        bytes.resize(80, b' ');
        bytes.extend((self.triangles.len() as u32).to_le_bytes());
        for corners in self.corners() {
            bytes.extend(floats(&[0.0, 0.0, 1.0]));
            bytes.extend(floats(corners.as_flattened()));
            bytes.extend([0, 0]);
        }
        bytes
    }

    pub(crate) fn ply(&self, format: &str) -> Vec<u8> {
        let header = format!(
            "ply\nformat {format} 1.0\ncomment by a test\nelement vertex {}\nproperty float x\nproperty float y\nproperty float \
             z\nproperty uchar red\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangles.len()
        );
        let mut bytes = header.into_bytes();
        if format == "ascii" {
            for [x, y, z] in &self.positions {
                bytes.extend(format!("{x} {y} {z} 255\n").into_bytes());
            }
            for [a, b, c] in &self.triangles {
                bytes.extend(format!("3 {a} {b} {c}\n").into_bytes());
            }
            return bytes;
        }
        let is_big = format == "binary_big_endian";
        let ordered = |numbers: Vec<u8>| {
            let numbers = numbers.as_chunks::<4>().0.iter();
            let ordered = numbers.map(|&[a, b, c, d]| if is_big { [d, c, b, a] } else { [a, b, c, d] });
            ordered.flatten().collect::<Vec<u8>>()
        };
        for position in &self.positions {
            bytes.extend(ordered(floats(position)));
            bytes.push(255);
        }
        for triangle in &self.triangles {
            bytes.push(3);
            bytes.extend(ordered(
                triangle.iter().flat_map(|index| index.to_le_bytes()).collect(),
            ));
        }
        bytes
    }

    /// The binary buffer of a glTF scene: positions, then indices.
    pub(crate) fn buffer(&self) -> Vec<u8> {
        let indices = self.triangles.as_flattened().iter();
        let indices = indices.flat_map(|index| index.to_le_bytes());
        floats(self.positions.as_flattened())
            .into_iter()
            .chain(indices)
            .collect()
    }

    /// The document of a glTF scene with one node, of which `node` are more members, and `buffer` those of its buffer.
    pub(crate) fn gltf_json(&self, node: &str, buffer: &str) -> String {
        let (vertices, indices) = (self.positions.len(), 3 * self.triangles.len());
        let (first, second) = (12 * vertices, 4 * indices);
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
            "nodes":[{{"name":"holder","children":[1]}},{{"name":"ring","mesh":0{node}}}],
            "meshes":[{{"name":"torus","primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}}]}}],
            "materials":[{{"name":"steel","pbrMetallicRoughness":{{"baseColorTexture":{{"index":9}}}}}}],
            "accessors":[
              {{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":[-1,-1,-1],"max":[1,1,1]}},
              {{"bufferView":1,"componentType":5125,"count":{indices},"type":"SCALAR"}}],
            "bufferViews":[
              {{"buffer":0,"byteOffset":0,"byteLength":{first}}},
              {{"buffer":0,"byteOffset":{first},"byteLength":{second}}}],
            "buffers":[{{"byteLength":{}{buffer}}}]}}"#,
            first + second
        )
    }

    pub(crate) fn glb(&self, node: &str) -> Vec<u8> {
        glb(&self.gltf_json(node, ""), &self.buffer())
    }
}

/// Numbers in single precision, as bytes.
pub(crate) fn floats(numbers: &[f64]) -> Vec<u8> {
    let numbers = numbers.iter().map(|&number| number as f32);
    numbers.flat_map(f32::to_le_bytes).collect()
}

/// A GLB container.
pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let document = serde_json::from_str(json).expect("it is JSON");
    grasp_characters::glb(&document, binary.to_vec())
}
