//! Checks the frames of a track one after the other.

use std::time::{Duration, Instant};

use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

use super::lost_hands::{LastHands, Lost};
use crate::{
    error::ServiceError,
    rigs::{RigHand, store::RigStore},
    validate::{
        Field, FindQuery, Violations,
        find_grasp::checked_query,
        hand::{checked_digits, hand_scale, required_handedness},
        pose, quoted,
        search_limits::duration,
    },
};

/// Budget of the search for a frame if the setup names none: what is left of a frame at 90 Hz.
const FRAME_BUDGET: Duration = Duration::from_millis(8);

/// A checked frame.
#[derive(Debug)]
pub(crate) struct Frame {
    /// Its number.
    pub sequence: u64,
    /// When it was captured, on the client's clock.
    pub captured: Option<Duration>,
    /// True if that clock was restarted.
    pub restarts_clock: bool,
    /// When it arrived.
    pub arrived: Instant,
    /// The holdout, with all that the track's setup says.
    pub query: FindQuery,
    /// The receiver's hand.
    pub receiving_hand: Option<PresentHand>,
    /// True if the hand is closing.
    pub is_committed: bool,
    /// What is wrong with it, yet can be answered.
    pub warnings: Vec<String>,
}

/// A frame for which there can be no grasp.
#[derive(Debug)]
pub(crate) struct WrongFrame {
    /// Its number.
    pub sequence: u64,
    /// When it arrived.
    pub arrived: Instant,
    /// What is wrong with it.
    pub warnings: Vec<String>,
}

/// What became of a frame.
#[derive(Debug)]
pub(crate) enum Intake {
    /// It is the latest.
    Frame(Box<Frame>),
    /// A later one had come before.
    Overtaken,
    /// The giver's hand has lost tracking, and it is unknown where it was before.
    Untracked(WrongFrame),
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
    /// Where hands were when they were tracked last.
    hands: LastHands,
    /// True if frames should have a time.
    needs_time: bool,
    /// True if frames may overtake each other on their way.
    may_overtake: bool,
}

impl TrackIntake {
    /// Of a track with this setup. `may_overtake` if each frame comes in a call of its own.
    pub(super) fn new(request: v1::FindGraspRequest, needs_time: bool, may_overtake: bool) -> Self {
        Self {
            request,
            sequence: None,
            captured: None,
            hands: LastHands::default(),
            needs_time,
            may_overtake,
        }
    }

    /// Checks a frame that arrived at a time. A wrong one changes nothing.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with every violation.
    pub(crate) fn check(
        &mut self,
        frame: Option<v1::TrackFrame>,
        arrived: Instant,
        rigs: (&str, &RigStore),
        object_exists: impl Fn(&str) -> bool,
    ) -> Result<Intake, ServiceError> {
        let field = Field::root("frame");
        let Some(frame) = frame else {
            return Err(ServiceError::invalid("frame", "is missing"));
        };
        let sequence = frame.sequence;
        let last = self.sequence.filter(|&last| sequence <= last);
        if last.is_some() && self.may_overtake {
            return Ok(Intake::Overtaken);
        }
        let mut violations = Violations::default();
        let v = &mut violations;
        let mut doubts = Violations::default();
        if let Some(last) = last {
            doubts.add(
                "sequence",
                format_args!("is {sequence}; it should be more than {last}, that of the frame before"),
            );
        }
        let captured = self.capture_time(field, frame.capture_time, v, &mut doubts);
        let restarts_clock = captured.is_some() && captured < self.captured;
        let mut request = v1::FindGraspRequest {
            object: if frame.object.is_empty() {
                self.request.object.clone()
            } else {
                frame.object
            },
            client_from_object: frame.client_from_object,
            presenting_hand: frame.presenting_hand,
            other_hands: frame.other_hands,
            obstacles: frame.obstacles,
            up: frame.up.or(self.request.up),
            receiver: frame.receiver.or(self.request.receiver),
            ..self.request.clone()
        };
        let mut lost = Lost::take_from(&mut request, rigs.1);
        doubts.add_all(std::mem::take(&mut lost.violations));
        let (object, up, receiver) = (request.object.clone(), request.up, request.receiver);
        let mut of_holdout = Violations::default();
        let query = checked_query(request, rigs, &object_exists, false, &mut of_holdout);
        v.add_all_within(field, of_holdout);
        let Some(mut query) = query else {
            return Err(violations.into_error());
        };
        // The object that the track has is looked up when the frame is answered.
        if object != self.request.object && !object_exists(&query.object_id) {
            v.add(
                field.child("object"),
                format_args!("is {}, which does not exist", quoted(&object)),
            );
        }
        query.limits.budget = query.limits.budget.or(Some(FRAME_BUDGET));
        let receiving_hand = frame
            .receiving_hand
            .and_then(|hand| present_hand(field.child("receiving_hand"), hand, &query, v));
        violations.finish(())?;
        let warnings = doubts.sentences(field);
        self.sequence = Some(sequence);
        if lost.is_without_giver(&self.hands) {
            return Ok(Intake::Untracked(WrongFrame {
                sequence,
                arrived,
                warnings,
            }));
        }
        lost.put_back(&self.hands, &mut query);
        self.hands.learn(&query);
        self.captured = captured.or(self.captured);
        self.request.object = object;
        self.request.up = up;
        self.request.receiver = receiver;
        Ok(Intake::Frame(Box::new(Frame {
            sequence,
            captured,
            restarts_clock,
            arrived,
            query,
            receiving_hand,
            is_committed: frame.committed,
            warnings,
        })))
    }

    /// When a frame was captured.
    fn capture_time(
        &self,
        parent: Field<'_>,
        sent: Option<prost_types::Duration>,
        violations: &mut Violations,
        doubts: &mut Violations,
    ) -> Option<Duration> {
        let name = "capture_time";
        let Some(sent) = sent else {
            if self.needs_time {
                doubts.add(name, "is missing; nothing can be predicted without it");
            }
            return None;
        };
        let captured = duration(parent.child(name), sent, violations)?;
        if let Some(before) = self.captured
            && captured < before
        {
            doubts.add(
                name,
                format_args!(
                    "is {} s, before {} s, that of the frame before; what is moving is known anew from this one on",
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
