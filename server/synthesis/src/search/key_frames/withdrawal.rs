//! Where a hand withdraws to whose grasp is no longer valid.

use std::cell::Cell;

use glam::Vec3;

use super::{APPROACH_DISTANCE, OPENINGS, Planner, motion::Obstacles, moved};
use crate::{
    model::hand::HandPose,
    physical::{grip::GIVER_CLEARANCE, solids::comes_within},
    rating::assessment::GraspContext,
};

/// Largest number of hand poses checked: a tenth of what planning key frames may take, in some hundred microseconds.
const MAX_POSES_CHECKED: u32 = 200;

/// The opened hand, drawn back from where it is by [`APPROACH_DISTANCE`] against a direction of approach: the natural one if that
/// way is free, or else the first that is; or else the first that ends clear of everything; or else the natural one.
/// In the object's frame.
pub(in crate::search) fn withdrawal(around: &GraspContext<'_>, hand: &HandPose) -> HandPose {
    let planner = Planner {
        rig: around.rig,
        approach: around.requirements.approach,
        close: *hand,
        holding: [true; 5],
        obstacles: Obstacles {
            object: around.object.object,
            barriers: around.presented.barriers(),
            poses_left: Cell::new(MAX_POSES_CHECKED),
        },
    };
    let opened = planner.opened(OPENINGS[1], [true; 5]);
    let solids = planner.solids(&opened);
    let ends_clear = |back: Vec3| {
        let away = solids.moved(back);
        let surface = &around.object.object.surface;
        !planner
            .obstacles
            .barriers
            .comes_within(away.iter(), GIVER_CLEARANCE)
            && !away.hand.iter().any(|solid| comes_within(solid, surface, 0.0))
    };
    let mut end: Option<Vec3> = None;
    let mut natural: Option<Vec3> = None;
    for direction in planner.directions() {
        let back = direction * -APPROACH_DISTANCE;
        natural.get_or_insert(back);
        if ends_clear(back) {
            if planner.approach_is_free(&solids, direction) {
                return moved(&opened, back);
            }
            end.get_or_insert(back);
        }
    }
    moved(&opened, end.or(natural).unwrap_or_default())
}
