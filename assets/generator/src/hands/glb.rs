//! Writes a skinned hand as binary glTF 2.0: 25 joints with `WebXR` names, -Z along the bones, in the wrist's frame.

use glam::{Mat4, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        joints::{JOINT_COUNT, JOINT_NAMES, index},
        skin::Skin,
    },
};
use serde_json::{Value, json};

/// glTF's numbers for component types and buffer targets.
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The buffer of a GLB file with its views and accessors.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Appends a block and returns the index of its accessor.
    fn add(
        &mut self,
        bytes: &[u8],
        count: usize,
        component: u32,
        kind: &str,
        target: Option<u32>,
        bounds: Option<(Vec3, Vec3)>,
    ) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        // Every block starts at a multiple of four.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut accessor = json!({
            "bufferView": self.views.len(), "componentType": component, "count": count, "type": kind,
        });
        if let Some((min, max)) = bounds {
            accessor["min"] = json!(min.to_array());
            accessor["max"] = json!(max.to_array());
        }
        self.views.push(view);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

/// Little-endian bytes of floats.
fn float_bytes(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

/// The joint that carries a joint, by `OpenXR` index; the wrist is the root.
fn parent(joint: usize) -> usize {
    if index::FIRST_OF_DIGIT.contains(&joint) {
        index::WRIST
    } else {
        joint - 1
    }
}

/// The GLB file of a hand. The palm joint is left out: `WebXR` has none, and no vertex may depend on it.
pub(super) fn hand_glb(name: &str, skin: &Skin) -> Vec<u8> {
    let wrist_from_bind = skin.bind.joints[index::WRIST].pose.inverse();
    let wrist_from_joint: [Pose; JOINT_COUNT] =
        std::array::from_fn(|joint| wrist_from_bind * skin.bind.joints[joint].pose);
    let positions: Vec<Vec3> = skin
        .positions
        .iter()
        .map(|&p| wrist_from_bind.transform_point(p))
        .collect();
    let mut buffer = Buffer::default();
    let bounds = positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| {
            (low.min(p), high.max(p))
        });
    let count = positions.len();
    let vec3_bytes = |vectors: &[Vec3]| float_bytes(vectors.iter().flat_map(Vec3::to_array));
    let mut vertex = |bytes: &[u8], component, kind, bounds| {
        buffer.add(bytes, count, component, kind, Some(ARRAY_BUFFER), bounds)
    };
    let position = vertex(&vec3_bytes(&positions), FLOAT, "VEC3", Some(bounds));
    let normal = vertex(
        &vec3_bytes(&vertex_normals(&positions, &skin.triangles)),
        FLOAT,
        "VEC3",
        None,
    );
    // glTF counts the joints of the skin, which start with the wrist.
    let joint_bytes: Vec<u8> = skin
        .joint_indices
        .iter()
        .flatten()
        .map(|&joint| joint.saturating_sub(1))
        .collect();
    let joints = vertex(&joint_bytes, UNSIGNED_BYTE, "VEC4", None);
    let weights = vertex(
        &float_bytes(skin.weights.iter().flatten().copied()),
        FLOAT,
        "VEC4",
        None,
    );
    let corners: Vec<u8> = skin
        .triangles
        .iter()
        .flatten()
        .flat_map(|&v| (v as u16).to_le_bytes())
        .collect();
    let indices = buffer.add(
        &corners,
        3 * skin.triangles.len(),
        UNSIGNED_SHORT,
        "SCALAR",
        Some(ELEMENT_ARRAY_BUFFER),
        None,
    );
    let inverse_binds = buffer.add(
        &float_bytes(
            (1..JOINT_COUNT).flat_map(|joint| inverse_bind(wrist_from_joint[joint]).to_cols_array()),
        ),
        JOINT_COUNT - 1,
        FLOAT,
        "MAT4",
        None,
        None,
    );
    let nodes = nodes(name, &wrist_from_joint);
    let document = json!({
        "asset": { "version": "2.0", "generator": "grasp-assets-generator" },
        "scene": 0,
        "scenes": [{ "name": name, "nodes": [0, nodes.len() - 1] }],
        "nodes": nodes,
        "skins": [{
            "name": name,
            "inverseBindMatrices": inverse_binds,
            "skeleton": 0,
            "joints": (0..JOINT_COUNT - 1).collect::<Vec<_>>(),
        }],
        "meshes": [{
            "name": name,
            "primitives": [{
                "attributes": {
                    "POSITION": position, "NORMAL": normal, "JOINTS_0": joints, "WEIGHTS_0": weights,
                },
                "indices": indices,
                "material": 0,
            }],
        }],
        "materials": [{
            "name": "skin",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.72, 0.47, 0.36, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.65,
            },
        }],
        "buffers": [{ "byteLength": buffer.bytes.len() }],
        "bufferViews": buffer.views,
        "accessors": buffer.accessors,
    });
    container(document.to_string().into_bytes(), buffer.bytes)
}

/// The nodes: joint n is node n - 1, the skinned mesh comes last.
fn nodes(name: &str, wrist_from_joint: &[Pose; JOINT_COUNT]) -> Vec<Value> {
    let mut nodes: Vec<Value> = (1..JOINT_COUNT)
        .map(|joint| {
            let local = if joint == index::WRIST {
                Pose::IDENTITY
            } else {
                wrist_from_joint[parent(joint)].inverse() * wrist_from_joint[joint]
            };
            let children: Vec<usize> = (joint + 1..JOINT_COUNT)
                .filter(|&child| parent(child) == joint)
                .map(|child| child - 1)
                .collect();
            let mut node = json!({
                "name": JOINT_NAMES[joint],
                "translation": local.position.to_array(),
                "rotation": local.orientation.to_array(),
            });
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            node
        })
        .collect();
    nodes.push(json!({ "name": name, "mesh": 0, "skin": 0 }));
    nodes
}

/// The inverse bind matrix of a joint; rows that are exactly (0, 0, 0, 1) as the format wants.
fn inverse_bind(wrist_from_joint: Pose) -> Mat4 {
    let inverse = wrist_from_joint.inverse();
    Mat4::from_rotation_translation(inverse.orientation, inverse.position)
}

/// The normals of a smooth surface: the sum of the triangles' normals weighted by area.
fn vertex_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for &triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let normal = (b - a).cross(c - a);
        for v in triangle {
            normals[v as usize] += normal;
        }
    }
    normals
        .into_iter()
        .map(|normal| (1e6 * normal).normalize_or(Vec3::Z))
        .collect()
}

/// The GLB container: header, JSON chunk padded with spaces, binary chunk padded with zeros.
fn container(mut document: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    document.resize(document.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + document.len() + 8 + binary.len();
    let mut glb = Vec::with_capacity(length);
    glb.extend_from_slice(b"glTF");
    glb.extend_from_slice(&2_u32.to_le_bytes());
    glb.extend_from_slice(&(length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", document), (b"BIN\0", binary)] {
        glb.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        glb.extend_from_slice(kind);
        glb.extend_from_slice(&chunk);
    }
    glb
}
