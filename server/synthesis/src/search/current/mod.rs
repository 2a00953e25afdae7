//! The current grasp: the hand that a character holds on to from one request to the next.
//!
//! Between two requests, giver and object have moved a little. The answer is the first of these that is valid:
//!
//! 1. The current grasp as it is, by every check of `PHYSICAL` validity ([`CurrentGraspStatus::Kept`]).
//! 2. The current grasp with digits moved away from a barrier ([`closer`](crate::physical::closer)).
//! 3. The nearest known grip (`replan`), or else the nearest grasp that attempts find (`nearness`).
//!
//! A committed hand is never replaced: it withdraws.

mod failed_check;
mod replan;
mod way;

use replan::{Kept, Known, Replanner};

use super::{
    GraspSource, SearchOutcome,
    key_frames::withdrawal,
    known_grips::grasp_value,
    scene::{Scene, Task},
    settings::SearchSettings,
};
use crate::{
    base::stop::{Stop, Stopped},
    model::{grasp::Grasp, hand::HandPose, requirements::Check},
    physical::{
        closer::{Evaded, evade},
        grip::Gripper,
        solids::{HandSolids, TrackedSolids},
    },
};

pub use failed_check::{FailedCheck, no_grasp_reason, passed_over};
pub use way::{HandWay, METRES_PER_RADIAN};

pub(super) use way::RecentHands;

/// Longest way of a grasp that ends the search, as [`HandWay::length`] counts it: a small correction of the hand. More ends more
/// searches early, with jumps.
const AT_HAND: f32 = 0.05;

/// A grasp to hold on to. Everything is in the object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentGrasp {
    /// Hand of the grasp.
    pub hand: HandPose,
    /// The receiver's present hand, from where ways are measured.
    pub present: HandPose,
    /// How much higher a known grip must score to replace a valid current grasp; `None` if nothing replaces it.
    pub min_score_gain: Option<f32>,
    /// True if the hand is closing, so that nothing replaces it.
    pub is_committed: bool,
    /// How much too close to other people's hands it may be.
    pub grace: Grace,
}

/// How much closer to other people's hands a current grasp may be than a valid one, in metres: hand tracking is noisy and drops
/// out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grace {
    /// In any case.
    pub always: f32,
    /// If no known grip can follow it that keeps clear of the recent hands, unless it is committed.
    pub alone: f32,
}

/// Outcome for a current grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentGraspStatus {
    /// It is the answer.
    Kept,
    /// It is the answer with some digits moved that it does not need.
    Adjusted,
    /// Another grasp is the answer.
    Replanned,
    /// There is no answer.
    None,
    /// It was committed and is not valid.
    Aborted,
}

/// Outcome for a current grasp, and how far the answer is from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentGraspVerdict {
    /// The outcome.
    pub status: CurrentGraspStatus,
    /// Why it was not kept as it is, or is kept by its grace only.
    pub failed_check: Option<FailedCheck>,
    /// Why there is no grasp.
    pub no_grasp: Option<Check>,
    /// The digits that were moved, thumb first.
    pub moved: [bool; 5],
    /// The way from the present hand to the answer.
    pub way: Option<HandWay>,
    /// Pose to which an aborted hand withdraws.
    pub withdrawal: Option<HandPose>,
}

impl CurrentGraspVerdict {
    fn new(status: CurrentGraspStatus, failed_check: Option<FailedCheck>) -> Self {
        Self {
            status,
            failed_check,
            no_grasp: None,
            moved: [false; 5],
            way: None,
            withdrawal: None,
        }
    }

    /// The verdict on a grasp that is not kept, after a search with the same scene. Without a way if the answer is of another hand.
    pub fn after_search(
        scene: &Scene<'_>,
        failed: Option<FailedCheck>,
        outcome: &SearchOutcome,
        is_same_hand: bool,
    ) -> Self {
        let Some(grasp) = &outcome.grasp else {
            return Self::new(CurrentGraspStatus::None, failed);
        };
        let present = scene.current().map(|current| current.present);
        Self {
            way: present
                .filter(|_| is_same_hand)
                .map(|present| HandWay::between(scene, &present, &grasp.pose)),
            ..Self::new(CurrentGraspStatus::Replanned, failed)
        }
    }
}

/// The result of looking at a current grasp and known grips.
#[derive(Clone, Debug)]
pub enum Settlement {
    /// The answer, without a search.
    Settled(Box<(SearchOutcome, CurrentGraspVerdict)>),
    /// The grasp failed a check, and no known grip is valid.
    Failed(FailedCheck),
    /// It was stopped before it was decided.
    Stopped,
}

/// The nearness of a grasp to the present hand, more than any score.
pub(super) fn nearness(scene: &Scene<'_>, current: &CurrentGrasp, grasp: &Grasp) -> f32 {
    1.0 + (1.0 + way_of(scene, current, grasp)).recip()
}

pub(super) fn is_at_hand(scene: &Scene<'_>, current: &CurrentGrasp, grasp: &Grasp) -> bool {
    way_of(scene, current, grasp) <= AT_HAND
}

