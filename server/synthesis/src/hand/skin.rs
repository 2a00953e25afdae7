//! The hand's skin: a closed mesh that follows the joints by linear blend skinning.

use glam::{Affine3A, Vec3};

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

impl Skin {
    /// The vertex positions when the joints are at `joints`, in their frame. A hand whose bones are longer or thicker
    /// than the bind pose's stretches the skin along and across each bone.
    pub fn posed(&self, joints: &HandJoints) -> Vec<Vec3> {
        let matrices: [Affine3A; JOINT_COUNT] = std::array::from_fn(|i| {
            let scale = joint_scale(&self.bind, joints, i);
            joints.joints[i].pose.to_affine()
                * Affine3A::from_scale(scale)
                * self.bind.joints[i].pose.inverse().to_affine()
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

/// How much a joint's part of the skin grows across (x, y) and along (z) its bone from the bind pose to `target`.
fn joint_scale(bind: &HandJoints, target: &HandJoints, joint: usize) -> Vec3 {
    let length = |hand: &HandJoints| {
        let (from, to) = bone_of(joint);
        hand.joints[from]
            .pose
            .position
            .distance(hand.joints[to].pose.position)
    };
    let ratio = |target: f32, bind: f32| {
        if bind > 1e-4 && target > 1e-4 {
            target / bind
        } else {
            1.0
        }
    };
    let along = ratio(length(target), length(bind));
    if joint == index::WRIST || joint == index::PALM {
        // The palm is one piece: it grows with the hand, not with the tracked radius of one joint.
        return Vec3::splat(along);
    }
    let across = ratio(target.joints[joint].radius, bind.joints[joint].radius);
    Vec3::new(across, across, along)
}

/// The joints between which a joint's bone runs; tips share the distal bone.
fn bone_of(joint: usize) -> (usize, usize) {
    match joint {
        index::PALM | index::WRIST => (index::WRIST, index::FIRST_OF_DIGIT[2] + 1),
        tip if index::TIP_OF_DIGIT.contains(&tip) => (tip - 1, tip),
        other => (other, other + 1),
    }
}
