//! Checks the other requests that search: `StreamGrasps`, `EvaluateHoldout` and `ValidateGrasp`.

use std::time::Duration;

use grasp_proto::v1::{self, stream_grasps_request as stream, validate_grasp_request::Grasp};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{HandPose, joints::HandJoints, kinematics::fitted, rig::Rig},
    search::report::Differences,
};

use super::{
    FindQuery, GiverHand, Violations, check_count, check_positive, check_unset, check_within,
    find_grasp::checked_query,
    hand::{
        AllowedGaps, AngleBounds, Place, check_meshes_together, posed_hand, presenting_hands, tracked_hand,
    },
    holdout::Frames,
    known, positive_duration, quoted,
    requirements::check_no_experiment,
};
use crate::{error::ServiceError, rigs::store::RigStore};

/// Largest number of further poses of the giver's hand. Each takes a millisecond or two with an atlas.
const MAX_PRESENTING_HANDS: usize = 64;
const MAX_ALTERNATIVES: u32 = 32;

/// Default of the rate: as often as a film shows pictures.
const DEFAULT_RATE: f32 = 30.0;

/// Largest rate: more often than any display shows pictures.
const MAX_RATE: f32 = 1000.0;

/// Longer than any search: whatever is longer has the same effect.
const MAX_INTERVAL: Duration = Duration::from_hours(1);

pub(super) fn check_one_hand(receiver: Option<&v1::Receiver>, v: &Violations) {
    let takes_both = receiver.is_some_and(|receiver| receiver.both_hands);
    let why_not = "only FindGrasp takes an object with both hands: leave it out";
    check_unset(v.field("receiver"), [("both_hands", takes_both)], why_not);
}

