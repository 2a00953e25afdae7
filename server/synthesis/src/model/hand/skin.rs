//! The hand's skin: a closed mesh that follows the joints by linear blend skinning.

use glam::{Affine3A, Quat, Vec3};

use super::joints::{HandJoints, JOINT_COUNT, index};
use crate::base::pose::Pose;

/// A closed triangle mesh bound to the 26 joints.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Vertex positions in the bind pose, in the frame of `bind`, in metres.
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The joints that move each vertex, as `OpenXR` indices.
    pub joint_indices: Vec<[u8; 4]>,
    /// The weights of these joints; each row sums to one.
    pub weights: Vec<[f32; 4]>,
    /// The joints in the bind pose.
    pub bind: HandJoints,
}

/// Largest factor by which a digit's thickness may change relative to the hand's size. It limits errors of trackers,
/// which disagree on what a joint's radius is.
const MAX_THICKNESS_CHANGE: f32 = 1.35;

/// Shorter lengths count as zero, in metres.
const MIN_LENGTH: f32 = 1e-4;

/// Where a joint takes the skin that it moves: a point p of its frame in [`Skin::bind_frames`] goes to `pose * (scale * p)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinJoint {
    /// The joint's frame, with -Z along its bone.
    pub pose: Pose,
    /// How much longer and thicker the bone is than in the bind pose, along the frame's axes; 0 for a finger that is missing.
    pub scale: Vec3,
}

impl Skin {
    /// The vertex positions for joints at `joints`, in their frame and in metres. Where bones are longer or thicker
    /// than in the bind pose, the skin stretches along and across each bone. That of a missing finger shrinks to its knuckle.
    pub fn posed(&self, joints: &HandJoints) -> Vec<Vec3> {
        let (skin_joints, bind_frames) = (self.joints_at(joints), self.bind_frames());
        let matrices: [Affine3A; JOINT_COUNT] = std::array::from_fn(|joint| {
            skin_joints[joint].pose.to_affine()
                * Affine3A::from_scale(skin_joints[joint].scale)
                * bind_frames[joint].to_affine().inverse()
        });
        self.positions
            .iter()
            .zip(self.joint_indices.iter().zip(&self.weights))
            .map(|(&position, (joint_indices, weights))| {
                let mut posed = Vec3::ZERO;
                for (&joint, &weight) in joint_indices.iter().zip(weights) {
                    if weight > 0.0 {
                        posed += weight * matrices[usize::from(joint)].transform_point3(position);
                    }
                }
                posed
            })
            .collect()
    }

    /// What moves the skin for joints at `joints`, in their frame. Linear blend skinning with these gives [`Skin::posed`].
    pub fn joints_at(&self, joints: &HandJoints) -> [SkinJoint; JOINT_COUNT] {
        let size = ratio(hand_length(joints), hand_length(&self.bind));
        std::array::from_fn(|joint| SkinJoint {
            pose: bone_frame(joints, joint),
            scale: joint_scale(&self.bind, joints, joint, size),
        })
    }

    /// The joints' frames in the bind pose, in the frame of [`Skin::bind`], with -Z along the bones.
    pub fn bind_frames(&self) -> [Pose; JOINT_COUNT] {
        std::array::from_fn(|joint| bone_frame(&self.bind, joint))
    }
}

/// The scale of a joint's skin across (x, y) and along (z) its bone, from the bind pose to `target`. `size` is the
/// ratio of the hands' lengths.
fn joint_scale(bind: &HandJoints, target: &HandJoints, joint: usize, size: f32) -> Vec3 {
    let along = ratio(bone(target, joint).length(), bone(bind, joint).length());
    if joint == index::WRIST || joint == index::PALM {
        return Vec3::splat(size);
    }
    if !target.has(joint) && !index::FIRST_OF_DIGIT.contains(&joint) {
        return Vec3::ZERO;
    }
    if index::FIRST_OF_DIGIT.contains(&joint) {
        // The palm is one piece: it scales with the hand, not with the tracked radius of one joint.
        return Vec3::new(size, size, along);
    }
    let across = ratio(target.joints[joint].radius, bind.joints[joint].radius);
    let across = across.clamp(size / MAX_THICKNESS_CHANGE, size * MAX_THICKNESS_CHANGE);
    Vec3::new(across, across, along)
}

/// A joint's frame, turned by [`bone_aligned`].
fn bone_frame(hand: &HandJoints, joint: usize) -> Pose {
    Pose {
        position: hand.joints[joint].pose.position,
        orientation: bone_aligned(hand, joint),
    }
}

/// A joint's orientation after the smallest rotation that aligns its -Z axis with its bone. Trackers report
/// metacarpals up to 15 degrees off their bones, which would tear the fingers off the palm.
fn bone_aligned(hand: &HandJoints, joint: usize) -> Quat {
    let orientation = hand.joints[joint].pose.orientation;
    let bone = bone(hand, joint);
    let keeps_own = joint == index::WRIST || joint == index::PALM || index::TIP_OF_DIGIT.contains(&joint);
    if keeps_own || bone.length() < MIN_LENGTH {
        return orientation;
    }
    let forward = orientation * Vec3::NEG_Z;
    Quat::from_rotation_arc(forward, bone.normalize_or(forward)) * orientation
}

/// Distance from the wrist to the knuckle of the middle finger, in metres.
fn hand_length(hand: &HandJoints) -> f32 {
    bone(hand, index::WRIST).length()
}

/// The bone of a joint as a vector, in metres. Tips share the distal bone; wrist and palm use the line from the wrist
/// to the
/// middle knuckle.
fn bone(hand: &HandJoints, joint: usize) -> Vec3 {
    let (from, to) = match joint {
        index::PALM | index::WRIST => (index::WRIST, index::FIRST_OF_DIGIT[2] + 1),
        tip if index::TIP_OF_DIGIT.contains(&tip) => (tip - 1, tip),
        other => (other, other + 1),
    };
    hand.joints[to].pose.position - hand.joints[from].pose.position
}

/// `target` divided by `bind`; 1 if either counts as zero.
fn ratio(target: f32, bind: f32) -> f32 {
    if bind > MIN_LENGTH && target > MIN_LENGTH {
        target / bind
    } else {
        1.0
    }
}
