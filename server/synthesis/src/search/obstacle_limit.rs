//! Whether obstacles are what keeps a hand from an object, judged by grips that would hold it.
//!
//! Unlike the other limits it proves nothing: known grips are many, not all.

use super::{
    limits::{Limit, LimitKind},
    scene::Task,
    settings::SearchSettings,
};
use crate::{
    physical::{barriers::Barriers, grip::clear_of_barriers, scene::Presented},
    propose::surface_pairs::SurfacePair,
};

/// Share of the grips from which on obstacles are what is in the way.
const MOST: f32 = 0.5;

/// The limit that obstacles are, if they are in the way of most known grips that hold the object as its weight pulls; without known
/// grips, of all opposed places. Takes some microseconds for each grip.
pub fn obstacle_limit(task: Task<'_>, settings: &SearchSettings) -> Option<Limit> {
    let Task { holdout, object, rig } = task;
    let presented = Presented::of(holdout);
    let obstacles = Barriers {
        obstacles: presented.barriers().obstacles,
        ..Barriers::NONE
    };
    if obstacles.is_empty() {
        return None;
    }
    let atlas = settings.known.atlas.as_deref();
    let holding = atlas.map_or(&[][..], |atlas| atlas.holding_under(presented.up));
    let (blocked, all) = if let (Some(atlas), false) = (atlas, holding.is_empty()) {
        let is_blocked = |index: &&u16| {
            let solids = atlas.entries()[usize::from(**index)].tracked_solids(rig);
            clear_of_barriers(&solids, obstacles).is_none()
        };
        (holding.iter().filter(is_blocked).count(), holding.len())
    } else {
        let pairs = object.surface_pairs().pairs();
        let is_blocked = |pair: &&SurfacePair| !pair.is_free_of(obstacles);
        let blocked = pairs.iter().filter(is_blocked).count();
        (if blocked == pairs.len() { blocked } else { 0 }, pairs.len())
    };
    let share = blocked as f32 / all.max(1) as f32;
    (share > MOST).then_some(Limit {
        kind: LimitKind::Obstacle,
        value: share,
        bound: None,
    })
}
