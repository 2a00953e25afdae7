//! Balls inside a hand: what they come too near to, the hand does.

use super::finger_subsets::InWay;
use crate::physical::solids::{HandSolids, SPHERES, Spheres};

/// A ball inside a hand: the index of its solid in [`HandSolids::iter`], and where on its axis, from 0 to 1.
type InnerSpheres = (usize, f32);

/// Solids of a digit, which come first in [`HandSolids::iter`].
const LINKS: usize = 3;

/// The balls that settle most, each the one that settled most of what those before it had left: of 32,203 pairs of hands
/// that meet, grips of the built-in objects by falling score beside recorded givers, these leave 2 %, …
const FIRST: [InnerSpheres; SPHERES] = [
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
const SECOND: [InnerSpheres; SPHERES] = [
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
pub(super) fn first_spheres(solids: &HandSolids) -> Spheres {
    spheres(solids, &FIRST)
}

/// The second ones.
pub(super) fn second_spheres(solids: &HandSolids) -> Spheres {
    spheres(solids, &SECOND)
}

/// Of first balls, those of some digits, palm and forearm; in place of the others nothing that is near to anything.
pub(super) fn first_of_digits(first: Spheres, digits: [bool; 5]) -> Spheres {
    of_digits(first, &FIRST, digits)
}

/// Of second ones, likewise.
pub(super) fn second_of_digits(second: Spheres, digits: [bool; 5]) -> Spheres {
    of_digits(second, &SECOND, digits)
}

/// How far fingers, from the index finger on, and what cannot be spared are at most, by the distances of the first balls.
#[inline]
pub(super) fn farthest_by_first(distances: &[f32; SPHERES]) -> ([f32; 4], f32) {
    by_owner(&FIRST, distances)
}

/// The same by those of the second ones.
pub(super) fn farthest_by_second(distances: &[f32; SPHERES]) -> ([f32; 4], f32) {
    by_owner(&SECOND, distances)
}

#[inline]
fn by_owner(inner_spheres: &[InnerSpheres; SPHERES], distances: &[f32; SPHERES]) -> ([f32; 4], f32) {
    let (mut fingers, mut others) = ([f32::INFINITY; 4], f32::INFINITY);
    for (core, &distance) in inner_spheres.iter().zip(distances) {
        let digit = core.0 / LINKS;
        let owner = match digit.checked_sub(1) {
            Some(finger) if finger < fingers.len() => &mut fingers[finger],
            _ => &mut others,
        };
        *owner = owner.min(distance);
    }
    (fingers, others)
}

/// What a giver is in the way of who is near to some of the first balls, a bit each.
#[inline]
pub(super) fn in_way_by_first(near: u8) -> InWay {
    OF_FIRST[usize::from(near)]
}

/// The same of the second ones.
#[inline]
pub(super) fn in_way_by_second(near: u8) -> InWay {
    OF_SECOND[usize::from(near)]
}

/// For any of the first balls, looked up: it is asked for every grip.
static OF_FIRST: [InWay; 1 << SPHERES] = in_way_of(&FIRST);

static OF_SECOND: [InWay; 1 << SPHERES] = in_way_of(&SECOND);

const fn in_way_of(inner_spheres: &[InnerSpheres; SPHERES]) -> [InWay; 1 << SPHERES] {
    let mut in_way = [InWay::NOTHING; 1 << SPHERES];
    let mut near = 0;
    while near < in_way.len() {
        let mut ball = 0;
        while ball < SPHERES {
            if near >> ball & 1 == 1 {
                in_way[near] = in_way[near].and_of(inner_spheres[ball].0 / LINKS);
            }
            ball += 1;
        }
        near += 1;
    }
    in_way
}

fn of_digits(spheres: Spheres, inner_spheres: &[InnerSpheres; SPHERES], digits: [bool; 5]) -> Spheres {
    spheres.kept(|i| {
        digits
            .get(inner_spheres[i].0 / LINKS)
            .is_none_or(|&counts| counts)
    })
}

#[inline]
fn spheres(solids: &HandSolids, inner_spheres: &[InnerSpheres; SPHERES]) -> Spheres {
    Spheres::new(|i| {
        let (index, along) = inner_spheres[i];
        let solid = solids.solid(index);
        (solid.at(along), solid.radius_at(along))
    })
}
