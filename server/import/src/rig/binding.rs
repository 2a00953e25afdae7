//! Poses the nodes of the model that a rig was made from: local rotations that make its skin take the rig's pose.
//!
//! Each bone keeps its place relative to the rig's link that it was bound along, so that the skin follows the links whatever
//! axes the model's nodes have.

use std::collections::BTreeSet;

use glam::{DMat4, DQuat, DVec3, Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        joints::{JOINT_COUNT, index},
        kinematics::{DigitFrames, HandFrames},
        rig::{DigitRig, Rig},
    },
};

use super::{
    hand_nodes::HandNodes,
    model::{BindPose, Model},
    rest::yaw_of,
};

/// Relative change of a translation that counts as one.
const TRANSLATION_TOLERANCE: f64 = 1e-4;

/// The frame of the link that a joint moves with: the wrist's for the joints of the palm.
fn link_frame(frames: &HandFrames, joint: usize) -> Pose {
    let digit = index::TIP_OF_DIGIT
        .iter()
        .position(|&tip| (tip - 3..=tip).contains(&joint));
    digit.map_or(frames.wrist, |digit| {
        let link = joint + 3 - index::TIP_OF_DIGIT[digit];
        frames.digits[digit].links[link.min(2)]
    })
}

/// A node that is a joint of the hand.
#[derive(Clone, Debug)]
struct BoundNode {
    name: String,
    joint: usize,
    /// The joint that its parent moves with.
    parent: usize,
    /// The bound hand's wrist in the frame of the node's parent.
    parent_from_wrist: DMat4,
    wrist_from_node: DMat4,
    /// The node's translation when nothing has moved, in its parent.
    translation: DVec3,
}

/// The nodes of a hand and how they are bound to its rig.
#[derive(Clone, Debug)]
pub struct Binding {
    root: String,
    /// The joint that the root is.
    root_joint: Option<usize>,
    wrist_from_root: Pose,
    /// The bound hand, with the wrist at the origin.
    bound: HandFrames,
    nodes: Vec<BoundNode>,
}

/// A node's place in its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedNode<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its rotation.
    pub rotation: Quat,
    /// Its translation in the units of the file, if it is not what the file has.
    pub translation: Option<Vec3>,
}

impl Binding {
    /// Binds the nodes of a hand to its rig. `scene_from_wrist` is the rig's wrist, `joints` are the joints at rest in its frame.
    pub(super) fn new(
        model: &Model,
        hand: &HandNodes,
        bind: &BindPose<'_>,
        rig: &Rig,
        (scene_from_wrist, joints): (Pose, &[Vec3; JOINT_COUNT]),
    ) -> Self {
        let scene_from_wrist = matrix(scene_from_wrist);
        let wrist_from_scene = scene_from_wrist.inverse();
        let root = root(model, hand);
        let nodes = hand.joints.iter().enumerate().filter_map(|(joint, node)| {
            let node = (*node)?;
            let parent = model.parents[node].filter(|_| node != root)?;
            let rest = model.scene_from_node[parent].inverse() * model.scene_from_node[node];
            Some(BoundNode {
                name: model.names[node].clone(),
                joint,
                parent: hand.nearest_joint(model, parent).unwrap_or(index::WRIST),
                parent_from_wrist: bind.scene_from_node(parent).inverse() * scene_from_wrist,
                wrist_from_node: wrist_from_scene * bind.scene_from_node(node),
                translation: rest.w_axis.truncate(),
            })
        });
        let (_, orientation, position) =
            (wrist_from_scene * bind.scene_from_node(root)).to_scale_rotation_translation();
        Self {
            root: model.names[root].clone(),
            root_joint: hand.joint_of(root),
            wrist_from_root: Pose::new(position.as_vec3(), orientation.as_quat().normalize()),
            bound: bound_frames(rig, joints),
            nodes: nodes.collect(),
        }
    }

    /// The name of the node that all others are below: the hand's own or, in a flat hierarchy, their parent.
    pub fn root(&self) -> &str {
        &self.root
    }