#[derive(Debug)]
pub(crate) struct StreamQuery {
    pub find: FindQuery,
    pub sent: Sent,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Sent {
    Better { interval: Duration },
    Alternatives { count: usize, by: Differences },
}

pub(crate) fn stream_query(
    mut request: v1::StreamGraspsRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<StreamQuery, ServiceError> {
    let v = &Violations::default();
    let sent = match &request.sent {
        Some(stream::Sent::Alternatives(sent)) => alternatives(sent, v),
        Some(stream::Sent::MaxRateHz(rate)) => better(*rate, v),
        None => better(DEFAULT_RATE, v),
    };
    let search = request.search.get_or_insert_default();
    let field = v.field("search");
    if let choice @ (v1::GraspChoice::FirstValid | v1::GraspChoice::Reproducible) = search.choice() {
        field.child("choice").add(format_args!(
            "is {}; it must be GRASP_CHOICE_BEST_WITHIN_BUDGET or unspecified: a stream goes on after the first grasp",
            choice.as_str_name()
        ));
    }
    let is_replay = [("replay_attempt", search.replay_attempt.is_some())];
    check_unset(field, is_replay, "one attempt has no better ones: leave it out");
    // Without a budget, this choice would end after some milliseconds.
    let has_budget = search.budget.is_some();
    if v1::GraspChoice::try_from(search.choice).is_ok() {
        search.set_choice(v1::GraspChoice::BestWithinBudget);
    }
    check_one_hand(request.receiver.as_ref(), v);
    let mut find = v.finish_some(checked_query(request.into(), rigs, object_exists, v))?;
    if !has_budget {
        find.limits.budget = None;
        find.limits.is_patient = false;
    }
    Ok(StreamQuery { find, sent })
}

fn better(rate: f32, v: &Violations) -> Sent {
    check_positive(v.field("max_rate_hz"), rate, MAX_RATE);
    let interval = Duration::try_from_secs_f32(1.0 / rate).unwrap_or(MAX_INTERVAL);
    Sent::Better {
        interval: interval.min(MAX_INTERVAL),
    }
}

fn alternatives(v1::Alternatives { count, differ_by }: &v1::Alternatives, v: &Violations) -> Sent {
    let parent = v.field("alternatives");
    check_within(parent.child("count"), *count, 1..=MAX_ALTERNATIVES);
    let listed = parent
        .child("differ_by")
        .each(differ_by, |field, &value| known(field, value));
    let listed: Vec<v1::DifferBy> = listed.collect();
    Sent::Alternatives {
        count: *count as usize,
        by: Differences {
            approach: listed.is_empty()
                || listed.contains(&v1::DifferBy::Unspecified)
                || listed.contains(&v1::DifferBy::Approach),
            grasp_type: listed.contains(&v1::DifferBy::Type),
            region: listed.contains(&v1::DifferBy::Region),
        },
    }
}

#[derive(Debug)]
pub(crate) struct EvaluateQuery {
    pub holdout: FindQuery,
    /// Further hands in place of the giver's, in the client's frame and `OpenXR` axes.
    pub other_presenting_hands: Vec<GiverHand>,
}

pub(crate) fn evaluate_query(
    mut request: v1::EvaluateHoldoutRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<EvaluateQuery, ServiceError> {
    let v = &Violations::default();
    let others_field = v.field("other_presenting_hands");
    let frames = Frames::of(request.holdout.as_ref(), request.output, rigs.1);
    let others = std::mem::take(&mut request.other_presenting_hands);
    check_count(others_field, others.len(), MAX_PRESENTING_HANDS, "elements");
    let others = presenting_hands(others_field, others, MAX_PRESENTING_HANDS, &frames);
    check_one_hand(request.receiver.as_ref(), v);
    check_no_experiment(request.requirements.as_ref(), v);
    let why_not = "an evaluation answers no single grasp: leave it out";
    if let Some(search) = &mut request.search {
        let is_replay = [("replay_attempt", search.replay_attempt.take().is_some())];
        check_unset(v.field("search"), is_replay, why_not);
        search.max_attempts = None;
        // It has no effect. An undefined value stays, to be rejected.
        if v1::GraspChoice::try_from(search.choice).is_ok() {
            search.choice = 0;
        }
    }
    if let Some(output) = &mut request.output {
        let has_key_frames = [("key_frames", std::mem::take(&mut output.key_frames))];
        check_unset(v.field("output"), has_key_frames, why_not);
    }
    let holdout = checked_query(request.into(), rigs, object_exists, v);
    if let Some(holdout) = &holdout {
        let hands = holdout.presenting_hand.iter().chain(&holdout.other_hands);
        check_meshes_together(others_field, hands.chain(&others));
    }
    Ok(EvaluateQuery {
        holdout: v.finish_some(holdout)?,
        other_presenting_hands: others,
    })
}

#[derive(Clone, Debug)]
pub(crate) enum GivenGrasp {
    AtObject(HandPose),
    /// Tracked joints in the client's frame, in `OpenXR` axes.
    Tracked(Box<HandJoints>),
}

impl GivenGrasp {
    /// The hand in the object's frame. A tracked one is posed with the rig.
    pub(crate) fn at_object(&self, rig: &Rig, client_from_object: Pose) -> HandPose {
        match self {
            Self::AtObject(pose) => *pose,
            Self::Tracked(joints) => {
                let pose = fitted(rig, joints);
                HandPose {
                    frame_from_wrist: client_from_object.inverse() * pose.frame_from_wrist,
                    ..pose
                }
            }
        }
    }
}

#[derive(Debug)]
pub(crate) struct ValidateQuery {
    /// The holdout, as for a search for the first valid grasp.
    pub holdout: FindQuery,
    pub grasp: GivenGrasp,
    pub find_nearest: bool,
    pub warnings: Vec<String>,
}

pub(crate) fn validate_query(
    mut request: v1::ValidateGraspRequest,
    rigs: (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<ValidateQuery, ServiceError> {
    let v = &Violations::default();
    let frames = Frames::of(request.holdout.as_ref(), request.output, rigs.1);
    let receiver = request.receiver.get_or_insert_default();
    let hand = request.grasp.as_ref().map(|grasp| match grasp {
        Grasp::Pose(hand) => v1::Receiver {
            rig: hand.rig.clone(),
            handedness: hand.handedness,
            scale: hand.scale,
            ..Default::default()
        },
        // They have no rig.
        Grasp::Joints(hand) => v1::Receiver {
            handedness: hand.handedness,
            ..Default::default()
        },
    });
    let grasp = request.grasp.as_ref();
    let given = v
        .field("grasp")
        .if_right(|| given_grasp(grasp, &frames, v))
        .flatten();
    let nearest_budget = request.nearest_budget;
    let budget = nearest_budget.and_then(|sent| positive_duration(v.field("nearest_budget"), sent));
    check_no_experiment(request.requirements.as_ref(), v);
    check_one_hand(Some(receiver), v);
    // A wrong grasp does not tell the receiver.
    if let Some(hand) = hand.filter(|_| given.is_some()) {
        settle_receiver(receiver, &hand, v);
    }
    if let Some(output) = &mut request.output {
        output.key_frames = false;
    }
    let holdout = checked_query(request.into(), rigs, object_exists, v);
    let (mut holdout, (grasp, warnings)) = v.finish_some(holdout.zip(given))?;
    holdout.limits.budget = budget;
    Ok(ValidateQuery {
        holdout,
        grasp,
        find_nearest: nearest_budget.is_some(),
        warnings,
    })
}

/// Makes the receiver the one whose hand the grasp is of. The request must not contradict the grasp.
fn settle_receiver(sent: &mut v1::Receiver, given: &v1::Receiver, v: &Violations) {
    let field = v.field("receiver");
    // An undefined value stays, to be rejected.
    if let Ok(named) = v1::Handedness::try_from(sent.handedness) {
        let [named, hand] = [named, given.handedness()].map(|side| side.as_str_name());
        let text = format_args!("is {named}, but the grasp is of {hand}; leave it out");
        field
            .child("handedness")
            .check(sent.handedness == 0 || sent.handedness == given.handedness, text);
        sent.handedness = given.handedness;
    }
    if given.rig.is_empty() {
        return;
    }
    if !sent.rig.is_empty() && sent.rig != given.rig {
        let [sent, rig] = [&sent.rig, &given.rig].map(|name| quoted(name));
        let text = format_args!("is {sent}, but the grasp is of {rig}; leave it out");
        field.child("rig").add(text);
    }
    let size = given.scale.unwrap_or(1.0);
    let sent_size = sent.scale.unwrap_or(size);
    field.child("scale").check(
        (sent_size - size).abs() < 0.005,
        format_args!(
            "is {sent_size}, but the hand of the grasp is {size} times as large as its rig; leave it out"
        ),
    );
    sent.rig.clone_from(&given.rig);
    sent.scale = given.scale;
}

/// The grasp with its repairs; `None` only with violations. Angles need not be within the limits of their rig.
fn given_grasp(
    sent: Option<&Grasp>,
    frames: &Frames<'_>,
    v: &Violations,
) -> Option<(GivenGrasp, Vec<String>)> {
    let (pose_field, joints_field) = (v.field("pose"), v.field("joints"));
    match sent {
        None => v.field("grasp").reject("is absent; it must be pose or joints"),
        Some(Grasp::Pose(sent)) => {
            let hand = posed_hand(pose_field, sent, Place::AtObject, AngleBounds::HalfTurn, frames)?;
            Some((GivenGrasp::AtObject(hand.pose), Vec::new()))
        }
        Some(Grasp::Joints(sent)) => {
            let hand = tracked_hand(joints_field, sent, frames.convention, AllowedGaps::Nothing)?;
            Some((GivenGrasp::Tracked(Box::new(hand.joints)), hand.warnings))
        }
    }
}
