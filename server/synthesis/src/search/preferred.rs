//! Why preferred hands are not answered.

use super::{
    current::{FailedCheck, held},
    reading::Reading,
    scene::Task,
    settings::SearchSettings,
};
use crate::{
    model::hand::HandPose,
    physical::{
        grip::{Gripper, PosedDigits},
        scene::{ObjectScene, Presented},
    },
    rating::assessment::GraspContext,
};

/// The first `count` preferred hands of the settings that are not valid, by their places, and why: the first check that each fails
/// with its digits closed or opened as little as it takes to touch. Takes some tens of microseconds for each.
pub fn passed_over(task: Task<'_>, settings: &SearchSettings, count: usize) -> Vec<(usize, FailedCheck)> {
    let Task { holdout, rig, .. } = task;
    let query = &settings.query;
    let hands = settings.known.preferred.iter().take(count);
    if hands.len() == 0 || !query.uses_known_grips() {
        return Vec::new();
    }
    let presented = Presented::of(holdout);
    let alone = presented.without_barriers();
    let around = GraspContext {
        object: ObjectScene::new(&holdout.object, query.friction_on(&holdout.object)),
        presented: &presented,
        rig,
        requirements: &query.requirements,
    };
    let mut gripper = Gripper::default();
    let failed = |hand: &HandPose, gripper: &mut Gripper| {
        let closed = gripper.hold_posed(&around.object, rig, hand, &alone, PosedDigits::Settled);
        let pose = closed.map_or(*hand, |(grip, _)| grip.pose);
        held(&Reading::new(around, holdout, &pose), 0.0, gripper).err()
    };
    let failures = hands.enumerate();
    failures
        .filter_map(|(place, hand)| Some((place, failed(hand, &mut gripper)?)))
        .collect()
}
