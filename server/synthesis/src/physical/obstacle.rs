//! Parts of the hand that are in the way of its own digits.

use super::{
    closing::SURE_GAP,
    solids::{Bounded, HandSolids, SOFT_CONTACT, TaperedCapsule},
};

/// How far a digit stops before it is as deep in another part of the hand as soft flesh allows, in metres: the digit
/// that it stops at is not moved any more, but the search for a touch ends up to a tenth of a millimetre off.
const SPARE: f32 = 0.001;

/// A part of the hand that a digit does not go through.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle {
    part: Bounded,
    /// The first of the digit's links that it stops; those before overlap it in every pose.
    first_link: usize,
}

impl Obstacle {
    /// A part of the hand that stops a digit's links from `first_link` on.
    pub fn new(part: TaperedCapsule, first_link: usize) -> Self {
        Self {
            part: Bounded::new(part),
            first_link,
        }
    }

    /// What is in the way of every digit: the palm. Which parts can meet is said at
    /// [`self_clearance`](super::solids::self_clearance).
    pub fn of_palm(solids: &HandSolids) -> impl Iterator<Item = Self> {
        solids.palm.iter().map(|part| Self::new(*part, 1))
    }

    /// What is in the fingers' way beside the palm: the thumb and its ball.
    pub fn of_thumb(solids: &HandSolids) -> impl Iterator<Item = Self> {
        let [thumb, ..] = &solids.phalanges;
        let links = thumb.iter().map(|part| Self::new(*part, 0));
        links.chain(solids.thenar.iter().map(|part| Self::new(*part, 1)))
    }

    /// True if it stops a link.
    pub(super) fn stops(&self, link: usize) -> bool {
        link >= self.first_link
    }

    /// A distance that it keeps from a link, in metres, on the scale on which the object is touched: the smallest if
    /// that is small and less than `enough`.
    pub(super) fn gap(&self, link: &Bounded, enough: f32) -> f32 {
        let flesh = SOFT_CONTACT - SPARE;
        let sure = self.part.sure_distance(link) + flesh;
        if sure > SURE_GAP.min(enough) {
            return sure;
        }
        self.part.solid.distance(&link.solid) + flesh
    }
}
