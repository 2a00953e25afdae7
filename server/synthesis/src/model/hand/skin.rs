//! The hand's skin: a closed mesh that follows the joints by linear blend skinning.

use glam::{Affine3A, Quat, Vec3};

use super::joints::{HandJoints, JOINT_COUNT, index};

/// A closed triangle mesh bound to the 26 joints.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Vertex positions in the bind pose, in metres, in the frame of `bind`.
    pub positions: Vec<Vec3>,
    /// Triangles, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The joints that move each vertex, by `OpenXR` index.
    pub joint_indices: Vec<[u8; 4]>,
    /// Their weights; each row sums to one.
    pub weights: Vec<[f32; 4]>,
    /// The joints in the bind pose.
    pub bind: HandJoints,
}

/// The largest change of a digit's thickness that is followed, as a factor beside the change of the hand's size.
/// Trackers differ in what they call a joint's radius; a hand twice as thick as long is their mistake.
const THICKNESS_CHANGE: f32 = 1.35;

/// Lengths below this are no lengths, in metres.
const SHORTEST: f32 = 1e-4;

impl Skin {
    /// The vertex positions when the joints are at `joints`, in their frame. A hand whose bones are longer or thicker
    /// than the bind pose's stretches the skin along and across each bone.
    pub fn posed(&self, joints: &HandJoints) -> Vec<Vec3> {
        let size = ratio(hand_length(joints), hand_length(&self.bind));
        let matrices: [Affine3A; JOINT_COUNT] = std::array::from_fn(|joint| {
            let target = joints.joints[joint].pose;
            let bind = self.bind.joints[joint].pose;
            let scale = joint_scale(&self.bind, joints, joint, size);
            Affine3A::from_rotation_translation(aimed(joints, joint), target.position)
                * Affine3A::from_scale(scale)
                * Affine3A::from_rotation_translation(aimed(&self.bind, joint), bind.position).inverse()
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
}

/// How much a joint's part of the skin grows across (x, y) and along (z) its bone from the bind pose to `target`, a
/// hand of `size` times the length.
fn joint_scale(bind: &HandJoints, target: &HandJoints, joint: usize, size: f32) -> Vec3 {
    let along = ratio(bone(target, joint).length(), bone(bind, joint).length());
    if joint == index::WRIST || joint == index::PALM {
        return Vec3::splat(size);
    }
    if index::FIRST_OF_DIGIT.contains(&joint) {
        // The palm is one piece: it grows with the hand, not with the tracked radius of one joint.
        return Vec3::new(size, size, along);
    }
    let across = ratio(target.joints[joint].radius, bind.joints[joint].radius);
    let across = across.clamp(size / THICKNESS_CHANGE, size * THICKNESS_CHANGE);
    Vec3::new(across, across, along)
}

/// A joint's orientation, turned as little as possible so that its -Z axis runs along its bone. Trackers report
/// metacarpals up to 15 degrees off their bones, which would tear the fingers off the palm.
fn aimed(hand: &HandJoints, joint: usize) -> Quat {
    let orientation = hand.joints[joint].pose.orientation;
    let bone = bone(hand, joint);
    let on_its_own = joint == index::WRIST || joint == index::PALM || index::TIP_OF_DIGIT.contains(&joint);
    if on_its_own || bone.length() < SHORTEST {
        return orientation;
    }
    let forward = orientation * Vec3::NEG_Z;
    Quat::from_rotation_arc(forward, bone.normalize_or(forward)) * orientation
}

/// From wrist to the knuckle of the middle finger in metres.
fn hand_length(hand: &HandJoints) -> f32 {
    bone(hand, index::WRIST).length()
}

/// The bone that a joint carries, in metres. Tips share the distal bone, wrist and palm the way to the middle knuckle.
fn bone(hand: &HandJoints, joint: usize) -> Vec3 {
    let (from, to) = match joint {
        index::PALM | index::WRIST => (index::WRIST, index::FIRST_OF_DIGIT[2] + 1),
        tip if index::TIP_OF_DIGIT.contains(&tip) => (tip - 1, tip),
        other => (other, other + 1),
    };
    hand.joints[to].pose.position - hand.joints[from].pose.position
}

/// `target` per `bind`, one where either is nothing.
fn ratio(target: f32, bind: f32) -> f32 {
    if bind > SHORTEST && target > SHORTEST {
        target / bind
    } else {
        1.0
    }
}
