//! Checks what a client tracks: what stays the same, and each frame.

use std::time::{Duration, Instant};

use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

use super::{
    Field, FindQuery, Violations,
    find_grasp::checked_query,
    hand::{checked_digits, hand_scale, required_handedness},
    known, pose, quoted,
    search_limits::{duration, positive_duration},
};
use crate::{
    convention::Convention,
    error::ServiceError,
    rigs::{RigHand, store::RigStore},
};

/// Budget of the search for a frame if the setup names none: what is left of a frame at 90 Hz.
const FRAME_BUDGET: Duration = Duration::from_millis(8);

/// Longest least time between changes.
const LONGEST_BETWEEN_CHANGES: Duration = Duration::from_mins(1);

/// Farthest prediction: people do not move at one velocity for longer.
const FARTHEST_AHEAD: Duration = Duration::from_millis(500);

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
}

/// A checked frame.
#[derive(Debug)]
pub(crate) struct Frame {
    /// Its number.
    pub sequence: u64,
    /// When it was captured, on the client's clock.
    pub captured: Option<Duration>,
    /// When it arrived.
    pub arrived: Instant,
    /// The holdout, with all that the track's setup says.
    pub query: FindQuery,
    /// The receiver's hand.
    pub receiving_hand: Option<PresentHand>,
    /// True if the hand is closing.
    pub is_committed: bool,
}

/// The receiver's hand at the time of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PresentHand {
    /// Its wrist's joint frame, in `OpenXR` axes.
    pub client_from_wrist: Pose,
    /// Rig, side and size, and the digits' angles; its pose is left out.
    pub hand: v1::HandAtObject,
}

