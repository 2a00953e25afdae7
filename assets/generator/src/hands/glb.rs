//! A skinned hand as binary glTF 2.0: 25 joints with `WebXR` names, -Z along the bones, in the wrist's frame.

use glam::{Mat4, Vec3};
use grasp_scene::GlbWriter;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        joints::{JOINT_COUNT, JOINT_NAMES, index},
        skin::Skin,
    },
};
use serde_json::{Value, json};

/// The parent of a joint, by `OpenXR` index; the wrist is the root.
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
    let mut file = GlbWriter::default();
    let position = file.positions(&positions);
    let normal = file.vectors(&vertex_normals(&positions, &skin.triangles));
    // glTF counts the joints of the skin, which start with the wrist.
    let joint_indices: Vec<[u8; 4]> = skin
        .joint_indices
        .iter()
        .map(|joints| joints.map(|joint| joint.saturating_sub(1)))
        .collect();
    let joints = file.joints(&joint_indices);
    let weights = file.weights(&skin.weights);
    let corners: Vec<u16> = skin.triangles.iter().flatten().map(|&v| v as u16).collect();
    let indices = file.short_indices(&corners);
    let inverse_bind_matrices: Vec<Mat4> = wrist_from_joint[1..]
        .iter()
        .map(|&pose| inverse_bind(pose))
        .collect();
    let inverse_binds = file.matrices(&inverse_bind_matrices);
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
    });
    file.finish(document)
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
