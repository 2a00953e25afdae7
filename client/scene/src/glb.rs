//! Scenes, and moving handovers with an animation, as binary glTF 2.0 files (GLB).

use std::collections::HashMap;

use glam::{Mat4, Quat, Vec3};
use gltf::binary::{Glb, Header};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, Skin, SkinJoint, index},
};
use serde_json::{Map, Value, json};

use crate::{
    parts::{Finish, Part},
    people::Person,
};

/// Emission of a marker as a share of its colour: keeps it visible in a viewer's shadows.
const MARKER_EMISSION: f32 = 0.45;

/// Component types (3.6.2 of the Khronos glTF 2.0 specification).
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// Scales that differ by less count as equal.
const SAME_SCALE: f32 = 1e-5;

/// Parts as a GLB file: each part with triangles becomes a named node with its own mesh and material, in metres and
/// +Y up. Vertices have the same smooth normals as in pictures.
pub(crate) fn to_glb(parts: &[Part]) -> Vec<u8> {
    let mut writer = Writer::default();
    for part in parts.iter().filter(|part| !part.triangles.is_empty()) {
        writer.add_part(part);
    }
    writer.finish()
}

/// A hand at every moment of a moving handover.
#[derive(Clone, Debug)]
pub(crate) struct MovingHand {
    /// Start of the names of its parts, such as `giver`; each hand has its own.
    pub(crate) name: String,
    pub(crate) person: Person,
    pub(crate) skin: &'static Skin,
    /// The joints at each moment, in the client's frame; `None` while the hand is absent.
    pub(crate) joints: Vec<Option<HandJoints>>,
}

/// A moving handover, in the client's frame: metres, right-handed.
#[derive(Clone, Debug)]
pub(crate) struct MovingHandover {
    /// The object, in its own frame.
    pub(crate) object: Part,
    /// The times of the moments, in seconds, rising.
    pub(crate) times: Vec<f32>,
    /// Pose of the object at each moment.
    pub(crate) client_from_object: Vec<Pose>,
    pub(crate) hands: Vec<MovingHand>,
}

/// A moving handover as a GLB file with an animation `handover`: a key frame per moment.
///
/// The object is a node that moves. Each hand is a node of its name with 26 joints below it, named after the hand and the
/// joint in `WebXR` (`giver_wrist`), which move its skinned mesh, such as `giver_hand`; the sleeve is below the wrist. An
/// absent hand has scale 0.
///
/// # Panics
/// There is not one pose of the object and of each hand per moment.
pub(crate) fn to_moving_glb(handover: &MovingHandover) -> Vec<u8> {
    assert_eq!(handover.client_from_object.len(), handover.times.len());
    let mut writer = Writer::default();
    if handover.times.is_empty() {
        return writer.finish();
    }
    let object = writer.add_part(&handover.object);
    let times: Vec<[f32; 1]> = handover.times.iter().map(|&time| [time]).collect();
    writer.times = writer.floats(&times, "SCALAR");
    writer.add_bounds(writer.times, &times);
    writer.add_poses(object, &handover.client_from_object);
    for hand in &handover.hands {
        assert_eq!(hand.joints.len(), handover.times.len());
        writer.add_moving_hand(hand);
    }
    writer.finish()
}

#[derive(Default)]
struct Writer {
    nodes: Vec<Value>,
    /// The nodes without parents.
    roots: Vec<usize>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    skins: Vec<Value>,
    /// The accessor of an animation's times, and how nodes move.
    times: usize,
    samplers: Vec<Value>,
    channels: Vec<Value>,
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

