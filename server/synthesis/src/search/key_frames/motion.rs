//! Is a motion of the hand free, all of it?
//!
//! A part of the motion is free of the object if at its middle every solid is farther from the object than any of its
//! points travels from there to the part's ends; a part that is not is halved (interval halving on the bound of
//! conservative advancement: B. Mirtich, "Timewarp Rigid Body Simulation", 2000).

use std::cell::Cell;

use crate::{
    model::object::GraspObject,
    physical::solids::{HandSolids, PreparedHand, TaperedCapsule, TrackedSolids},
};

/// A part of a motion is not halved when nothing travels farther than this in half of it, in metres: what is found free
/// is so to this. Less costs time where a hand passes close by.
const RESOLUTION: f32 = 0.0001;

/// How much farther an obstacle may be than is sure, in metres: so much that it is hardly worth a look whether all of a
/// longer part is free. Less halves parts that are, more looks at obstacles in vain.
const NEAR: f32 = 0.008;

/// What a moving hand may meet.
#[derive(Debug)]
pub(super) struct Obstacles<'a> {
    /// The object.
    pub object: &'a GraspObject,
    /// The giver's hand, in the object's frame.
    pub giver: Option<&'a PreparedHand>,
    /// How many more times a hand may be looked at until it counts as blocked: what bounds the time of hopeless cases.
    pub looks_left: Cell<u32>,
}

/// What a moving hand keeps to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keep {
    /// Least distance to the object's surface in metres; negative, how deep the hand may sink. Forbidden surfaces are
    /// never touched.
    pub object: f32,
    /// Least distance to the giver's hand and forearm in metres.
    pub giver: f32,
}

/// A motion of a hand that starts outside of the object.
pub(super) struct Motion<F> {
    /// The hand at a share of the motion, from 0 to 1.
    pub solids_at: F,
    /// Metres that any point of each solid travels at most, in the order of [`TrackedSolids::iter`].
    pub travels: Vec<f32>,
}

/// What is known of a part of a motion, of which the middle was looked at.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Free,
    Blocked,
    /// The halves may be either.
    Open,
}

impl<F: Fn(f32) -> TrackedSolids> Motion<F> {
    /// True if the motion keeps to what it should.
    pub(super) fn is_free(&self, obstacles: &Obstacles<'_>, keep: Keep) -> bool {
        // What does not move is where it is in the grasp.
        let moving = self
            .travels
            .iter()
            .enumerate()
            .filter(|(_, travel)| **travel > 0.0);
        let open = moving.fold(0, |open, (place, _)| open | 1 << place);
        // Beside the object, the hand is what comes first of its solids.
        let beside_object = open & ((1 << HandSolids::COUNT) - 1);
        let beside_giver = if obstacles.giver.is_some() { open } else { 0 };
        self.is_part_free(obstacles, keep, [0.0, 1.0], [beside_object, beside_giver])
    }

    /// The same for a part. `open` has a bit for each solid that may meet the object in it, and for each that may meet the
    /// giver.
    fn is_part_free(
        &self,
        obstacles: &Obstacles<'_>,
        keep: Keep,
        [from, to]: [f32; 2],
        open: [u64; 2],
    ) -> bool {
        let Some(looks_left) = obstacles.looks_left.get().checked_sub(1) else {
            return false;
        };
        obstacles.looks_left.set(looks_left);
        let middle = 0.5 * (from + to);
        let half = 0.5 * (to - from);
        let mut still_open = [0; 2];
        let solids = (self.solids_at)(middle);
        for (place, (solid, travel)) in solids.iter().zip(&self.travels).enumerate() {
            let travel = half * travel;
            for against in 0..2 {
                if open[against] >> place & 1 == 0 {
                    continue;
                }
                let part = match (obstacles.giver, against) {
                    (Some(giver), 1) => beside_giver(giver, solid, keep.giver, travel),
                    _ => beside_object(obstacles, solids.hand.solid(place), keep.object, travel),
                };
                match part {
                    Part::Free => {}
                    Part::Blocked => return false,
                    Part::Open => still_open[against] |= 1 << place,
                }
            }
        }
        still_open == [0; 2]
            || [[from, middle], [middle, to]]
                .into_iter()
                .all(|part| self.is_part_free(obstacles, keep, part, still_open))
    }
}

/// Is a solid free of the giver's hand that travels `travel` metres from where it is?
fn beside_giver(giver: &PreparedHand, solid: &TaperedCapsule, least: f32, travel: f32) -> Part {
    giver
        .least_distance([solid].into_iter(), least + travel, least)
        .map_or(Part::Blocked, |distance| settle(distance, least, travel))
}

/// Is a solid free of the object that travels `travel` metres from where it is?
fn beside_object(obstacles: &Obstacles<'_>, solid: &TaperedCapsule, least: f32, travel: f32) -> Part {
    let object = obstacles.object;
    let surface = &object.surface;
    let sure = surface.gap_lower_bound(solid) - least;
    if sure >= travel {
        return Part::Free;
    }
    if sure >= 0.0 && travel > sure + NEAR {
        return Part::Open;
    }
    let enough = least + travel.min(sure.max(0.0) + NEAR);
    let gap = surface
        .closest_to_capsule(solid, enough)
        .map_or(enough, |gap| gap.gap);
    let part = settle(gap, least, travel);
    // A part that is halved is looked at again.
    if part == Part::Free && gap < travel && object.is_forbidden_within(solid, travel) {
        return if travel > RESOLUTION {
            Part::Open
        } else {
            Part::Blocked
        };
    }
    part
}

/// What a distance in the middle of a part says about it, if it may shrink by `travel` on the way to the ends.
fn settle(distance: f32, least: f32, travel: f32) -> Part {
    if distance < least {
        Part::Blocked
    } else if distance >= least + travel || travel <= RESOLUTION {
        Part::Free
    } else {
        Part::Open
    }
}
