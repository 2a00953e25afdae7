//! A solid, and how each format writes it.

use std::{f64::consts::TAU, fmt::Write as _};

/// A ring with a round section, whose volume has a closed form.
pub(crate) struct Ring {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Radius of the ring and of its section, in metres, and the number of sides of both.
const RADIUS: f64 = 0.03;
const SECTION: f64 = 0.01;
const SIDES: u32 = 24;

impl Ring {
    /// A ring about +Y, wound outward.
    pub(crate) fn new() -> Self {
        let angle = |side: u32| TAU * f64::from(side) / f64::from(SIDES);
        let position = |around: u32, across: u32| {
            let ((s, c), (v, u)) = (angle(around).sin_cos(), angle(across).sin_cos());
            let out = RADIUS + SECTION * u;
            [out * c, SECTION * v, -out * s].map(|coordinate| coordinate as f32)
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

    fn corners(&self, triangle: [u32; 3]) -> [[f32; 3]; 3] {
        triangle.map(|vertex| self.positions[vertex as usize])
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
        for &triangle in &self.triangles {
            text += "  facet normal nan 0 1\n    outer loop\n";
            for [x, y, z] in self.corners(triangle) {
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
        for &triangle in &self.triangles {
            for number in [[0.0, 0.0, 1.0]].iter().chain(&self.corners(triangle)).flatten() {
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend([0, 0]);
        }
        bytes
    }

    pub(crate) fn ply(&self, format: &str) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\ncomment by a test\nelement vertex {}\nproperty float x\nproperty float y\nproperty float \
             z\nproperty uchar red\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            self.positions.len(),
            self.triangles.len()
        )
        .into_bytes();
        let little = |number: [u8; 4]| number;
        let big = |mut number: [u8; 4]| {
            number.reverse();
            number
        };
        let order: fn([u8; 4]) -> [u8; 4] = if format == "binary_big_endian" {
            big
        } else {
            little
        };
        for [x, y, z] in &self.positions {
            if format == "ascii" {
                bytes.extend(format!("{x} {y} {z} 255\n").into_bytes());
            } else {
                bytes.extend(
                    [x, y, z]
                        .into_iter()
                        .flat_map(|number| order(number.to_le_bytes())),
                );
                bytes.push(255);
            }
        }
        for [a, b, c] in &self.triangles {
            if format == "ascii" {
                bytes.extend(format!("3 {a} {b} {c}\n").into_bytes());
            } else {
                bytes.push(3);
                bytes.extend(
                    [a, b, c]
                        .into_iter()
                        .flat_map(|number| order(number.to_le_bytes())),
                );
            }
        }
        bytes
    }

    /// The binary buffer of a glTF scene: positions, then indices.
    pub(crate) fn buffer(&self) -> Vec<u8> {
        let positions = self
            .positions
            .iter()
            .flatten()
            .flat_map(|number| number.to_le_bytes());
        let indices = self
            .triangles
            .iter()
            .flatten()
            .flat_map(|index| index.to_le_bytes());
        positions.chain(indices).collect()
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

/// A GLB container.
pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = binary.to_vec();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(&json);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(&binary);
    bytes
}
