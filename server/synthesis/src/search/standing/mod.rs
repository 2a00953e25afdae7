//! The standing grasp: the hand that a character holds on to from one request to the next.
//!
//! Between two requests, giver and object have moved a little. A standing hand is the answer as it is while it passes every
//! check of `PHYSICAL` validity ([`StandingStatus::Kept`]), or with some digits out of the way ([`evasion`]). Otherwise
//! the nearest of the valid known grips follows it (`replan`), or else the nearest grasp that attempts find (`nearness`).
//! A committed hand is never replaced: it withdraws.
//!
//! [`evasion`]: crate::physical::evasion

mod fall;
mod no_grasp;
mod recent;
mod replan;
mod way;

use std::time::Duration;

use super::{
    GraspSource, SearchOutcome, key_frames::withdrawal::withdrawal, known_grips::grasp_value,
    reading::Reading, scene::Scene, settings::SearchSettings,
};
use crate::{
    base::clock::Clock,
    model::{grasp::Grasp, hand::HandPose},
    physical::{
        evasion::{Evaded, evade},
        grip::Gripper,
        solids::{HandSolids, TrackedSolids},
    },
    rating::assessment::GraspContext,
};
use replan::{Known, Replanner};

pub(super) use fall::held;
pub(super) use recent::RecentHands;

pub use fall::{Fall, FallReason};
pub use no_grasp::{NoGraspReason, no_grasp_reason};
pub use way::{HandWay, METRES_PER_RADIAN};

/// Longest way, in metres as [`HandWay::length`] counts it, of a grasp that an attempt found and that is near enough for the
/// search to end with it: a small correction of the hand. A longer one ends more searches early, with jumps.
const AT_HAND: f32 = 0.05;

/// A grasp to hold on to. Everything is in the object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Its hand.
    pub hand: HandPose,
    /// Where the receiver's hand is now, from where ways are measured.
    pub present: HandPose,
    /// How much higher the score of a known grip must be to replace it while it is valid; none: nothing does.
    pub better_by: Option<f32>,
    /// Whether the hand is closing, so that nothing replaces it.
    pub is_committed: bool,
    /// When it is the answer although it is too close to other people's hands.
    pub grace: Grace,
}

/// How much closer to other people's hands a standing grasp may be than a valid one, in metres: hands are tracked with noise, and now and
/// then not at all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grace {
    /// In any case.
    pub always: f32,
    /// If no known grip could follow it that keeps clear of where those hands were lately, unless it is committed.
    pub alone: f32,
}

/// What became of a standing grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandingStatus {
    /// It is the answer.
    Kept,
    /// It is the answer with digits moved that it can do without.
    Adjusted,
    /// Another grasp is the answer.
    Replanned,
    /// There is no answer.
    None,
    /// It was committed and is not valid.
    Aborted,
}

/// What became of a standing grasp, and how far the answer is from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingVerdict {
    /// What became of it.
    pub status: StandingStatus,
    /// Why it was not kept as it is, or why it is kept by its grace only.
    pub fall: Option<Fall>,
    /// Why there is no grasp.
    pub no_grasp: Option<NoGraspReason>,
    /// The digits that were moved, thumb first.
    pub moved: [bool; 5],
    /// The way from the present hand to the answer.
    pub way: Option<HandWay>,
    /// Where an aborted hand withdraws to.
    pub withdrawal: Option<HandPose>,
}

impl StandingVerdict {
    fn new(status: StandingStatus, fall: Option<Fall>) -> Self {
        Self {
            status,
            fall,
            no_grasp: None,
            moved: [false; 5],
            way: None,
            withdrawal: None,
        }
    }

    /// The verdict on a grasp that is not kept, after a search with the same scene. Without a way if the answer is of another hand.
    pub fn after_search(
        scene: &Scene<'_>,
        fall: Option<Fall>,
        outcome: &SearchOutcome,
        is_same_hand: bool,
    ) -> Self {
        let Some(grasp) = &outcome.grasp else {
            return Self::new(StandingStatus::None, fall);
        };
        let present = scene.standing().map(|standing| standing.present);
        Self {
            way: present
                .filter(|_| is_same_hand)
                .map(|present| HandWay::between(scene, &present, &grasp.pose)),
            ..Self::new(StandingStatus::Replanned, fall)
        }
    }
}

/// The result of looking at a standing grasp and known grips.
#[derive(Clone, Debug)]
pub enum Stand {
    /// The answer, without a search.
    Settled(Box<(SearchOutcome, StandingVerdict)>),
    /// The grasp fell, and no known grip is valid.
    Fallen(Fall),
    /// The time was over before it was decided.
    OutOfTime,
}

/// How near a grasp is to the present hand: more than any score, and higher the nearer.
pub(super) fn nearness(scene: &Scene<'_>, standing: &Standing, grasp: &Grasp) -> f32 {
    1.0 + (1.0 + way_of(scene, standing, grasp)).recip()
}

/// True if a search need not look for a nearer grasp.
pub(super) fn is_at_hand(scene: &Scene<'_>, standing: &Standing, grasp: &Grasp) -> bool {
    way_of(scene, standing, grasp) <= AT_HAND
}

/// The way to a grasp, in metres; longer where other people's hands were lately.
fn way_of(scene: &Scene<'_>, standing: &Standing, grasp: &Grasp) -> f32 {
    let (present, to) = (standing.present.frame_from_wrist, grasp.pose.frame_from_wrist);
    let lack = scene.recent_hands().map_or(0.0, |recent| {
        let solids = HandSolids::of_pose(scene.rig(), &grasp.pose);
        recent.lack(&TrackedSolids::of_rig(scene.rig(), to, &solids))
    });
    way::WristWay::between(present, to).length() + lack
}

