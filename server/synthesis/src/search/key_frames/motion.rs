//! Continuous collision checks of a hand's motion.
//!
//! A part of the motion is free if, at its midpoint, every solid is farther from all obstacles than any of its points travels from
//! there to the part's ends; a part that is undecided is halved (interval halving on the bound of conservative advancement:
//! B. Mirtich, "Timewarp Rigid Body Simulation", 2000).

use std::cell::Cell;

use super::BARRIER_CLEARANCE;
use crate::{
    model::object::GraspObject,
    physical::{
        barriers::Barriers,
        solids::{HandSolids, TaperedCapsule, TrackedSolids},
    },
};

/// A part is not halved further if nothing travels farther than this in half of it, in metres: the accuracy of the check.
const RESOLUTION: f32 = 0.0001;

/// Search distance beyond the known lower bound of an obstacle's distance, in metres.
const LOOKAHEAD: f32 = 0.008;

/// The obstacles of a moving hand: object, barriers and itself.
#[derive(Debug)]
pub(super) struct Obstacles<'a> {
    pub(super) object: &'a GraspObject,
    pub(super) barriers: Barriers<'a>,
    /// Hand poses that may still be checked before the motion counts as blocked, to limit hopeless cases.
    pub(super) poses_left: Cell<u32>,
}

pub(super) struct Motion<F> {
    /// The hand at a fraction of the motion, from 0 to 1.
    pub(super) solids_at: F,
    /// Upper bound, in metres, of the travel of any point of each solid, in the order of [`TrackedSolids::iter`].
    pub(super) travels: Vec<f32>,
}

/// The result of checking a part of a motion at its midpoint.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Free,
    Blocked,
    /// The halves have to be checked.
    Undecided,
}

impl<F: Fn(f32) -> TrackedSolids> Motion<F> {
    /// True if the motion keeps the clearances: that of the object, in metres, negative for the largest depth, and
    /// [`BARRIER_CLEARANCE`]. Forbidden surfaces are never touched.
    pub(super) fn is_free(&self, obstacles: &Obstacles<'_>, clearance: f32) -> bool {
        // Solids that do not move stay where they are in the grasp.
        let moving = self
            .travels
            .iter()
            .enumerate()
            .filter(|(_, travel)| **travel > 0.0);
        let undecided = moving.fold(0, |undecided, (place, _)| undecided | 1 << place);
        // The hand's own solids come first; only they are compared with the object.
        let against_object = undecided & ((1 << HandSolids::COUNT) - 1);
        let against_barriers = if obstacles.barriers.is_empty() {
            0
        } else {
            undecided
        };
        self.is_part_free(
            obstacles,
            clearance,
            [0.0, 1.0],
            [against_object, against_barriers],
        )
    }

    fn is_part_free(
        &self,
        obstacles: &Obstacles<'_>,
        clearance: f32,
        [from, to]: [f32; 2],
        undecided: [u64; 2],
    ) -> bool {
        let Some(poses_left) = obstacles.poses_left.get().checked_sub(1) else {
            return false;
        };
        obstacles.poses_left.set(poses_left);
        let middle = 0.5 * (from + to);
        let half = 0.5 * (to - from);
        let mut still_undecided = [0; 2];
        let solids = (self.solids_at)(middle);
        for (place, (solid, travel)) in solids.iter().zip(&self.travels).enumerate() {
            let travel = half * travel;
            for against in 0..2 {
                if undecided[against] >> place & 1 == 0 {
                    continue;
                }
                let verdict = if against == 0 {
                    against_object(obstacles, solids.hand.solid(place), clearance, travel)
                } else {
                    against_barriers(obstacles.barriers, solid, travel)
                };
                match verdict {
                    Verdict::Free => {}
                    Verdict::Blocked => return false,
                    Verdict::Undecided => still_undecided[against] |= 1 << place,
                }
            }
        }
        still_undecided == [0; 2]
            || [[from, middle], [middle, to]]
                .into_iter()
                .all(|part| self.is_part_free(obstacles, clearance, part, still_undecided))
    }
}

/// Checks a solid that travels up to `travel` metres against the barriers.
fn against_barriers(barriers: Barriers<'_>, solid: &TaperedCapsule, travel: f32) -> Verdict {
    let least = BARRIER_CLEARANCE;
    barriers
        .least_distance([solid].into_iter(), least + travel, least)
        .map_or(Verdict::Blocked, |distance| classify(distance, least, travel))
}

/// Checks a solid that travels up to `travel` metres against the object.
fn against_object(obstacles: &Obstacles<'_>, solid: &TaperedCapsule, clearance: f32, travel: f32) -> Verdict {
    let object = obstacles.object;
    let surface = &object.surface;
    let lower_bound = surface.gap_lower_bound(solid) - clearance;
    if lower_bound >= travel {
        return Verdict::Free;
    }
    if lower_bound >= 0.0 && travel > lower_bound + LOOKAHEAD {
        return Verdict::Undecided;
    }
    let search_distance = clearance + travel.min(lower_bound.max(0.0) + LOOKAHEAD);
    let gap = surface
        .closest_to_capsule(solid, search_distance)
        .map_or(search_distance, |gap| gap.gap);
    let verdict = classify(gap, clearance, travel);
    // A part that is halved is checked again.
    if verdict == Verdict::Free && gap < travel && object.is_forbidden_within(solid, travel) {
        return if travel > RESOLUTION {
            Verdict::Undecided
        } else {
            Verdict::Blocked
        };
    }
    verdict
}

/// Classifies a part by the distance at its midpoint, which may shrink by `travel` toward the ends.
fn classify(distance: f32, clearance: f32, travel: f32) -> Verdict {
    if distance < clearance {
        Verdict::Blocked
    } else if distance >= clearance + travel || travel <= RESOLUTION {
        Verdict::Free
    } else {
        Verdict::Undecided
    }
}
