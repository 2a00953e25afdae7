//! Where a hand comes closest to what it keeps clear of, for people to read: [`Barriers`](super::barriers::Barriers) decide, and
//! these are the same distances with what they are between.

use std::fmt;

use glam::Vec3;

use super::{
    barriers::CLOSER_TO_OBSTACLES,
    scene::Presented,
    solids::{SolidPart, TaperedCapsule, TrackedSolids, closest},
};
use crate::model::holdout::{HandShape, Holdout};

/// Something to keep clear of, by its place in the holdout; displayed as the field of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Barrier {
    /// The giver's hand.
    PresentingHand,
    /// One of the further hands.
    OtherHand(usize),
    /// One of the obstacles.
    Obstacle(usize),
}

impl fmt::Display for Barrier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PresentingHand => f.write_str("holdout.presenting_hand"),
            Self::OtherHand(place) => write!(f, "holdout.other_hands[{place}]"),
            Self::Obstacle(place) => write!(f, "holdout.obstacles[{place}]"),
        }
    }
}

/// The smallest distance of a hand from some barriers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// In metres, negative inside.
    pub distance: f32,
    /// The part of the hand that is nearest.
    pub part: SolidPart,
    /// A point there: of the hand's skin or, with the mesh of a hand, of that, in the object's frame.
    pub at: Vec3,
    /// What it is nearest to.
    pub barrier: Barrier,
}

/// The nearest of the holdout's hands; `None` without any. `presented` must be the holdout's.
pub(crate) fn nearest_hand(
    hand: &TrackedSolids,
    holdout: &Holdout,
    presented: &Presented,
) -> Option<Nearest> {
    let presenting = holdout.presenting_hand.as_ref();
    let presenting = presenting.map(|giver| (Barrier::PresentingHand, &giver.shape));
    let others = holdout.other_hands.iter().enumerate();
    let others = others.map(|(place, shape)| (Barrier::OtherHand(place), shape));
    let shapes = presenting.into_iter().chain(others);
    let prepared = presented.giver.iter().chain(&presented.other_hands);
    let mut nearest: Option<Nearest> = None;
    for ((barrier, shape), prepared) in shapes.zip(prepared) {
        for (part, solid) in hand.parts() {
            let least = nearest.map_or(f32::INFINITY, |nearest| nearest.distance);
            let found = match shape {
                HandShape::Mesh(mesh) => {
                    closest(solid, &mesh.surface, least).map(|touch| (touch.clearance, touch.point))
                }
                HandShape::Joints(_) => prepared
                    .least_distance(std::iter::once(solid), least, f32::NEG_INFINITY)
                    .filter(|&distance| distance < least)
                    .map(|distance| (distance, skin_toward_hand(solid, prepared.iter()))),
            };
            if let Some((distance, at)) = found.filter(|&(distance, _)| distance < least) {
                nearest = Some(Nearest {
                    distance,
                    part,
                    at,
                    barrier,
                });
            }
        }
    }
    nearest
}

/// The nearest obstacle; `None` without any.
pub(crate) fn nearest_obstacle(hand: &TrackedSolids, presented: &Presented) -> Option<Nearest> {
    let mut nearest: Option<Nearest> = None;
    for (place, obstacle) in presented.obstacles.iter().enumerate() {
        for (part, solid) in hand.parts() {
            let distance = obstacle.distance(solid) - CLOSER_TO_OBSTACLES;
            if nearest.is_none_or(|nearest| distance < nearest.distance) {
                nearest = Some(Nearest {
                    distance,
                    part,
                    at: solid.skin_toward(
                        |point| obstacle.point_distance(point),
                        |point| obstacle.outward(point),
                    ),
                    barrier: Barrier::Obstacle(place),
                });
            }
        }
    }
    nearest
}

/// The point of a solid's skin nearest to a hand's solids.
fn skin_toward_hand<'a>(solid: &TaperedCapsule, hand: impl Iterator<Item = &'a TaperedCapsule>) -> Vec3 {
    let nearest = hand.min_by(|a, b| solid.distance(a).total_cmp(&solid.distance(b)));
    nearest.map_or_else(|| solid.at(0.5), |their| skin_toward_solid(solid, their))
}

/// The point of a solid's skin nearest to another solid.
pub(crate) fn skin_toward_solid(solid: &TaperedCapsule, other: &TaperedCapsule) -> Vec3 {
    solid.skin_toward(|point| other.signed_distance(point), |point| other.outward(point))
}
