//! What keeps a hand from an object, judged by grips that would hold it.
//!
//! Unlike the other limits, these prove nothing: known grips are many, not all.

use glam::Vec3;

use super::{
    limits::{Limit, LimitKind},
    scene::Task,
    settings::SearchSettings,
};
use crate::{
    known::entry::Entry,
    model::forces::GRAVITY,
    physical::{barriers::Barriers, grip::clear_of_barriers, scene::Presented},
    propose::surface_pairs::SurfacePair,
};

/// Share of the grips from which on obstacles are what is in the way.
const MOST: f32 = 0.5;

/// Most known grips that are compared with obstacles, evenly among all: enough to tell most from few, in some tenths of a millisecond.
const MAX_COMPARED: usize = 64;

/// Obstacles, if they are in the way of most known grips or, without any, of all opposed places; or else the weight's torque, if none of
/// the known grips resists it.
pub fn known_limit(task: Task<'_>, settings: &SearchSettings) -> Option<Limit> {
    let Task { holdout, object, rig } = task;
    let presented = Presented::of(holdout);
    let obstacles = Barriers {
        obstacles: presented.barriers().obstacles,
        ..Barriers::NONE
    };
    let atlas = settings.known.atlas.as_deref();
    let entries = atlas.map_or(&[][..], |atlas| atlas.entries());
    let stride = entries.len().div_ceil(MAX_COMPARED).max(1);
    let compared = || entries.iter().step_by(stride);
    let (blocked, all) = if entries.is_empty() {
        let pairs = object.surface_pairs().pairs();
        let is_blocked = |pair: &SurfacePair| !pair.is_free_of(obstacles);
        let all_blocked = !obstacles.is_empty() && pairs.iter().all(is_blocked);
        (usize::from(all_blocked && !pairs.is_empty()), 1)
    } else {
        let is_blocked = |entry: &&Entry| clear_of_barriers(&entry.tracked_solids(rig), obstacles).is_none();
        let blocked = if obstacles.is_empty() {
            0
        } else {
            compared().filter(is_blocked).count()
        };
        (blocked, compared().count())
    };
    let share = blocked as f32 / all as f32;
    if share > MOST {
        return Some(Limit {
            kind: LimitKind::Obstacle,
            value: share,
            bound: None,
        });
    }
    let holds_none = atlas.is_some_and(|atlas| atlas.holding_under(presented.up).is_empty());
    if !holds_none || entries.is_empty() {
        return None;
    }
    let arm = |entry: &Entry| {
        let sum: Vec3 = entry.contacts.iter().map(|contact| contact.position).sum();
        let offset = sum / entry.contacts.len().max(1) as f32 - holdout.object.centre_of_mass;
        offset
            .reject_from_normalized(presented.up.normalize_or(Vec3::Y))
            .length()
    };
    let least = entries.iter().map(arm).fold(f32::INFINITY, f32::min);
    Some(Limit {
        kind: LimitKind::Torque,
        value: holdout.object.mass * GRAVITY * least,
        bound: None,
    })
}
