//! The solids of a giver's hand, which are not to be touched.

use super::{
    HandSolids, TaperedCapsule,
    hand_solids::middle_of_forearm,
    told::{AROUND_METACARPALS, around_metacarpals},
};
use crate::hand::joints::HandJoints;

/// Solids that a giver's hand has beside those of every hand.
pub const TOLD_SOLIDS: usize = AROUND_METACARPALS + 1;

/// A giver's hand and forearm as solids: nowhere thinner than skin that was fitted to a hand of its size, and nowhere
/// more than a millimetre thinner than its joints' radii say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GiverSolids {
    /// As every hand, but along the metacarpals at least as thick as told: four solids more instead would no longer fit into as
    /// many registers.
    pub hand: HandSolids,
    /// What is told of the rest: across the knuckles, from the wrist to the metacarpals' bases and the thumb's, and the
    /// middle of the forearm.
    pub told: [TaperedCapsule; TOLD_SOLIDS],
}

impl GiverSolids {
    /// How many solids there are.
    pub(crate) const COUNT: usize = HandSolids::COUNT + TOLD_SOLIDS;

    /// The solids of a giver's tracked joints, in their frame.
    pub fn of_joints(joints: &HandJoints) -> Self {
        let mut told = [middle_of_forearm(joints); TOLD_SOLIDS];
        told[..AROUND_METACARPALS].copy_from_slice(&around_metacarpals(joints));
        Self {
            hand: HandSolids::of_giver(joints),
            told,
        }
    }

    /// All solids: those of every hand in the order of [`HandSolids::iter`], then those that are told.
    pub fn iter(&self) -> impl Iterator<Item = &TaperedCapsule> + Clone {
        self.hand.iter().chain(&self.told)
    }

    /// All solids in the order of [`GiverSolids::iter`], side by side.
    pub(crate) fn to_array(self) -> [TaperedCapsule; Self::COUNT] {
        let mut all = [self.told[0]; Self::COUNT];
        for (place, solid) in all.iter_mut().zip(self.iter()) {
            *place = *solid;
        }
        all
    }
}
