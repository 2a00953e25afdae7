//! Scenes as binary glTF 2.0 files (GLB).

mod moving;

use std::collections::HashMap;

use glam::Vec3;
use serde_json::{Map, Value, json};

use crate::scene::{Finish, Part, Scene};
pub use moving::{MovingHand, MovingHandover, to_moving_glb};

/// Emission of a marker as a share of its colour: keeps it visible in a viewer's shadows.
const MARKER_EMISSION: f32 = 0.45;

/// `glTF` in little-endian, and the types of chunks (4.4 of the Khronos glTF 2.0 specification).
const MAGIC: u32 = 0x4654_6C67;
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;

/// Component types (3.6.2 of the specification).
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// What the values of a buffer view are for: its target in the specification, or nothing.
const VERTICES: Option<u32> = Some(34962);
const INDICES: Option<u32> = Some(34963);
const NO_TARGET: Option<u32> = None;

/// A scene as a GLB file: each part with triangles becomes a named node with its own mesh and material, in metres and
/// +Y up. Vertices have the same smooth normals as in pictures.
///
/// # Panics
/// The file exceeds 4 GiB.
pub fn to_glb(scene: &Scene) -> Vec<u8> {
    let mut writer = Writer::default();
    for part in scene.parts.iter().filter(|part| !part.triangles.is_empty()) {
        writer.add_part(part);
    }
    writer.finish()
}

/// The joints that move each vertex of a part, and their weights.
#[derive(Clone, Copy)]
struct Binding<'a> {
    joints: &'a [[u8; 4]],
    weights: &'a [[f32; 4]],
}

/// The nodes added so far, and what they need.
#[derive(Default)]
struct Writer {
    nodes: Vec<Value>,
    /// The nodes that have no parent.
    roots: Vec<usize>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    skins: Vec<Value>,
    animations: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    buffer: Vec<u8>,
}

impl Writer {
    fn add_part(&mut self, part: &Part) -> usize {
        let mut node = json!({"name": part.name, "mesh": self.add_mesh(part, None)});
        if let Some(extras) = &part.extras {
            node["extras"] = extras.clone();
        }
        self.add_root(node)
    }

    fn add_root(&mut self, node: Value) -> usize {
        let index = self.add_node(node);
        self.roots.push(index);
        index
    }

    fn add_node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// A part's mesh, moved by joints if there is a binding.
    fn add_mesh(&mut self, part: &Part, binding: Option<Binding<'_>>) -> usize {
        let vertices = Vertices::of(part);
        let of_sources = |value: &dyn Fn(usize) -> Vec3| -> Vec<[f32; 3]> {
            let sources = vertices.sources.iter();
            sources.map(|&vertex| value(vertex as usize).to_array()).collect()
        };
        let positions = of_sources(&|vertex| part.positions[vertex]);
        let mut attributes = Map::new();
        let position = self.floats(&positions, "VEC3", VERTICES);
        self.add_bounds(position, &positions);
        attributes.insert("POSITION".into(), position.into());
        let normals: Vec<[f32; 3]> = vertices.normals.iter().map(Vec3::to_array).collect();
        attributes.insert("NORMAL".into(), self.floats(&normals, "VEC3", VERTICES).into());
        if !part.vertex_colours.is_empty() {
            let colours = of_sources(&|vertex| part.vertex_colours[vertex]);
            attributes.insert("COLOR_0".into(), self.floats(&colours, "VEC3", VERTICES).into());
        }
        if let Some(binding) = binding {
            let sources = vertices.sources.iter().map(|&vertex| vertex as usize);
            let (joints, weights): (Vec<_>, Vec<_>) = sources
                .map(|vertex| without_idle_joints(binding.joints[vertex], binding.weights[vertex]))
                .unzip();
            let (count, bytes) = (joints.len(), joints.into_flattened());
            let joints = self.add(bytes, count, UNSIGNED_BYTE, "VEC4", VERTICES);
            attributes.insert("JOINTS_0".into(), joints.into());
            attributes.insert("WEIGHTS_0".into(), self.floats(&weights, "VEC4", VERTICES).into());
        }
        let indices = vertices.indices.iter().flat_map(|index| index.to_le_bytes());
        let indices = self.add(indices, vertices.indices.len(), UNSIGNED_INT, "SCALAR", INDICES);
        self.meshes.push(json!({
            "name": part.name,
            "primitives": [{"attributes": attributes, "indices": indices, "material": self.materials.len()}],
        }));
        self.materials.push(material(part));
        self.meshes.len() - 1
    }

    /// An accessor of rows of numbers.
    fn floats<const N: usize>(&mut self, rows: &[[f32; N]], kind: &str, target: Option<u32>) -> usize {
        let bytes = rows.as_flattened().iter().flat_map(|value| value.to_le_bytes());
        self.add(bytes, rows.len(), FLOAT, kind, target)
    }

