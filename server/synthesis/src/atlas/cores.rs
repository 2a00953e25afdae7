//! Which grips of an atlas certainly meet a giver, one by one: by some balls inside each hand, side by side for all
//! grips, so that looking at one mostly takes two lines of the cache.

use crate::physical::{
    grip::GIVER_CLEARANCE,
    solids::{BALLS, Balls, HandSolids, PreparedHand},
};

/// A ball inside a hand: the index of its solid in [`HandSolids::iter`], and where on its axis, from 0 to 1.
type Core = (usize, f32);

/// Solids of a digit, which come first in [`HandSolids::iter`].
const LINKS: usize = 3;

/// The balls that settle most, each the one that settled most of what those before it had left: of 32,203 pairs of hands
/// that meet, grips of the built-in objects by falling score beside recorded givers, these leave 2 %, …
const FIRST: [Core; BALLS] = [
    // The middle finger's first link, the thumb's second, the tips of ring and index finger, the palm below the little
    // finger, the little finger, the tips of middle finger and thumb.
    (6, 0.3),
    (1, 0.9),
    (11, 0.1),
    (5, 0.1),
    (22, 0.9),
    (13, 0.9),
    (8, 0.1),
    (2, 0.9),
];

/// … and these 2 in a thousand. What is left takes fifty times as long each.
const SECOND: [Core; BALLS] = [
    // The ball of the thumb, the first links of index, little and ring finger, the tips of middle and index finger, the
    // forearm, the tip of the little finger.
    (26, 0.9),
    (3, 0.9),
    (12, 0.7),
    (9, 0.9),
    (8, 0.9),
    (5, 0.9),
    (29, 0.7),
    (14, 0.9),
];

/// The first balls inside the hand of each grip.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Cores(Vec<Balls>);

impl Cores {
    /// Those of some hands.
    pub(super) fn of<'a>(hands: impl Iterator<Item = &'a HandSolids>) -> Self {
        Self(hands.map(|solids| balls(solids, &FIRST, [true; 5])).collect())
    }

    /// True only if one of those hands, whose solids are known, comes too near to the giver's; not always then.
    #[inline]
    pub(super) fn surely_meet(&self, hand: usize, solids: &HandSolids, giver: &PreparedHand) -> bool {
        // One in fifty that meet gets as far as the second ones, which are not kept for that.
        giver.surely_nears_any(&self.0[hand], GIVER_CLEARANCE)
            || giver.surely_nears_any(&balls(solids, &SECOND, [true; 5]), GIVER_CLEARANCE)
    }

    /// Bytes that they take in memory.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.0.as_slice())
    }
}

/// True only if one of some digits, palm or forearm of a hand comes nearer to the giver's than `distance` metres; not
/// always then.
pub(super) fn surely_nears(
    solids: &HandSolids,
    digits: [bool; 5],
    giver: &PreparedHand,
    distance: f32,
) -> bool {
    inner_balls(solids, digits)
        .iter()
        .any(|balls| giver.surely_nears_any(balls, distance))
}

/// Balls inside of some digits, palm and forearm, those first that settle most.
pub(super) fn inner_balls(solids: &HandSolids, digits: [bool; 5]) -> [Balls; 2] {
    [&FIRST, &SECOND].map(|cores| balls(solids, cores, digits))
}

/// The balls of some digits, palm and forearm; in place of the others' nothing that is near to anything.
#[inline]
fn balls(solids: &HandSolids, cores: &[Core; BALLS], digits: [bool; 5]) -> Balls {
    Balls::new(|i| {
        let (index, along) = cores[i];
        let solid = solids.solid(index);
        let counts = digits.get(index / LINKS).is_none_or(|&counts| counts);
        let radius = if counts {
            solid.radius_at(along)
        } else {
            f32::NEG_INFINITY
        };
        (solid.at(along), radius)
    })
}
