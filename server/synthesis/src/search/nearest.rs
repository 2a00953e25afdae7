//! A valid grasp near a hand that is not one.

use super::{
    current::{CurrentGrasp, Grace, Settlement, settle},
    prepare,
    scene::Task,
    settings::SearchSettings,
};
use crate::{
    base::stop::Stop,
    model::{
        grasp::Grasp,
        hand::{HandPose, rig::Rig},
    },
    physical::grip::Gripper,
};

/// A valid grasp near a hand under `PHYSICAL` validity: the hand itself with digits closed or opened as little as it takes to touch,
/// or the known grip that would follow it as a current grasp. None if neither is valid, or once `stop` says so.
pub fn nearest_grasp(
    task: Task<'_>,
    settings: &SearchSettings,
    from: &HandPose,
    stop: Stop<'_>,
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
    match settle(&scene, &settings, stop)? {
        Settlement::Settled(settled) => settled.0.grasp,
        Settlement::Failed(_) | Settlement::Stopped => None,
    }
}

/// The hand with angles clamped to the rig's limits.
fn within_limits(rig: &Rig, pose: &HandPose) -> HandPose {
    HandPose {
        digits: std::array::from_fn(|digit| rig.digits[digit].limits.clamped(pose.digits[digit])),
        ..*pose
    }
}
