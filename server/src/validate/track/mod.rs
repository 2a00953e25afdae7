//! Checks what a client tracks: what stays the same, and each frame.

mod frame;
mod lost_hands;

use std::time::Duration;

use grasp_proto::v1;

use super::{
    Field, Violations,
    find_grasp::checked_query,
    known,
    search_limits::{duration, positive_duration},
};
use crate::{convention::Convention, error::ServiceError, rigs::store::RigStore};

pub(crate) use frame::{Frame, Intake, TrackIntake, WrongFrame};

/// Longest least time between changes.
const MAX_TIME_BETWEEN_CHANGES: Duration = Duration::from_mins(1);

/// How long a grasp is kept that comes a little too close to a hand, if the setup does not say: a swaying hand is back by then.
const GRACE: Duration = Duration::from_millis(200);

/// Longest such time.
const MAX_GRACE: Duration = Duration::from_secs(5);

/// Farthest prediction: people do not move at one velocity for longer.
const MAX_AHEAD: Duration = Duration::from_millis(500);

/// A checked setup.
#[derive(Debug)]
pub(crate) struct TrackSetup {
    /// Checks the frames.
    pub intake: TrackIntake,
    /// How to hold on to a grasp.
    pub policy: TrackPolicy,
    /// The last part of the object's name.
    pub object_id: String,
    /// Convention of frames and answers.
    pub convention: Convention,
    /// The receiving hand's size, if it is not its rig's.
    pub hand_scale: Option<f32>,
    /// The grasp to begin with.
    pub standing: Option<v1::HandAtObject>,
}

/// How a track holds on to its grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackPolicy {
    /// How much higher the score of another grasp must be to replace a valid one; none: never.
    pub better_by: Option<f32>,
    /// Least time between a change and one to a better grasp.
    pub least_time_between_changes: Duration,
    /// How far ahead of its capture a frame is answered.
    pub predict_ahead: Option<Duration>,
    /// True if answers repeat only what changed.
    pub sends_changes: bool,
    /// How long a grasp is kept that comes a little too close to a hand; zero: not even for a frame.
    pub grace: Duration,
    /// True if a re-plan may change to the other hand.
    pub may_change_hand: bool,
}

/// Checks a setup. `may_overtake` if each of its frames comes in a call of its own.
///
/// # Errors
/// [`ServiceError::Invalid`] with every violation.
pub(crate) fn track_setup(
    setup: Option<v1::TrackSetup>,
    may_overtake: bool,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<TrackSetup, ServiceError> {
    let Some(v1::TrackSetup { holdout, policy }) = setup else {
        return Err(ServiceError::invalid(
            "setup",
            "is missing; it must be the first message",
        ));
    };
    let mut violations = Violations::default();
    let v = &mut violations;
    let root = Field::root("setup");
    let policy = track_policy(root.child("policy"), policy.unwrap_or_default(), v);
    let field = root.child("holdout");
    let mut request = holdout.unwrap_or_default();
    check_fixed(field, &request, v);
    let mut of_holdout = Violations::default();
    let query = checked_query(
        request.clone(),
        (default_rig, rigs),
        object_exists,
        !v.is_empty(),
        &mut of_holdout,
    );
    v.add_all_within(field, of_holdout);
    let Some(query) = query else {
        // The function that returned none has added a violation.
        return Err(violations.into_error());
    };
    let standing = request.standing.take();
    violations.finish(TrackSetup {
        hand_scale: request.receiving_hand.as_ref().and_then(|hand| hand.hand_scale),
        standing: standing.and_then(|standing| standing.hand),
        intake: TrackIntake::new(request, policy.predict_ahead.is_some(), may_overtake),
        policy,
        object_id: query.object_id,
        convention: query.convention,
    })
}

/// What frames contain must be absent from a setup, and what tracks cannot do.
fn check_fixed(field: Field<'_>, request: &v1::FindGraspRequest, violations: &mut Violations) {
    let of_frames = [
        ("client_from_object", request.client_from_object.is_some()),
        ("presenting_hand", request.presenting_hand.is_some()),
        ("other_hands", !request.other_hands.is_empty()),
        ("obstacles", !request.obstacles.is_empty()),
    ];
    for (name, is_set) in of_frames {
        if is_set {
            violations.add(field.child(name), "is set; it belongs into the frames");
        }
    }
    if let Some(standing) = &request.standing {
        let field = field.child("standing");
        let elsewhere = [
            ("present", standing.present.is_some(), "frames' receiving_hand"),
            ("better_by", standing.better_by.is_some(), "policy"),
            ("committed", standing.committed, "frames"),
        ];
        for (name, is_set, place) in elsewhere {
            if is_set {
                violations.add(
                    field.child(name),
                    format_args!("is set; it belongs into the {place}"),
                );
            }
        }
    }
    if request.only_attempt.is_some() {
        violations.add(
            field.child("only_attempt"),
            "is set; tracks cannot be replayed, use FindGrasp",
        );
    }
    let choices = [
        (
            "validity",
            request.validity,
            [0, v1::Validity::Physical.into()],
            "VALIDITY_PHYSICAL",
        ),
        (
            "strategy",
            request.strategy,
            [0, v1::Strategy::Guided.into()],
            "STRATEGY_GUIDED",
        ),
        ("hands", request.hands, [0, v1::Hands::One.into()], "HANDS_ONE"),
    ];
    for (name, value, allowed, needed) in choices {
        if !allowed.contains(&value) {
            violations.add(
                field.child(name),
                format_args!("is {value}; tracks require {needed}, which is the default"),
            );
        }
    }
}

fn track_policy(field: Field<'_>, policy: v1::TrackPolicy, violations: &mut Violations) -> TrackPolicy {
    if let Some(better_by) = policy.better_by
        && !(0.0..=1.0).contains(&better_by)
    {
        violations.add(
            field.child("better_by"),
            format_args!("is {better_by}; it must be from 0 to 1"),
        );
    }
    let name = "least_time_between_changes";
    let between = policy
        .least_time_between_changes
        .and_then(|sent| duration(field.child(name), sent, violations))
        .unwrap_or_default();
    if between > MAX_TIME_BETWEEN_CHANGES {
        violations.add(
            field.child(name),
            format_args!("is {} s; it must be at most 60 s", between.as_secs_f64()),
        );
    }
    let predict_ahead = policy
        .predict_ahead
        .and_then(|sent| positive_duration(field.child("predict_ahead"), sent, violations));
    if let Some(ahead) = predict_ahead
        && ahead > MAX_AHEAD
    {
        violations.add(
            field.child("predict_ahead"),
            format_args!("is {} s; it must be at most 0.5 s", ahead.as_secs_f64()),
        );
    }
    let grace = policy
        .grace
        .map_or(Some(GRACE), |sent| {
            duration(field.child("grace"), sent, violations)
        })
        .unwrap_or_default();
    if grace > MAX_GRACE {
        violations.add(
            field.child("grace"),
            format_args!("is {} s; it must be at most 5 s", grace.as_secs_f64()),
        );
    }
    TrackPolicy {
        grace,
        may_change_hand: policy.may_change_hand,
        better_by: policy.better_by,
        least_time_between_changes: between,
        predict_ahead,
        sends_changes: known::<v1::AnswerDetail>(field.child("detail"), policy.detail, violations)
            == v1::AnswerDetail::Changes,
    }
}
