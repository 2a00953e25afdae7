//! Writes a ring in all formats of meshes.

use std::{f64::consts::TAU, fmt::Write as _};

use crate::glb;

/// A ring with a round section, whose volume has a closed form.
pub struct Ring {
    /// Its vertices, in metres.
    pub positions: Vec<[f64; 3]>,
    /// Its triangles: two for each of its quads.
    pub triangles: Vec<[u32; 3]>,
}

/// Radius of the ring and of its section, in metres, and the usual number of sides of both.
const RADIUS: f64 = 0.03;
const SECTION: f64 = 0.01;
const SIDES: u32 = 24;

impl Ring {
    /// A ring about +Y at the origin, wound outward.
    #[expect(clippy::new_without_default, reason = "no ring is the usual one")]
    pub fn new() -> Self {
        Self::at([0.0; 3], SIDES)
    }

    /// The same around a place and with as many sides.
    pub fn at(place: [f64; 3], sides: u32) -> Self {
        let angle = |side: u32| TAU * f64::from(side) / f64::from(sides);
        let position = |around: u32, across: u32| {
            let ((s, c), (v, u)) = (angle(around).sin_cos(), angle(across).sin_cos());
            let out = RADIUS + SECTION * u;
            [place[0] + out * c, place[1] + SECTION * v, place[2] - out * s]
        };
        let places = || (0..sides).flat_map(|around| (0..sides).map(move |across| (around, across)));
        let index = |around: u32, across: u32| (around % sides) * sides + across % sides;
        let triangles = |(i, j): (u32, u32)| {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            [[a, b, c], [a, c, d]]
        };
        Self {
            positions: places()
                .map(|(around, across)| position(around, across))
                .collect(),
            triangles: places().flat_map(triangles).collect(),
        }
    }

    /// The volume of the faceted ring of 24 sides: a regular polygon's area times the way of its middle along a regular polygon (Pappus).
    pub fn volume() -> f64 {
        let step = TAU / f64::from(SIDES);
        let area = 0.5 * f64::from(SIDES) * SECTION * SECTION * step.sin();
        // Between two sections, the middle goes along a chord's projection: the sine over the angle.
        area * TAU * RADIUS * step.sin() / step
    }

    /// The corners of each triangle.
    pub fn corners(&self) -> impl Iterator<Item = [[f64; 3]; 3]> {
        let position = |vertex: u32| self.positions[vertex as usize];
        self.triangles.iter().map(move |triangle| triangle.map(position))
    }

    /// As OBJ, of triangles or of triangles and quads by turns.
    pub fn obj(&self, has_quads: bool) -> Vec<u8> {
        let mut text = String::new();
        for [x, y, z] in &self.positions {
            _ = writeln!(text, "v {x} {y} {z}");
        }
        for (place, [[a, b, c], [.., d]]) in self.triangles.as_chunks::<2>().0.iter().enumerate() {
            let [a, b, c, d] = [a, b, c, d].map(|vertex| vertex + 1);
            _ = if has_quads && place % 2 == 1 {
                writeln!(text, "f {a} {b} {c} {d}")
            } else {
                writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}")
            };
        }
        text.into_bytes()
    }

    /// As STL text.
    pub fn stl_text(&self) -> Vec<u8> {
        let mut text = "solid ring of a test\n".to_owned();
        for corners in self.corners() {
            text += "  facet normal nan 0 1\n    outer loop\n";
            for [x, y, z] in corners {
                _ = writeln!(text, "      vertex {x:e} {y:e} {z:e}");
            }
            text += "    endloop\n  endfacet\n";
        }
        (text + "endsolid ring of a test\n").into_bytes()
    }

    /// As binary STL, whose header starts as text does.
    pub fn stl_binary(&self) -> Vec<u8> {
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

    /// As PLY with the name of its format.
    pub fn ply(&self, format: &str) -> Vec<u8> {
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
    pub fn buffer(&self) -> Vec<u8> {
        let indices = self.triangles.as_flattened().iter();
        let indices = indices.flat_map(|index| index.to_le_bytes());
        floats(self.positions.as_flattened())
            .into_iter()
            .chain(indices)
            .collect()
    }

    /// The document of a glTF scene with one node, of which `node` are more members, and `buffer` those of its buffer.
    pub fn gltf_json(&self, node: &str, buffer: &str) -> String {
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

    /// As GLB.
    pub fn glb(&self, node: &str) -> Vec<u8> {
        let document = serde_json::from_str(&self.gltf_json(node, "")).expect("it is JSON");
        glb(&document, self.buffer())
    }
}

/// Numbers in single precision, as bytes.
pub fn floats(numbers: &[f64]) -> Vec<u8> {
    let numbers = numbers.iter().map(|&number| number as f32);
    numbers.flat_map(f32::to_le_bytes).collect()
}
