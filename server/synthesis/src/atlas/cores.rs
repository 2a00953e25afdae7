//! Balls inside a hand: what they come too near to, the hand does.

use crate::physical::solids::{BALLS, Balls, HandSolids};

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

/// The first balls inside a hand.
pub(super) fn first_balls(solids: &HandSolids) -> Balls {
    balls(solids, &FIRST)
}

/// The second ones.
pub(super) fn second_balls(solids: &HandSolids) -> Balls {
    balls(solids, &SECOND)
}

/// Of first balls, those of some digits, palm and forearm; in place of the others nothing that is near to anything.
pub(super) fn first_of_digits(first: Balls, digits: [bool; 5]) -> Balls {
    of_digits(first, &FIRST, digits)
}

/// Of second ones, likewise.
pub(super) fn second_of_digits(second: Balls, digits: [bool; 5]) -> Balls {
    of_digits(second, &SECOND, digits)
}

fn of_digits(balls: Balls, cores: &[Core; BALLS], digits: [bool; 5]) -> Balls {
    balls.kept(|i| digits.get(cores[i].0 / LINKS).is_none_or(|&counts| counts))
}

#[inline]
fn balls(solids: &HandSolids, cores: &[Core; BALLS]) -> Balls {
    Balls::new(|i| {
        let (index, along) = cores[i];
        let solid = solids.solid(index);
        (solid.at(along), solid.radius_at(along))
    })
}
