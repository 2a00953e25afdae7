//! Parts of a hand that stop its own digits.

use super::{
    closing::COARSE_GAP,
    solids::{Bounded, HandSolids, SOFT_CONTACT, TaperedCapsule},
};

/// Distance, in metres, that a digit stops short of the depth that soft flesh allows ([`SOFT_CONTACT`]) in another
/// part of the hand: it absorbs the tolerance of the search for a touch.
const OBSTACLE_MARGIN: f32 = 0.001;

/// A part of the hand that a digit does not go through.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle {
    part: Bounded,
    /// The first link of a digit that it stops; the links before overlap it in every pose.
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

    /// The palm, which stops every digit. [`self_clearance`](super::solids::self_clearance) lists which parts can
    /// meet.
    pub fn of_palm(solids: &HandSolids) -> impl Iterator<Item = Self> {
        solids.palm.iter().map(|part| Self::new(*part, 1))
    }

    /// What stops the fingers besides the palm: the thumb and its ball.
    pub fn of_thumb(solids: &HandSolids) -> impl Iterator<Item = Self> {
        let [thumb, ..] = &solids.phalanges;
        let links = thumb.iter().map(|part| Self::new(*part, 0));
        links.chain(solids.thenar.iter().map(|part| Self::new(*part, 1)))
    }

    /// True if it stops this link of a digit.
    pub(super) fn stops(&self, link: usize) -> bool {
        link >= self.first_link
    }

    /// A lower bound on the gap to a link in metres, with the depth that soft flesh allows added; exact if it is
    /// below [`COARSE_GAP`] and `enough`.
    pub(super) fn gap(&self, link: &Bounded, enough: f32) -> f32 {
        let flesh = SOFT_CONTACT - OBSTACLE_MARGIN;
        let lower_bound = self.part.distance_lower_bound(link) + flesh;
        if lower_bound > COARSE_GAP.min(enough) {
            return lower_bound;
        }
        self.part.solid.distance(&link.solid) + flesh
    }
}
