//! The palm as described by a hand's own joints: tapered capsules from joint to joint, with the joints' radii.

use std::array::from_fn;

use glam::Vec3;

use super::TaperedCapsule;
use crate::{
    base::pose::Pose,
    model::hand::{
        joints::{HandJoints, index},
        rig::Rig,
    },
};

/// Two joints, as indices into [`TrackedPalm::joints`].
type Bone = [usize; 2];

/// Ends of the fingers' metacarpals: base and knuckle of each, from index to little finger.
pub(super) const METACARPAL_ENDS: usize = 8;

/// Index of the wrist, …
const WRIST: usize = METACARPAL_ENDS;

/// … and of the thumb's base.
const THUMB: usize = WRIST + 1;

/// Indices of the metacarpals' bases, from index to little finger, …
const BASES: [usize; 4] = [0, 2, 4, 6];

/// … and of the knuckles.
const KNUCKLES: [usize; 4] = [1, 3, 5, 7];

/// The metacarpals.
const METACARPALS: [Bone; 4] = [[0, 1], [2, 3], [4, 5], [6, 7]];

/// Between neighbouring bases.
const ACROSS_BASES: [Bone; 3] = neighbours(BASES);

/// Between neighbouring knuckles.
const ACROSS_KNUCKLES: [Bone; 3] = neighbours(KNUCKLES);

/// From the wrist to the bases of the metacarpals, the thumb's last.
const FROM_WRIST: [Bone; 5] = [
    [WRIST, BASES[0]],
    [WRIST, BASES[1]],
    [WRIST, BASES[2]],
    [WRIST, BASES[3]],
    [WRIST, THUMB],
];

/// Number of capsules from [`TrackedPalm::around_metacarpals`].
pub(super) const AROUND_METACARPALS: usize = ACROSS_KNUCKLES.len() + FROM_WRIST.len();

const fn neighbours(joints: [usize; 4]) -> [Bone; 3] {
    let [a, b, c, d] = joints;
    [[a, b], [b, c], [c, d]]
}

/// The joints that are fixed in the palm, each with its distance to the skin.
#[derive(Clone, Copy, Debug)]
pub struct TrackedPalm {
    /// Base and knuckle of each metacarpal from index to little finger, the wrist, and the base of the thumb:
    /// positions and radii in metres.
    joints: [(Vec3, f32); THUMB + 1],
}

impl TrackedPalm {
    /// The palm of tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        Self {
            joints: from_fn(|place| {
                let joint = joints.joints[openxr_joint(place)];
                (joint.pose.position, joint.radius)
            }),
        }
    }

    /// The palm of a rig's hand, which does not depend on its digits.
    pub fn of_rig(rig: &Rig, frame_from_wrist: Pose) -> Self {
        let in_wrist = |place: usize| match place {
            WRIST => Vec3::ZERO,
            THUMB => rig.digits[0].wrist_from_base.position,
            end if end.is_multiple_of(2) => rig.finger_metacarpals[end / 2],
            end => rig.digits[end / 2 + 1].wrist_from_base.position,
        };
        Self {
            joints: from_fn(|place| {
                (
                    frame_from_wrist.transform_point(in_wrist(place)),
                    rig.joint_radii[openxr_joint(place)],
                )
            }),
        }
    }

    /// Position and radius at a share of the distance between two ends of metacarpals.
    pub(super) fn between(&self, a: usize, b: usize, share: f32) -> (Vec3, f32) {
        let [(a, a_radius), (b, b_radius)] = [self.joints[a], self.joints[b]];
        (a.lerp(b, share), a_radius + (b_radius - a_radius) * share)
    }

    /// The palm behind the metacarpals and between their heads: from knuckle to knuckle, and from the wrist to the
    /// bases.
    pub(super) fn around_metacarpals(&self) -> [TaperedCapsule; AROUND_METACARPALS] {
        let mut solids = [TaperedCapsule::default(); AROUND_METACARPALS];
        let bones = ACROSS_KNUCKLES.into_iter().chain(FROM_WRIST);
        for (solid, bone) in solids.iter_mut().zip(bones) {
            *solid = self.capsule(bone);
        }
        solids
    }

    /// Unsigned distance of a point from the tracked skin in metres: around the metacarpals, between neighbours
    /// across knuckles and bases, and from the wrist to all bases, the thumb's included.
    pub fn distance_to_skin(&self, point: Vec3) -> f32 {
        METACARPALS
            .into_iter()
            .chain(ACROSS_BASES)
            .chain(ACROSS_KNUCKLES)
            .chain(FROM_WRIST)
            .map(|bone| self.capsule(bone).signed_distance(point))
            .fold(f32::INFINITY, f32::min)
            .abs()
    }

    fn capsule(&self, [a, b]: Bone) -> TaperedCapsule {
        let [(start, start_radius), (end, end_radius)] = [self.joints[a], self.joints[b]];
        TaperedCapsule::new(start, end, start_radius, end_radius)
    }
}

/// The `OpenXR` joint at the end of a metacarpal.
pub(super) fn joint_of_end(end: usize) -> usize {
    index::FIRST_OF_DIGIT[end / 2 + 1] + end % 2
}

/// The `OpenXR` joint of one of [`TrackedPalm::joints`].
fn openxr_joint(place: usize) -> usize {
    match place {
        WRIST => index::WRIST,
        THUMB => index::FIRST_OF_DIGIT[0],
        end => joint_of_end(end),
    }
}