    /// A part's mesh, which the joints of a skin move.
    fn add_mesh(&mut self, part: &Part, skin: Option<&Skin>) -> usize {
        let vertices = Vertices::of(part);
        let of_sources = |value: &dyn Fn(usize) -> Vec3| -> Vec<[f32; 3]> {
            let sources = vertices.sources.iter();
            sources.map(|&vertex| value(vertex as usize).to_array()).collect()
        };
        let positions = of_sources(&|vertex| part.positions[vertex]);
        let mut attributes = Map::new();
        let position = self.floats(&positions, "VEC3");
        self.add_bounds(position, &positions);
        attributes.insert("POSITION".into(), position.into());
        let normals: Vec<[f32; 3]> = vertices.normals.iter().map(Vec3::to_array).collect();
        attributes.insert("NORMAL".into(), self.floats(&normals, "VEC3").into());
        if !part.vertex_colours.is_empty() {
            let colours = of_sources(&|vertex| part.vertex_colours[vertex]);
            attributes.insert("COLOR_0".into(), self.floats(&colours, "VEC3").into());
        }
        if let Some(skin) = skin {
            let sources = vertices.sources.iter().map(|&vertex| vertex as usize);
            let weights: Vec<[f32; 4]> = sources.clone().map(|vertex| skin.weights[vertex]).collect();
            let joints = sources.zip(&weights);
            let joints: Vec<[u8; 4]> = joints
                .map(|(vertex, weights)| without_idle_joints(skin.joint_indices[vertex], weights))
                .collect();
            let (count, bytes) = (joints.len(), joints.into_flattened());
            let joints = self.add(bytes, count, UNSIGNED_BYTE, "VEC4");
            attributes.insert("JOINTS_0".into(), joints.into());
            attributes.insert("WEIGHTS_0".into(), self.floats(&weights, "VEC4").into());
        }
        let indices = vertices.indices.iter().flat_map(|index| index.to_le_bytes());
        let indices = self.add(indices, vertices.indices.len(), UNSIGNED_INT, "SCALAR");
        self.meshes.push(json!({
            "name": part.name,
            "primitives": [{"attributes": attributes, "indices": indices, "material": self.materials.len()}],
        }));
        self.materials.push(material(part));
        self.meshes.len() - 1
    }

    fn floats<const N: usize>(&mut self, rows: &[[f32; N]], kind: &str) -> usize {
        let bytes = rows.as_flattened().iter().flat_map(|value| value.to_le_bytes());
        self.add(bytes, rows.len(), FLOAT, kind)
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

    /// An accessor of values, and its view.
    fn add(
        &mut self,
        bytes: impl IntoIterator<Item = u8>,
        count: usize,
        component_type: u32,
        kind: &str,
    ) -> usize {
        let start = self.buffer.len();
        self.buffer.extend(bytes);
        let length = self.buffer.len() - start;
        // The next view must be aligned to the size of its components, 4 bytes at most.
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        self.accessors.push(json!({
            "bufferView": self.views.len(), "componentType": component_type, "count": count, "type": kind,
        }));
        self.views
            .push(json!({"buffer": 0, "byteOffset": start, "byteLength": length}));
        self.accessors.len() - 1
    }

    fn add_moving_hand(&mut self, hand: &MovingHand) {
        let Some(postures) = filled(&hand.joints) else {
            return;
        };
        let moved = postures.iter().map(|joints| hand.skin.joints_at(joints));
        let moved: Vec<[SkinJoint; JOINT_COUNT]> = moved.collect();
        let joints: Vec<usize> = (0..JOINT_COUNT)
            .map(|joint| {
                let node = self.add_node(json!({"name": format!("{}_{}", hand.name, JOINT_NAMES[joint])}));
                let poses: Vec<Pose> = moved.iter().map(|joints| joints[joint].pose).collect();
                self.add_poses(node, &poses);
                let scales: Vec<Vec3> = moved.iter().map(|joints| joints[joint].scale).collect();
                self.nodes[node]["scale"] = json!(scales[0].to_array());
                let is_same = |scale: &Vec3| scale.abs_diff_eq(scales[0], SAME_SCALE);
                if !scales.iter().all(is_same) {
                    self.add_scales(node, "LINEAR", scales.iter());
                }
                node
            })
            .collect();
        let sleeve = self.add_sleeve(hand);
        self.nodes[joints[index::WRIST]]["children"] = json!([sleeve]);
        let root = self.add_root(json!({"name": hand.name, "children": joints}));
        if hand.joints.iter().any(Option::is_none) {
            let size = |joints: &Option<HandJoints>| if joints.is_some() { &Vec3::ONE } else { &Vec3::ZERO };
            self.add_scales(root, "STEP", hand.joints.iter().map(size));
        }
        self.add_skin(hand, root, &joints);
    }

    fn add_scales<'a>(&mut self, node: usize, interpolation: &str, scales: impl Iterator<Item = &'a Vec3>) {
        let scales: Vec<[f32; 3]> = scales.map(Vec3::to_array).collect();
        let output = self.floats(&scales, "VEC3");
        self.add_channel(node, "scale", interpolation, output);
    }