/// Checks the frames of a track one after the other.
#[derive(Debug)]
pub(crate) struct TrackIntake {
    /// The setup, with what frames have replaced.
    request: v1::FindGraspRequest,
    /// The number of the latest frame.
    sequence: Option<u64>,
    /// Its time.
    captured: Option<Duration>,
    /// True if frames must have a time.
    needs_time: bool,
    /// True if frames may overtake each other on their way.
    may_overtake: bool,
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
    let request = holdout.unwrap_or_default();
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
    let intake = TrackIntake {
        request,
        sequence: None,
        captured: None,
        needs_time: policy.predict_ahead.is_some() || !policy.least_time_between_changes.is_zero(),
        may_overtake,
    };
    violations.finish(TrackSetup {
        hand_scale: intake
            .request
            .receiving_hand
            .as_ref()
            .and_then(|hand| hand.hand_scale),
        intake,
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
    if request.standing.is_some() {
        violations.add(
            field.child("standing"),
            "is set; the grasp of the answer before stands",
        );
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
    if between > LONGEST_BETWEEN_CHANGES {
        violations.add(
            field.child(name),
            format_args!("is {} s; it must be at most 60 s", between.as_secs_f64()),
        );
    }
    let predict_ahead = policy
        .predict_ahead
        .and_then(|sent| positive_duration(field.child("predict_ahead"), sent, violations));
    if let Some(ahead) = predict_ahead
        && ahead > FARTHEST_AHEAD
    {
        violations.add(
            field.child("predict_ahead"),
            format_args!("is {} s; it must be at most 0.5 s", ahead.as_secs_f64()),
        );
    }
    TrackPolicy {
        better_by: policy.better_by,
        least_time_between_changes: between,
        predict_ahead,
        sends_changes: known::<v1::AnswerDetail>(field.child("detail"), policy.detail, violations)
            == v1::AnswerDetail::Changes,
    }
}

impl TrackIntake {
    /// Checks a frame that arrived at a time; none if it was overtaken. A wrong one changes nothing.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with every violation.
    pub(crate) fn check(
        &mut self,
        frame: Option<v1::TrackFrame>,
        arrived: Instant,
        rigs: (&str, &RigStore),
    ) -> Result<Option<Frame>, ServiceError> {
        let field = Field::root("frame");
        let Some(frame) = frame else {
            return Err(ServiceError::invalid("frame", "is missing"));
        };
        let sequence = frame.sequence;
        let is_later = self.sequence.is_none_or(|last| sequence > last);
        if !is_later && self.may_overtake {
            return Ok(None);
        }
        let mut violations = Violations::default();
        let v = &mut violations;
        if let (false, Some(last)) = (is_later, self.sequence) {
            v.add(
                field.child("sequence"),
                format_args!("is {sequence}; it must be more than {last}, that of the frame before"),
            );
        }
        let captured = self.capture_time(field.child("capture_time"), frame.capture_time, v);
        let request = v1::FindGraspRequest {
            client_from_object: frame.client_from_object,
            presenting_hand: frame.presenting_hand,
            other_hands: frame.other_hands,
            obstacles: frame.obstacles,
            up: frame.up.or(self.request.up),
            receiver: frame.receiver.or(self.request.receiver),
            ..self.request.clone()
        };
        let (up, receiver) = (request.up, request.receiver);
        let mut of_holdout = Violations::default();
        // The object is looked up when the frame is answered.
        let query = checked_query(request, rigs, |_| true, false, &mut of_holdout);
        v.add_all_within(field, of_holdout);
        let Some(mut query) = query else {
            return Err(violations.into_error());
        };
        query.limits.budget = query.limits.budget.or(Some(FRAME_BUDGET));
        let receiving_hand = frame
            .receiving_hand
            .and_then(|hand| present_hand(field.child("receiving_hand"), hand, &query, v));
        let frame = violations.finish(Frame {
            sequence,
            captured,
            arrived,
            query,
            receiving_hand,
            is_committed: frame.committed,
        })?;
        self.sequence = Some(sequence);
        self.captured = captured.or(self.captured);
        self.request.up = up;
        self.request.receiver = receiver;
        Ok(Some(frame))
    }

    /// When a frame was captured.
    fn capture_time(
        &self,
        field: Field<'_>,
        sent: Option<prost_types::Duration>,
        violations: &mut Violations,
    ) -> Option<Duration> {
        let Some(sent) = sent else {
            if self.needs_time {
                violations.add(
                    field,
                    "is missing; predict_ahead and least_time_between_changes require it",
                );
            }
            return None;
        };
        let captured = duration(field, sent, violations)?;
        if let Some(before) = self.captured
            && captured < before
        {
            violations.add(
                field,
                format_args!(
                    "is {} s; it must not be before {} s, that of the frame before",
                    captured.as_secs_f64(),
                    before.as_secs_f64()
                ),
            );
        }
        Some(captured)
    }
}

/// The receiver's hand, which must be one that the track may pose.
fn present_hand(
    field: Field<'_>,
    sent: v1::HandAngles,
    query: &FindQuery,
    violations: &mut Violations,
) -> Option<PresentHand> {
    let handedness = required_handedness(field.child("handedness"), sent.handedness, violations);
    let scale = hand_scale(field.child("hand_scale"), sent.hand_scale, violations);
    let wrist = pose(
        field.child("client_from_wrist"),
        sent.client_from_wrist,
        query.convention.metres_per_unit(),
        violations,
    );
    let receiving: &RigHand = &query.receiving_hand;
    let rig = &receiving.hand.rig;
    checked_digits(
        field.child("digits"),
        &sent.digits,
        &rig.digits.map(|digit| digit.limits),
        violations,
    );
    if sent.rig != rig.name {
        violations.add(
            field.child("rig"),
            format_args!(
                "is {}; it must be that of the receiving hand, {}",
                quoted(&sent.rig),
                rig.name
            ),
        );
    }
    if (scale - receiving.scale).abs() > 0.005 {
        violations.add(
            field.child("hand_scale"),
            format_args!(
                "is {scale}; it must be that of the receiving hand, {}",
                receiving.scale
            ),
        );
    }
    handedness?;
    Some(PresentHand {
        client_from_wrist: query.convention.joint_to_openxr(wrist),
        hand: v1::HandAtObject {
            rig: sent.rig,
            handedness: sent.handedness,
            hand_scale: sent.hand_scale,
            object_from_wrist: None,
            digits: sent.digits,
        },
    })
}