    /// The names of the nodes and the `OpenXR` indices of their joints: first the root, which may be none.
    pub fn joints(&self) -> impl Iterator<Item = (&str, Option<usize>)> {
        let others = self
            .nodes
            .iter()
            .map(|node| (node.name.as_str(), Some(node.joint)));
        std::iter::once((self.root(), self.root_joint)).chain(others)
    }

    /// The root's frame in that of the pose. `scale` is how much larger the posed rig is than the one of the model.
    pub fn frame_from_root(&self, frames: &HandFrames, scale: f32) -> Pose {
        let wrist_from_root = self.wrist_from_root;
        frames.wrist * Pose::new(scale * wrist_from_root.position, wrist_from_root.orientation)
    }

    /// The nodes of a posed rig, which is `scale` times as large as the one of the model.
    pub fn posed(&self, frames: &HandFrames, scale: f32) -> impl Iterator<Item = PosedNode<'_>> {
        self.nodes.iter().map(move |node| {
            let [parent, own] = [node.parent, node.joint].map(|joint| link_frame(frames, joint));
            let [bound_parent, bound] = [node.parent, node.joint].map(|joint| link_frame(&self.bound, joint));
            let mut moved = parent.inverse() * own;
            moved.position /= scale;
            let moved = matrix(bound_parent * moved * bound.inverse());
            let parent_from_node = node.parent_from_wrist * moved * node.wrist_from_node;
            let (_, rotation, translation): (_, DQuat, _) = parent_from_node.to_scale_rotation_translation();
            let change = translation.distance(node.translation);
            let is_changed = change > TRANSLATION_TOLERANCE * node.translation.length();
            PosedNode {
                name: &node.name,
                rotation: rotation.normalize().as_quat(),
                translation: is_changed.then(|| translation.as_vec3()),
            }
        })
    }
}

fn matrix(pose: Pose) -> DMat4 {
    DMat4::from_rotation_translation(pose.orientation.as_dquat(), pose.position.as_dvec3())
}

/// The nodes whose frames a binding has: the hand's root, and its other joints and their parents.
pub(super) fn needed_nodes(model: &Model, hand: &HandNodes) -> BTreeSet<usize> {
    let root = root(model, hand);
    let others = hand.joints.iter().flatten().filter(|&&node| node != root);
    let with_parents = others.flat_map(|&node| std::iter::once(node).chain(model.parents[node]));
    with_parents.chain([root]).collect()
}

/// The lowest node that is or is above every joint of the hand.
fn root(model: &Model, hand: &HandNodes) -> usize {
    let mut joints = hand.joints.iter().flatten().copied();
    let first = joints.next().unwrap_or_default();
    joints.fold(first, |root, joint| {
        let above: Vec<usize> = model.with_ancestors(joint).collect();
        let common = model.with_ancestors(root).find(|node| above.contains(node));
        common.unwrap_or(root)
    })
}

/// The frames of a rig's links along the joints at rest, with the wrist at the origin.
pub(super) fn bound_frames(rig: &Rig, joints: &[Vec3; JOINT_COUNT]) -> HandFrames {
    HandFrames {
        wrist: Pose::IDENTITY,
        digits: std::array::from_fn(|digit| {
            let tip = index::TIP_OF_DIGIT[digit];
            bound_digit(&rig.digits[digit], [3, 2, 1, 0].map(|place| joints[tip - place]))
        }),
    }
}

fn bound_digit(chain: &DigitRig, points: [Vec3; 4]) -> DigitFrames {
    let along = |link: usize| (points[link + 1] - points[link]).normalize_or(Vec3::Y);
    let yaw = chain.yaw_sign * yaw_of(chain, along(0));
    let mut orientation = chain.wrist_from_base.orientation * Quat::from_rotation_z(yaw);
    let links = std::array::from_fn(|link| {
        let local = orientation.inverse() * along(link);
        // Bends by pitch as far as that can follow the bone, and turns the rest of the way.
        let bent = orientation * Quat::from_rotation_x(local.z.atan2(local.y));
        orientation = (Quat::from_rotation_arc(bent * Vec3::Y, along(link)) * bent).normalize();
        Pose::new(points[link], orientation)
    });
    DigitFrames {
        links,
        tip: points[3],
    }
}