    fn add_channel(&mut self, node: usize, path: &str, interpolation: &str, output: usize) {
        self.channels
            .push(json!({"sampler": self.samplers.len(), "target": {"node": node, "path": path}}));
        self.samplers
            .push(json!({"input": self.times, "output": output, "interpolation": interpolation}));
    }

    /// Poses of a node at all times. Viewers that do not play animations show the first one.
    fn add_poses(&mut self, node: usize, poses: &[Pose]) {
        let positions: Vec<[f32; 3]> = poses.iter().map(|pose| pose.position.to_array()).collect();
        let mut orientations: Vec<Quat> = poses.iter().map(|pose| pose.orientation.normalize()).collect();
        // Of a quaternion and its opposite, takes the one nearer to the previous: some viewers do not take the short way.
        for i in 1..orientations.len() {
            if orientations[i].dot(orientations[i - 1]) < 0.0 {
                orientations[i] = -orientations[i];
            }
        }
        let orientations: Vec<[f32; 4]> = orientations.iter().map(Quat::to_array).collect();
        self.nodes[node]["translation"] = json!(positions.first());
        self.nodes[node]["rotation"] = json!(orientations.first());
        let translations = self.floats(&positions, "VEC3");
        self.add_channel(node, "translation", "LINEAR", translations);
        let rotations = self.floats(&orientations, "VEC4");
        self.add_channel(node, "rotation", "LINEAR", rotations);
    }

    fn add_skin(&mut self, hand: &MovingHand, root: usize, joints: &[usize]) {
        // The inverse as a pose: that of a matrix is inexact in its last row.
        let inverse_bind = hand.skin.bind_frames().map(|frame| {
            let inverse = frame.inverse();
            Mat4::from_rotation_translation(inverse.orientation, inverse.position).to_cols_array()
        });
        let matrices = self.floats(&inverse_bind, "MAT4");
        let skin = self.skins.len();
        self.skins.push(json!({
            "name": hand.name, "joints": joints, "skeleton": root, "inverseBindMatrices": matrices,
        }));
        let name = format!("{}_hand", hand.name);
        let part = hand.person.hand(&name, hand.skin, hand.skin.positions.clone());
        let mesh = self.add_mesh(&part, Some(hand.skin));
        // At the root: its node's own transform does not move a skinned mesh.
        self.add_root(json!({"name": name, "mesh": mesh, "skin": skin}));
    }

    fn add_sleeve(&mut self, hand: &MovingHand) -> usize {
        let name = format!("{}_sleeve", hand.name);
        let mut part = hand.person.sleeve(&name, &hand.skin.bind, &hand.skin.positions);
        let wrist_from_bind = hand.skin.bind_frames()[index::WRIST].inverse();
        for position in &mut part.positions {
            *position = wrist_from_bind.transform_point(*position);
        }
        let mesh = self.add_mesh(&part, None);
        self.add_node(json!({"name": name, "mesh": mesh}))
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
            ("accessors", self.accessors),
            ("bufferViews", self.views),
        ] {
            if !values.is_empty() {
                document[name] = values.into();
            }
        }
        if !self.channels.is_empty() {
            document["animations"] =
                json!([{"name": "handover", "samplers": self.samplers, "channels": self.channels}]);
        }
        let header = Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        };
        let file = Glb {
            // The writer computes its length.
            header,
            json: document.to_string().into_bytes().into(),
            bin: (!self.buffer.is_empty()).then(|| self.buffer.into()),
        };
        file.to_vec().expect("writing to memory cannot fail")
    }
}

/// The joints at every moment: the preceding or else the next ones while the hand is absent. `None` if it is always absent.
fn filled(joints: &[Option<HandJoints>]) -> Option<Vec<&HandJoints>> {
    let mut last = joints.iter().flatten().next()?;
    let at_every_moment = joints.iter().map(|joints| {
        last = joints.as_ref().unwrap_or(last);
        last
    });
    Some(at_every_moment.collect())
}

/// Sets joints without weight to 0 (3.7.3.3 of the specification).
fn without_idle_joints(joints: [u8; 4], weights: &[f32; 4]) -> [u8; 4] {
    std::array::from_fn(|i| if weights[i] == 0.0 { 0 } else { joints[i] })
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

/// A part's vertices, split where adjacent triangles have different normals.
struct Vertices {
    /// The part's vertex behind each one.
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
