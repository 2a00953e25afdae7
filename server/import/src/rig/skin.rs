//! The skin of a hand's model, where an answer poses its nodes.

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3, Quat, Vec3};
use gltf::Node;
use grasp_synthesis::base::{pose::Pose, stop::Stop};

use crate::{
    MeshLimits,
    error::{ImportError, Violations},
    gltf::{self as file, Scene, SkinnedMesh, skinned_mesh},
};

/// The least share of a vertex's weights that nodes of the hand must have, for it to be the hand's.
const HAND_SHARE: f64 = 0.5;

/// Where the nodes of a model are.
#[derive(Clone, Debug)]
pub struct ModelPose {
    /// The root node of the hand.
    pub root: String,
    /// Its frame.
    pub frame_from_root: Pose,
    /// The factor by which its scale in the file is multiplied.
    pub scale: f32,
    /// Rotations in their parents, and translations where they are not the file's, of nodes below it.
    pub nodes: Vec<(String, Quat, Option<Vec3>)>,
}

/// The skin of a hand, in the frame of its pose.
#[derive(Clone, Debug, Default)]
pub struct PosedSkin {
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// Their indices, three by three.
    pub triangles: Vec<[u32; 3]>,
}

/// The skin that nodes of a hand move.
///
/// # Errors
/// The file is no glTF with such a node and a skin; see [`ImportError`].
pub fn posed_skin(bytes: &[u8], pose: &ModelPose, limits: MeshLimits) -> Result<PosedSkin, Vec<ImportError>> {
    let opened = file::open(bytes, limits, Stop::NEVER).map_err(Violations::into_errors)?;
    let scene = Scene::of(&opened.document);
    let nodes: Vec<Node<'_>> = opened.document.nodes().collect();
    let named = nodes.iter().find(|node| node.name() == Some(pose.root.as_str()));
    let root = named.ok_or_else(|| {
        let place = format!("node {:?}", pose.root);
        vec![ImportError::at(
            place,
            "is not in the model: is it the one of this rig?",
        )]
    })?;
    let root = root.index();
    let frame_from_node = frames(&scene, &nodes, root, pose);
    let frame_from_scene = frame_from_node[&root] * scene.scene_from_node[root].inverse();
    let mut skin = PosedSkin::default();
    for &shown in &scene.shown {
        let part = skinned_mesh(
            &nodes[shown],
            &opened,
            limits,
            |node| {
                // What is not the hand's follows it as a whole.
                let follows = || frame_from_scene * scene.scene_from_node[node];
                frame_from_node.get(&node).copied().unwrap_or_else(follows)
            },
            |node| frame_from_node.contains_key(&node),
        );
        add(&mut skin, part.map_err(|error| vec![error])?);
    }
    if skin.triangles.is_empty() {
        return Err(vec![ImportError::at(
            "the model",
            "has no skin that follows the hand",
        )]);
    }
    Ok(skin)
}

/// The frames of a hand's nodes.
fn frames(scene: &Scene, nodes: &[Node<'_>], root: usize, pose: &ModelPose) -> HashMap<usize, DMat4> {
    let changes: HashMap<&str, (Quat, Option<Vec3>)> = pose
        .nodes
        .iter()
        .map(|(name, rotation, translation)| (name.as_str(), (*rotation, *translation)))
        .collect();
    let Pose {
        position,
        orientation,
    } = pose.frame_from_root;
    let (scale, _, _) = scene.scene_from_node[root].to_scale_rotation_translation();
    let frame_from_root = DMat4::from_scale_rotation_translation(
        scale * f64::from(pose.scale),
        orientation.as_dquat(),
        position.as_dvec3(),
    );
    let mut frames = HashMap::from([(root, frame_from_root)]);
    for (node, _) in file::walk(nodes, &[root]).into_iter().skip(1) {
        let Some(parent) = scene.parents[node] else {
            continue;
        };
        let local = scene.scene_from_node[parent].inverse() * scene.scene_from_node[node];
        let (scale, rotation, translation) = local.to_scale_rotation_translation();
        let change = nodes[node].name().and_then(|name| changes.get(name));
        let (rotation, translation): (DQuat, DVec3) = change.map_or((rotation, translation), |change| {
            let moved = change.1.map_or(translation, Vec3::as_dvec3);
            (change.0.as_dquat(), moved)
        });
        let local = DMat4::from_scale_rotation_translation(scale, rotation, translation);
        if let Some(&above) = frames.get(&parent) {
            frames.insert(node, above * local);
        }
    }
    frames
}

/// Adds the triangles of a mesh whose corners are all the hand's.
fn add(skin: &mut PosedSkin, mesh: Vec<SkinnedMesh>) {
    for SkinnedMesh {
        positions,
        shares,
        triangles: all,
    } in mesh
    {
        let mut indices = vec![None; positions.len()];
        for corners in all {
            let corners = corners.map(|corner| corner as usize);
            if corners.iter().any(|&corner| shares[corner] < HAND_SHARE) {
                continue;
            }
            skin.triangles.push(corners.map(|corner| {
                *indices[corner].get_or_insert_with(|| {
                    skin.positions.push(positions[corner].as_vec3());
                    skin.positions.len() as u32 - 1
                })
            }));
        }
    }
}
