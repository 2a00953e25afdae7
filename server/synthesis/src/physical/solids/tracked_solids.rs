//! Tracked hand solids: a hand as it is compared with another person's.

use glam::Vec3;

use super::{
    HandSolids, PALM_SOLIDS, TaperedCapsule, TrackedPalm, flesh::palm_as_tracked,
    hand_solids::middle_of_forearm, tracked_palm::AROUND_METACARPALS,
};
use crate::{
    base::pose::Pose,
    model::hand::{
        joints::{HandJoints, index, thesis_from_openxr_frame},
        rig::Rig,
    },
};

/// Solids of such a hand in addition to [`HandSolids`].
pub const TRACKED_SOLIDS: usize = AROUND_METACARPALS + 1;

/// A hand and forearm as solids for where two hands meet: nowhere thinner than skin fitted to a hand of its size, and
/// at most a millimetre thinner than its joints' radii, from which clients draw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedSolids {
    /// The hand as it is compared with an object.
    pub hand: HandSolids,
    /// Its palm, along the metacarpals at least as thick as tracked. Four separate solids instead would no longer fit
    /// into the same number of registers.
    pub palm: [TaperedCapsule; PALM_SOLIDS],
    /// The other tracked parts: across the knuckles, from the wrist to all metacarpal bases, and the middle of the
    /// forearm.
    pub tracked: [TaperedCapsule; TRACKED_SOLIDS],
}

impl TrackedSolids {
    /// Number of solids.
    pub(crate) const COUNT: usize = HandSolids::COUNT + TRACKED_SOLIDS;

    /// The solids of tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        let wrist = joints.joints[index::WRIST];
        let forearm = middle_of_forearm(thesis_from_openxr_frame(wrist.pose), wrist.radius);
        Self::new(
            &HandSolids::of_joints(joints),
            &TrackedPalm::of_joints(joints),
            forearm,
        )
    }

    /// The solids of a rig's hand with a given wrist pose, whose [`HandSolids`] are known.
    pub fn of_rig(rig: &Rig, frame_from_wrist: Pose, hand: &HandSolids) -> Self {
        let forearm = middle_of_forearm(frame_from_wrist, rig.joint_radii[index::WRIST]);
        Self::new(hand, &TrackedPalm::of_rig(rig, frame_from_wrist), forearm)
    }

    fn new(hand: &HandSolids, palm: &TrackedPalm, forearm: TaperedCapsule) -> Self {
        let mut tracked = [forearm; TRACKED_SOLIDS];
        tracked[..AROUND_METACARPALS].copy_from_slice(&palm.around_metacarpals());
        Self {
            hand: *hand,
            palm: palm_as_tracked(&hand.palm, palm),
            tracked,
        }
    }

    /// The same hand, translated.
    #[must_use]
    pub fn moved(&self, offset: Vec3) -> Self {
        let mut moved = Self {
            hand: self.hand.moved(offset),
            ..*self
        };
        for solid in moved.palm.iter_mut().chain(&mut moved.tracked) {
            solid.start += offset;
            solid.end += offset;
        }
        moved
    }

    /// All solids for comparing hands: those of [`HandSolids::iter`] in the same order, then the additional ones.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        let HandSolids {
            phalanges,
            thenar,
            forearm,
            ..
        } = &self.hand;
        phalanges
            .as_flattened()
            .iter()
            .chain(&self.palm)
            .chain(thenar)
            .chain(forearm)
            .chain(&self.tracked)
    }

    /// The solids that move with the wrist only.
    pub fn still(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        self.palm.iter().chain(&self.hand.forearm).chain(&self.tracked)
    }

    /// All solids in the order of [`TrackedSolids::iter`].
    pub(crate) fn to_array(self) -> [TaperedCapsule; Self::COUNT] {
        let mut all = [self.tracked[0]; Self::COUNT];
        for (place, solid) in all.iter_mut().zip(self.iter()) {
            *place = *solid;
        }
        all
    }
}
