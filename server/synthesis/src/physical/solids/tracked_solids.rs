//! The solids of a hand that is compared with another person's.

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

/// Solids that such a hand has beside those of every hand.
pub const TRACKED_SOLIDS: usize = AROUND_METACARPALS + 1;

/// A hand and forearm as solids for where two hands meet: nowhere thinner than skin that was fitted to a hand of its size,
/// and nowhere more than a millimetre thinner than its joints' radii say, by which others draw it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedSolids {
    /// The hand as it is beside an object.
    pub hand: HandSolids,
    /// Its palm, along the metacarpals at least as thick as told: four solids more instead would no longer fit into as many
    /// registers.
    pub palm: [TaperedCapsule; PALM_SOLIDS],
    /// What is told of the rest: across the knuckles, from the wrist to the metacarpals' bases and the thumb's, and the
    /// middle of the forearm.
    pub tracked: [TaperedCapsule; TRACKED_SOLIDS],
}

impl TrackedSolids {
    /// How many solids there are.
    pub(crate) const COUNT: usize = HandSolids::COUNT + TRACKED_SOLIDS;

    /// The solids of a hand's tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        let wrist = joints.joints[index::WRIST];
        let forearm = middle_of_forearm(thesis_from_openxr_frame(wrist.pose), wrist.radius);
        Self::new(
            &HandSolids::of_joints(joints),
            &TrackedPalm::of_joints(joints),
            forearm,
        )
    }

    /// The solids of a rig's hand of which those beside an object are known, with its wrist there.
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

    /// The same hand elsewhere.
    #[must_use]
    pub fn moved(&self, way: Vec3) -> Self {
        let mut moved = Self {
            hand: self.hand.moved(way),
            ..*self
        };
        for solid in moved.palm.iter_mut().chain(&mut moved.tracked) {
            solid.start += way;
            solid.end += way;
        }
        moved
    }

    /// All solids for where hands meet: those of every hand in the order of [`HandSolids::iter`], then those that are told.
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

    /// Those of them that stay where the wrist is, whatever the digits do.
    pub fn still(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        self.palm.iter().chain(&self.hand.forearm).chain(&self.tracked)
    }

    /// All solids in the order of [`TrackedSolids::iter`], side by side.
    pub(crate) fn to_array(self) -> [TaperedCapsule; Self::COUNT] {
        let mut all = [self.tracked[0]; Self::COUNT];
        for (place, solid) in all.iter_mut().zip(self.iter()) {
            *place = *solid;
        }
        all
    }
}
