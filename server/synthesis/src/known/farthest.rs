//! Selects, of grips moved to an object, those that are farthest from a holdout's barriers.

use std::cmp::Reverse;

use super::{entry::Entry, seeds::nanometres};
use crate::{
    model::requirements::Requirements,
    physical::{barriers::Barriers, grip::GIVER_CLEARANCE},
};

/// Largest number of grips selected for a holdout, the ones farthest from its barriers by inner spheres. Fewer
/// answer fewer givers, more delay answers.
const MAX_SELECTED: usize = 96;

/// Grips compared with one giver by inner spheres between two clock checks.
const BOUNDS_PER_CHECK: usize = 128;

/// Grips moved to the object between two clock checks.
const MOVES_PER_CHECK: usize = 32;

/// The grips that meet the requirements and are farthest from the barriers, moved to the object by `entry`; the first ones win
/// ties. `clearance` bounds the distance from the barriers from above, in metres. None if interrupted.
pub(super) fn farthest<T: Copy>(
    candidates: impl Iterator<Item = T>,
    clearance: impl Fn(T) -> f32,
    entry: impl Fn(T) -> Entry,
    (barriers, requirements): (Barriers<'_>, &Requirements),
    interrupted: &impl Fn() -> bool,
) -> Option<Vec<Entry>> {
    let bounds_per_check = barriers.comparisons_per_check(BOUNDS_PER_CHECK);
    let mut by_clearance: Vec<(Reverse<i32>, usize, T)> = Vec::new();
    for (place, candidate) in candidates.enumerate() {
        if place.is_multiple_of(bounds_per_check) && interrupted() {
            return None;
        }
        let clearance = if barriers.is_empty() {
            GIVER_CLEARANCE
        } else {
            clearance(candidate)
        };
        by_clearance.push((
            Reverse(nanometres(clearance.min(GIVER_CLEARANCE))),
            place,
            candidate,
        ));
    }
    by_clearance.sort_unstable_by_key(|&(clearance, place, _)| (clearance, place));
    let mut entries = Vec::with_capacity(MAX_SELECTED);
    for (count, (_, _, candidate)) in by_clearance.into_iter().enumerate() {
        if entries.len() == MAX_SELECTED {
            break;
        }
        if count.is_multiple_of(MOVES_PER_CHECK) && interrupted() {
            return None;
        }
        let entry = entry(candidate);
        if entry.meets(requirements) {
            entries.push(entry);
        }
    }
    Some(entries)
}
