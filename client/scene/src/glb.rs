//! Scenes as binary glTF 2.0 files (Khronos glTF 2.0 specification, 3.6 and 4.4).

use std::collections::HashMap;

use glam::Vec3;
use serde_json::{Map, Value, json};

use crate::{
    normals::corner_normals,
    scene::{Finish, Part, Scene},
};

/// `glTF` in little-endian.
const MAGIC: u32 = 0x4654_6C67;
const VERSION: u32 = 2;
/// Chunk types, 4.4.3.2 and 4.4.3.3 of the specification.
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;

/// Component types and buffer targets of the specification.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Strength of a marker's own light beside its colour: it stays readable in a viewer's shadows.
const MARKER_EMISSION: f32 = 0.45;

/// A scene as a GLB file: every part with triangles becomes a named node with a mesh and a material of its own, in
/// metres and +Y up. Vertices carry the same smooth normals as in pictures.
///
/// # Panics
/// The scene does not fit into a file of 4 GiB.
pub fn to_glb(scene: &Scene) -> Vec<u8> {
    let mut writer = Writer::default();
    for part in scene.parts.iter().filter(|part| !part.triangles.is_empty()) {
        writer.add_part(part);
    }
    writer.finish()
}

/// The growing file: arrays of the JSON and the binary buffer.
#[derive(Default)]
struct Writer {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    buffer: Vec<u8>,
}

impl Writer {
    fn add_part(&mut self, part: &Part) {
        let vertices = Vertices::of(part);
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), self.vectors(&vertices.positions, true).into());
        attributes.insert("NORMAL".into(), self.vectors(&vertices.normals, false).into());
        if !part.vertex_colours.is_empty() {
            attributes.insert("COLOR_0".into(), self.vectors(&vertices.colours, false).into());
        }
        let indices = self.accessor(
            vertices.indices.iter().flat_map(|i| i.to_le_bytes()),
            json!({"componentType": UNSIGNED_INT, "count": vertices.indices.len(), "type": "SCALAR"}),
            ELEMENT_ARRAY_BUFFER,
        );
        self.meshes.push(json!({
            "name": part.name,
            "primitives": [{"attributes": attributes, "indices": indices, "material": self.materials.len()}],
        }));
        self.materials.push(material(part));
        let mut node = json!({"name": part.name, "mesh": self.meshes.len() - 1});
        if let Some(extras) = &part.extras {
            node["extras"] = extras.clone();
        }
        self.nodes.push(node);
    }

    /// Adds an accessor of three floats an element; its index.
    fn vectors(&mut self, values: &[Vec3], with_bounds: bool) -> usize {
        let mut description = json!({"componentType": FLOAT, "count": values.len(), "type": "VEC3"});
        if with_bounds {
            let low = values.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let high = values.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
            description["min"] = json!(low.to_array());
            description["max"] = json!(high.to_array());
        }
        let bytes = values
            .iter()
            .flat_map(|v| v.to_array())
            .flat_map(f32::to_le_bytes);
        self.accessor(bytes, description, ARRAY_BUFFER)
    }

    fn accessor(&mut self, bytes: impl Iterator<Item = u8>, mut description: Value, target: u32) -> usize {
        // Every element is a multiple of four bytes, so the next view is aligned too.
        let start = self.buffer.len();
        self.buffer.extend(bytes);
        self.views.push(json!({
            "buffer": 0,
            "byteOffset": start,
            "byteLength": self.buffer.len() - start,
            "target": target,
        }));
        description["bufferView"] = (self.views.len() - 1).into();
        self.accessors.push(description);
        self.accessors.len() - 1
    }

    fn finish(self) -> Vec<u8> {
        let mut root = json!({"asset": {"version": "2.0", "generator": "grasp"}, "scene": 0, "scenes": [{}]});
        // The specification forbids empty arrays.
        if !self.nodes.is_empty() {
            root["scenes"] = json!([{"nodes": (0..self.nodes.len()).collect::<Vec<_>>()}]);
            root["nodes"] = self.nodes.into();
            root["meshes"] = self.meshes.into();
            root["materials"] = self.materials.into();
            root["accessors"] = self.accessors.into();
            root["bufferViews"] = self.views.into();
            root["buffers"] = json!([{"byteLength": self.buffer.len()}]);
        }
        let mut text = root.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut chunks = vec![(JSON_CHUNK, text)];
        if !self.buffer.is_empty() {
            chunks.push((BIN_CHUNK, self.buffer));
        }

        let total = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
        let length = |bytes: usize| u32::try_from(bytes).expect("a scene is smaller than 4 GiB");
        let mut file = Vec::with_capacity(total);
        for word in [MAGIC, VERSION, length(total)] {
            file.extend(word.to_le_bytes());
        }
        for (kind, data) in chunks {
            file.extend(length(data.len()).to_le_bytes());
            file.extend(kind.to_le_bytes());
            file.extend(data);
        }
        file
    }
}

fn material(part: &Part) -> Value {
    let (metallic, roughness) = match part.finish {
        Finish::Satin => (0.0, 0.45),
        Finish::Metal => (1.0, 0.35),
        Finish::Skin => (0.0, 0.6),
        Finish::Cloth => (0.0, 0.95),
        Finish::Marker => (0.0, 1.0),
    };
    let [r, g, b, alpha] = part.colour;
    // A vertex' colour is multiplied by the base colour.
    let base = if part.vertex_colours.is_empty() {
        [r, g, b, alpha]
    } else {
        [1.0, 1.0, 1.0, alpha]
    };
    let mut material = json!({
        "name": part.name,
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": base,
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        },
    });
    if alpha < 1.0 {
        material["alphaMode"] = "BLEND".into();
    }
    if part.finish == Finish::Marker {
        material["emissiveFactor"] = json!([r, g, b].map(|c| c * MARKER_EMISSION));
    }
    material
}

/// A part's vertices, split wherever the triangles around one disagree about its normal.
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    colours: Vec<Vec3>,
    indices: Vec<u32>,
}

impl Vertices {
    fn of(part: &Part) -> Self {
        let mut known = HashMap::new();
        let mut vertices = Self {
            positions: Vec::new(),
            normals: Vec::new(),
            colours: Vec::new(),
            indices: Vec::with_capacity(part.triangles.len() * 3),
        };
        for (triangle, normals) in part.triangles.iter().zip(corner_normals(part)) {
            for (&vertex, normal) in triangle.iter().zip(normals) {
                let next = vertices.positions.len() as u32;
                let index = *known
                    .entry((vertex, normal.to_array().map(f32::to_bits)))
                    .or_insert(next);
                if index == next {
                    vertices.positions.push(part.positions[vertex as usize]);
                    vertices.normals.push(normal);
                    vertices.colours.push(part.vertex_colour(vertex));
                }
                vertices.indices.push(index);
            }
        }
        vertices
    }
}