    /// The bounds that the specification requires of positions and of times.
    fn add_bounds<const N: usize>(&mut self, accessor: usize, rows: &[[f32; N]]) {
        let bound = |first: f32, choose: fn(f32, f32) -> f32| {
            let along = |axis: usize| rows.iter().map(|row| row[axis]).fold(first, choose);
            (0..N).map(along).collect::<Vec<_>>()
        };
        self.accessors[accessor]["min"] = bound(f32::INFINITY, f32::min).into();
        self.accessors[accessor]["max"] = bound(f32::NEG_INFINITY, f32::max).into();
    }

    fn add(
        &mut self,
        bytes: impl IntoIterator<Item = u8>,
        count: usize,
        component_type: u32,
        kind: &str,
        target: Option<u32>,
    ) -> usize {
        let start = self.buffer.len();
        self.buffer.extend(bytes);
        let mut view = json!({"buffer": 0, "byteOffset": start, "byteLength": self.buffer.len() - start});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        // The next view must be aligned to the size of its components, 4 bytes at most.
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        self.accessors.push(json!({
            "bufferView": self.views.len(), "componentType": component_type, "count": count, "type": kind,
        }));
        self.views.push(view);
        self.accessors.len() - 1
    }

    fn finish(self) -> Vec<u8> {
        let mut document = json!({"asset": {"version": "2.0", "generator": "grasp"}});
        // The specification forbids empty arrays.
        if !self.roots.is_empty() {
            document["scene"] = 0.into();
            document["scenes"] = json!([{"nodes": self.roots}]);
            document["buffers"] = json!([{"byteLength": self.buffer.len()}]);
        }
        for (name, values) in [
            ("nodes", self.nodes),
            ("meshes", self.meshes),
            ("materials", self.materials),
            ("skins", self.skins),
            ("animations", self.animations),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
        ] {
            if !values.is_empty() {
                document[name] = values.into();
            }
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut chunks = vec![(JSON_CHUNK, text)];
        if !self.buffer.is_empty() {
            chunks.push((BIN_CHUNK, self.buffer));
        }
        let total = 12 + chunks.iter().map(|(_, data)| 8 + data.len()).sum::<usize>();
        let length = |bytes: usize| u32::try_from(bytes).expect("a GLB file is smaller than 4 GiB");
        let mut file = [MAGIC, 2, length(total)].map(u32::to_le_bytes).concat();
        for (kind, data) in chunks {
            file.extend(length(data.len()).to_le_bytes());
            file.extend(kind.to_le_bytes());
            file.extend(data);
        }
        file
    }
}

/// Joints without weight are to be 0 (3.7.3.3 of the specification).
fn without_idle_joints(mut joints: [u8; 4], weights: [f32; 4]) -> ([u8; 4], [f32; 4]) {
    for (joint, weight) in joints.iter_mut().zip(weights) {
        if weight == 0.0 {
            *joint = 0;
        }
    }
    (joints, weights)
}

fn material(part: &Part) -> Value {
    let (metallic, roughness) = match part.finish {
        Finish::Satin => (0.0, 0.45),
        Finish::Metal => (1.0, 0.35),
        Finish::Skin => (0.0, 0.6),
        Finish::Cloth => (0.0, 0.95),
        Finish::Marker => (0.0, 1.0),
    };
    // Viewers multiply vertex colours by the base colour.
    let base = if part.vertex_colours.is_empty() {
        part.colour
    } else {
        Vec3::ONE
    };
    let mut material = json!({
        "name": part.name,
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": base.extend(1.0).to_array(),
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        },
    });
    if part.finish == Finish::Marker {
        material["emissiveFactor"] = json!((part.colour * MARKER_EMISSION).to_array());
    }
    material
}

/// A part's vertices, split where the triangles around one have different normals.
struct Vertices {
    /// The part's vertex that each one is.
    sources: Vec<u32>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
}

impl Vertices {
    fn of(part: &Part) -> Self {
        let mut known = HashMap::new();
        let mut vertices = Self {
            sources: Vec::new(),
            normals: Vec::new(),
            indices: Vec::with_capacity(part.triangles.len() * 3),
        };
        for (triangle, normals) in part.triangles.iter().zip(part.corner_normals()) {
            for (&vertex, normal) in triangle.iter().zip(normals) {
                let next = vertices.sources.len() as u32;
                let key = (vertex, normal.to_array().map(f32::to_bits));
                let index = *known.entry(key).or_insert(next);
                if index == next {
                    vertices.sources.push(vertex);
                    vertices.normals.push(normal);
                }
                vertices.indices.push(index);
            }
        }
        vertices
    }
}

#[cfg(test)]
mod tests;