/// The way to a grasp, in metres; longer where other people's hands were lately.
fn way_of(scene: &Scene<'_>, current: &CurrentGrasp, grasp: &Grasp) -> f32 {
    let (present, to) = (current.present.frame_from_wrist, grasp.pose.frame_from_wrist);
    let lack = scene.recent_hands().map_or(0.0, |recent| {
        let solids = HandSolids::of_pose(scene.task.rig, &grasp.pose);
        recent.lack(&TrackedSolids::of_rig(scene.task.rig, to, &solids))
    });
    way::WristWay::between(present, to).length() + lack
}

/// Decides about the current grasp of `settings` and, if it failed a check, looks for a known grip to follow it, until `stop`. The
/// scene must have been prepared with the same settings. `None` without a current grasp or `PHYSICAL` validity.
pub fn settle(scene: &Scene<'_>, settings: &SearchSettings, stop: Stop<'_>) -> Option<Settlement> {
    let current = scene.current()?;
    let around = scene.surroundings()?;
    let replanner = Replanner::new(scene, settings, &around, current);
    Some(decide(&replanner, stop).unwrap_or(Settlement::Stopped))
}

fn decide(replanner: &Replanner<'_>, stop: Stop<'_>) -> Result<Settlement, Stopped> {
    let Replanner { around, current, .. } = *replanner;
    let mut gripper = Gripper::default();
    // A known grip has stored data that need not be found again.
    let kept = match replanner.of_known_hand(&current.hand, &mut gripper) {
        Some(grasp) => Ok((grasp, CurrentGraspVerdict::new(CurrentGraspStatus::Kept, None))),
        None => kept(replanner, &mut gripper),
    };
    let (grasp, verdict) = match kept {
        Ok(kept) => kept,
        Err(failed) if current.is_committed => {
            let verdict = CurrentGraspVerdict {
                withdrawal: Some(withdrawal(around, &current.present)),
                ..CurrentGraspVerdict::new(CurrentGraspStatus::Aborted, Some(failed))
            };
            return Ok(Settlement::Settled(Box::new((replanner.outcome(None), verdict))));
        }
        Err(failed) => {
            let replanned = CurrentGraspVerdict::new(CurrentGraspStatus::Replanned, Some(failed));
            match replanner.nearest(&mut gripper, stop)? {
                Some(known) if known.lack <= 0.0 => return Ok(replanner.settled(known, replanned)),
                known => {
                    let Some(kept) = replanner.kept_by(current.grace.alone, failed, &mut gripper) else {
                        let settled = known.map(|known| replanner.settled(known, replanned));
                        return Ok(settled.unwrap_or(Settlement::Failed(failed)));
                    };
                    kept
                }
            }
        }
    };
    if let Some(min_score_gain) = current.min_score_gain
        && !current.is_committed
    {
        let value = grasp_value(&grasp);
        if let Some(better) = replanner.best(value + min_score_gain, &mut gripper, stop)? {
            let failed = FailedCheck {
                check: Check::Score,
                figure: Some(grasp_value(&better.grasp) - value),
                bound: Some(min_score_gain),
            };
            let verdict = CurrentGraspVerdict::new(CurrentGraspStatus::Replanned, Some(failed));
            return Ok(replanner.settled(better, verdict));
        }
    }
    let kept = Known {
        source: GraspSource::Current,
        grasp,
        lack: 0.0,
    };
    Ok(replanner.settled(kept, verdict))
}

/// The unchanged current grasp, the one kept by its grace, or the one with digits moved off a barrier.
fn kept(replanner: &Replanner<'_>, gripper: &mut Gripper) -> Result<Kept, FailedCheck> {
    let Replanner { around, current, .. } = *replanner;
    let new = CurrentGraspVerdict::new;
    let failed = match replanner.hold(&current.hand, 0.0, gripper) {
        Ok(grasp) => return Ok((grasp, new(CurrentGraspStatus::Kept, None))),
        Err(failed) => failed,
    };
    if let Some(kept) = replanner.kept_by(current.grace.always, failed, gripper) {
        return Ok(kept);
    }
    if let Check::GiverClearance | Check::ObstacleClearance = failed.check
        && let Some(Evaded { pose, moved }) = evade(
            &around.object,
            around.rig,
            &current.hand,
            around.presented.barriers(),
        )
        && let Ok(grasp) = replanner.hold(&pose, 0.0, gripper)
    {
        let adjusted = new(CurrentGraspStatus::Adjusted, Some(failed));
        return Ok((grasp, CurrentGraspVerdict { moved, ..adjusted }));
    }
    Err(failed)
}

/// A valid grasp near a hand under `PHYSICAL` validity: the hand itself with its digits just touching, or the known grip that would
/// follow it as a current grasp. `None` if neither is valid, or once stopped.
pub fn nearest_grasp(
    task: Task<'_>,
    settings: &SearchSettings,
    from: &HandPose,
    stop: Stop<'_>,
) -> Option<Grasp> {
    let limited = |digit: usize| task.rig.digits[digit].limits.clamped(from.digits[digit]);
    let hand = HandPose {
        digits: std::array::from_fn(limited),
        ..*from
    };
    let mut settings = settings.clone();
    settings.query.current = Some(CurrentGrasp {
        hand,
        present: hand,
        min_score_gain: None,
        is_committed: false,
        grace: Grace::default(),
    });
    let scene = Scene::new(task, &settings);
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