/// Decides about the standing grasp of `settings` and, if it fell, looks for a known grip to follow it, until the time `until`
/// of the clock. The same scene must have been prepared with the same settings. None without a standing grasp or without
/// `PHYSICAL` validity.
pub fn stand(
    scene: &Scene<'_>,
    settings: &SearchSettings,
    clock: &dyn Clock,
    until: Option<Duration>,
) -> Option<Stand> {
    let standing = scene.standing()?;
    let around = scene.surroundings()?;
    let mut gripper = Gripper::default();
    let is_late = || until.is_some_and(|until| clock.now() >= until);
    let replanner = Replanner::new(scene, settings, &around, standing);
    // What is known of a grip need not be found again.
    let decision = replanner.of_known_hand(&standing.hand, &mut gripper).map_or_else(
        || decide(scene, around, standing, &mut gripper),
        |grasp| Decision::Kept { grasp, fall: None },
    );
    let (grasp, verdict) = match decision {
        Decision::Kept { grasp, fall } => (grasp, StandingVerdict::new(StandingStatus::Kept, fall)),
        Decision::Adjusted { grasp, moved, fall } => {
            let adjusted = StandingVerdict::new(StandingStatus::Adjusted, Some(fall));
            (grasp, StandingVerdict { moved, ..adjusted })
        }
        Decision::Fallen(fall) if standing.is_committed => {
            let verdict = StandingVerdict {
                withdrawal: Some(withdrawal(&around, &standing.present)),
                ..StandingVerdict::new(StandingStatus::Aborted, Some(fall))
            };
            return Some(Stand::Settled(Box::new((replanner.outcome(None), verdict))));
        }
        Decision::Fallen(fall) => match replanner.nearest(&mut gripper, &is_late) {
            Err(OutOfTime) => return Some(Stand::OutOfTime),
            Ok(Some(known)) if known.lack <= 0.0 => {
                return Some(replanner.settled(known, StandingStatus::Replanned, Some(fall)));
            }
            Ok(known) => match kept_by(standing.grace.alone, fall, scene, around, standing, &mut gripper) {
                Some(grasp) => (grasp, StandingVerdict::new(StandingStatus::Kept, Some(fall))),
                None => {
                    return Some(known.map_or(Stand::Fallen(fall), |known| {
                        replanner.settled(known, StandingStatus::Replanned, Some(fall))
                    }));
                }
            },
        },
    };
    if let Some(better_by) = standing.better_by
        && !standing.is_committed
    {
        let value = grasp_value(&grasp);
        match replanner.best(value + better_by, &mut gripper, &is_late) {
            Err(OutOfTime) => return Some(Stand::OutOfTime),
            Ok(None) => {}
            Ok(Some(better)) => {
                let fall = Fall {
                    reason: FallReason::BetterGrasp,
                    figure: Some(grasp_value(&better.grasp) - value),
                    bound: Some(better_by),
                };
                return Some(replanner.settled(better, StandingStatus::Replanned, Some(fall)));
            }
        }
    }
    let kept = Known {
        source: GraspSource::Standing,
        grasp,
        lack: 0.0,
    };
    Some(replanner.settled_as(kept, verdict))
}

/// The time was over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct OutOfTime;

/// Whether a standing hand holds.
enum Decision {
    /// As it is; with why it would not without its grace.
    Kept { grasp: Box<Grasp>, fall: Option<Fall> },
    /// With digits moved that were too close to a barrier.
    Adjusted {
        grasp: Box<Grasp>,
        moved: [bool; 5],
        fall: Fall,
    },
    /// No.
    Fallen(Fall),
}

fn decide(
    scene: &Scene<'_>,
    around: GraspContext<'_>,
    standing: &Standing,
    gripper: &mut Gripper,
) -> Decision {
    let pose = &standing.hand;
    let hold = |pose: &HandPose, gripper: &mut Gripper| {
        held(&Reading::new(around, scene.holdout(), pose), 0.0, gripper)
    };
    let fall = match hold(pose, gripper) {
        Ok(grasp) => return Decision::Kept { grasp, fall: None },
        Err(fall) => fall,
    };
    if let Some(grasp) = kept_by(standing.grace.always, fall, scene, around, standing, gripper) {
        let fall = Some(fall);
        return Decision::Kept { grasp, fall };
    }
    if let FallReason::Giver | FallReason::Obstacle = fall.reason
        && let Some(Evaded { pose, moved }) =
            evade(&around.object, around.rig, pose, around.presented.barriers())
        && let Ok(grasp) = hold(&pose, gripper)
    {
        return Decision::Adjusted { grasp, moved, fall };
    }
    Decision::Fallen(fall)
}

/// The standing grasp that fell, if a grace keeps it.
fn kept_by(
    grace: f32,
    fall: Fall,
    scene: &Scene<'_>,
    around: GraspContext<'_>,
    standing: &Standing,
    gripper: &mut Gripper,
) -> Option<Box<Grasp>> {
    if fall.reason != FallReason::Giver || grace <= 0.0 {
        return None;
    }
    held(
        &Reading::new(around, scene.holdout(), &standing.hand),
        grace,
        gripper,
    )
    .ok()
}
