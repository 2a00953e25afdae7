//! Spheres inside a hand: whatever comes too close to one of them comes too close to the hand.

mod tables;

use tables::{FIRST, SECOND};

use crate::physical::solids::{HandSolids, SPHERES, Spheres};

/// A sphere inside a hand: the index of its solid in [`HandSolids::iter`], and its centre on the solid's
/// axis, from 0 to 1.
type InnerSphere = (usize, f32);

/// Solids per digit; the digits come first in [`HandSolids::iter`].
const LINKS: usize = 3;

/// The first inner spheres of a hand.
pub(super) fn first_spheres(solids: &HandSolids) -> Spheres {
    spheres(solids, &FIRST)
}

/// The second inner spheres of a hand.
pub(super) fn second_spheres(solids: &HandSolids) -> Spheres {
    spheres(solids, &SECOND)
}

/// The first spheres of some digits, palm and forearm; the others are replaced by spheres that are near
/// nothing.
pub(super) fn first_of_digits(first: Spheres, digits: [bool; 5]) -> Spheres {
    keep_digits(first, &FIRST, digits)
}

/// The same for the second spheres.
pub(super) fn second_of_digits(second: Spheres, digits: [bool; 5]) -> Spheres {
    keep_digits(second, &SECOND, digits)
}

/// Upper bounds of the distances of the fingers, from the index finger, and of thumb, palm and forearm
/// together, by the distances of the first spheres.
#[inline]
pub(super) fn upper_bounds_from_first(distances: &[f32; SPHERES]) -> ([f32; 4], f32) {
    upper_bounds(&FIRST, distances)
}

/// The same by the second spheres.
pub(super) fn upper_bounds_from_second(distances: &[f32; SPHERES]) -> ([f32; 4], f32) {
    upper_bounds(&SECOND, distances)
}

#[inline]
fn upper_bounds(inner_spheres: &[InnerSphere; SPHERES], distances: &[f32; SPHERES]) -> ([f32; 4], f32) {
    let (mut fingers, mut others) = ([f32::INFINITY; 4], f32::INFINITY);
    for (sphere, &distance) in inner_spheres.iter().zip(distances) {
        let digit = sphere.0 / LINKS;
        let owner = match digit.checked_sub(1) {
            Some(finger) if finger < fingers.len() => &mut fingers[finger],
            _ => &mut others,
        };
        *owner = owner.min(distance);
    }
    (fingers, others)
}

fn keep_digits(spheres: Spheres, inner_spheres: &[InnerSphere; SPHERES], digits: [bool; 5]) -> Spheres {
    spheres.kept(|i| {
        digits
            .get(inner_spheres[i].0 / LINKS)
            .is_none_or(|&counts| counts)
    })
}

#[inline]
fn spheres(solids: &HandSolids, inner_spheres: &[InnerSphere; SPHERES]) -> Spheres {
    Spheres::new(|i| {
        let (index, along) = inner_spheres[i];
        let solid = solids.solid(index);
        (solid.at(along), solid.radius_at(along))
    })
}
