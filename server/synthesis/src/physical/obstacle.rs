//! Parts of a hand that stop its own digits.

use super::{
    closing::COARSE_GAP,
    solids::{Bounded, HandSolids, SOFT_CONTACT, TaperedCapsule},
};
use crate::model::hand::rig::{PALM_PART, THUMB_BALL_PART};

/// Distance, in metres, that a digit stops short of the depth that soft flesh allows ([`SOFT_CONTACT`]) in another
/// part of the hand: it absorbs the tolerance of the search for a touch.
const OBSTACLE_MARGIN: f32 = 0.001;

/// A part of the hand that a digit does not go through.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle {
    solid: Bounded,
    /// Its index among the parts of [`RestOverlaps`](crate::model::hand::rig::RestOverlaps).
    pub(super) part: usize,
}

impl Obstacle {
    /// A solid of a part of the hand: a link of the thumb, the palm or the ball of the thumb, by its index among the parts of
    /// [`RestOverlaps`](crate::model::hand::rig::RestOverlaps).
    pub fn new(solid: TaperedCapsule, part: usize) -> Self {
        Self {
            solid: Bounded::new(solid),
            part,
        }
    }

    /// The palm, which stops every digit. [`self_clearance`](super::solids::self_clearance) lists which parts can
    /// meet.
    pub fn of_palm(solids: &HandSolids) -> impl Iterator<Item = Self> {
        solids.palm.iter().map(|solid| Self::new(*solid, PALM_PART))
    }

    /// What stops the fingers besides the palm: the thumb and its ball.
    pub fn of_thumb(solids: &HandSolids) -> impl Iterator<Item = Self> {
        let [thumb, ..] = &solids.phalanges;
        let links = thumb
            .iter()
            .enumerate()
            .map(|(link, solid)| Self::new(*solid, link));
        links.chain(
            solids
                .thenar
                .iter()
                .map(|solid| Self::new(*solid, THUMB_BALL_PART)),
        )
    }

    /// True if it stops this link of a digit: the first link overlaps palm and ball of the thumb in every pose.
    pub(super) fn stops(&self, link: usize) -> bool {
        link > 0 || self.part < PALM_PART
    }

    /// A lower bound on the gap to a link in metres, with the depth that soft flesh allows and that of their overlap at rest
    /// added; exact if it is below [`COARSE_GAP`] and `enough`.
    pub(super) fn gap(&self, link: &Bounded, rest_overlap: f32, enough: f32) -> f32 {
        let flesh = SOFT_CONTACT - OBSTACLE_MARGIN + rest_overlap;
        let lower_bound = self.solid.distance_lower_bound(link) + flesh;
        if lower_bound > COARSE_GAP.min(enough) {
            return lower_bound;
        }
        self.solid.solid.distance(&link.solid) + flesh
    }
}
