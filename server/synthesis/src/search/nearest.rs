//! A valid grasp near a hand that is not one.

use std::time::Duration;

use super::{
    current::{CurrentGrasp, Grace, Settlement, settle},
    prepare,
    scene::Task,
    settings::SearchSettings,
};
use crate::{
    base::clock::Clock,
    model::{
        grasp::Grasp,
        hand::{HandPose, rig::Rig},
    },
    physical::grip::Gripper,
};

/// A valid grasp near a hand under `PHYSICAL` validity: the hand itself with digits closed or opened as little as it takes to touch,
/// or the known grip that would follow it as a current grasp. None if neither is valid, or at the time `until` of the clock.
pub fn nearest_grasp(
    task: Task<'_>,
    settings: &SearchSettings,
    from: &HandPose,
    clock: &dyn Clock,
    until: Option<Duration>,
) -> Option<Grasp> {
    let hand = within_limits(task.rig, from);
    let mut settings = settings.clone();
    settings.query.current = Some(CurrentGrasp {
        hand,
        present: hand,
        min_score_gain: None,
        is_committed: false,
        grace: Grace::default(),
    });
    let scene = prepare(task, &settings);
    let around = scene.surroundings()?;
    let mut gripper = Gripper::default();
    if let Ok(grasp) = around.hold_posed(&hand, &mut gripper) {
        return Some(*grasp);
    }
    match settle(&scene, &settings, clock, until)? {
        Settlement::Settled(settled) => settled.0.grasp,
        Settlement::Failed(_) | Settlement::OutOfTime => None,
    }
}

/// The hand with angles clamped to the rig's limits.
fn within_limits(rig: &Rig, pose: &HandPose) -> HandPose {
    HandPose {
        digits: std::array::from_fn(|digit| rig.digits[digit].limits.clamped(pose.digits[digit])),
        ..*pose
    }
}
