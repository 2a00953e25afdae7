//! Checks the frames of a track one after the other.

use std::time::{Duration, Instant};

use grasp_proto::v1;

use super::{
    lost_hands::{LastHands, LostHands},
    sentences,
};
use crate::{
    error::ServiceError,
    rigs::store::RigStore,
    validate::{
        FindQuery, Violations, check_unset,
        current_grasp::check_is,
        duration,
        find_grasp::checked_query,
        frames::Frames,
        hand::{AngleBounds, Place, posed_hand},
        quoted,
    },
};

/// Budget of the search for a frame if the track names none: what is left of a frame at 90 Hz.
const FRAME_BUDGET: Duration = Duration::from_millis(8);

/// A checked frame.
#[derive(Debug)]
pub(crate) struct Frame {
    pub sequence: u64,
    /// When it was captured, on the client's clock.
    pub captured: Option<Duration>,
    /// True if that clock was restarted.
    pub restarts_clock: bool,
    /// When it arrived.
    pub arrived: Instant,
    /// The holdout, with all that the track says.
    pub query: FindQuery,
    pub receiving_hand: Option<v1::HandPose>,
    /// True if the hand is closing.
    pub is_committed: bool,
    /// What is wrong with it, yet can be answered.
    pub warnings: Vec<String>,
}

/// A frame for which there can be no grasp.
#[derive(Debug)]
pub(crate) struct WrongFrame {
    pub sequence: u64,
    /// When it arrived.
    pub arrived: Instant,
    /// What is wrong with it.
    pub warnings: Vec<String>,
}

/// A frame that is to be answered.
#[derive(Debug)]
pub(crate) enum Latest {
    /// With the grasp for it.
    Frame(Box<Frame>),
    /// With what is wrong with it.
    Wrong(WrongFrame),
}

impl Latest {
    /// Its number.
    pub(crate) fn sequence(&self) -> u64 {
        match self {
            Self::Frame(frame) => frame.sequence,
            Self::Wrong(frame) => frame.sequence,
        }
    }
}

/// A frame's query, or that of its track, with this holdout and receiver.
pub(super) fn parts(
    track: &v1::Track,
    holdout: Option<v1::Holdout>,
    receiver: Option<v1::Receiver>,
) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        holdout,
        receiver,
        requirements: track.requirements.clone(),
        search: track.search,
        output: track.output,
        current: None,
    }
}

/// Checks the frames of a track one after the other.
#[derive(Debug)]
pub(crate) struct TrackIntake {
    /// The track, with what frames have replaced.
    track: v1::Track,
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
    /// Of a checked track. `may_overtake` if each frame comes in a call of its own.
    pub(super) fn new(track: v1::Track, needs_time: bool, may_overtake: bool) -> Self {
        Self {
            track,
            sequence: None,
            captured: None,
            hands: LastHands::default(),
            needs_time,
            may_overtake,
        }
    }

    /// Checks a frame that arrived at a time; `None` if it may be ignored, as a later one had come before. A wrong one changes nothing.
    pub(crate) fn check(
        &mut self,
        frame: v1::TrackFrame,
        arrived: Instant,
        rigs: (&str, &RigStore),
        object_exists: impl Fn(&str) -> bool,
    ) -> Result<Option<Latest>, ServiceError> {
        let sequence = frame.sequence;
        if self.may_overtake && self.sequence.is_some_and(|last| sequence <= last) {
            return Ok(None);
        }
        let checked = self.checked(frame, arrived, rigs, object_exists);
        match checked {
            Err(ServiceError::Invalid(violations)) => Ok(Some(Latest::Wrong(WrongFrame {
                sequence,
                arrived,
                warnings: sentences(violations),
            }))),
            checked => checked.map(Some),
        }
    }

    /// As [`Self::check`], with the violations of a wrong frame as an error.
    fn checked(
        &mut self,
        frame: v1::TrackFrame,
        arrived: Instant,
        rigs: (&str, &RigStore),
        object_exists: impl Fn(&str) -> bool,
    ) -> Result<Latest, ServiceError> {
        let sequence = frame.sequence;
        let violations = Violations::default();
        let v = &violations;
        let doubts = Violations::default();
        if let Some(last) = self.sequence.filter(|&last| sequence <= last) {
            doubts.add(
                "sequence",
                format_args!("is {sequence}; it should be more than {last}, that of the frame before"),
            );
        }
        let captured = self.capture_time(frame.capture_time, v, &doubts);
        let restarts_clock = captured.is_some() && captured < self.captured;
        let mut holdout = self.holdout(frame.holdout.unwrap_or_default(), v);
        let receiver = match frame.receiver {
            Some(body) => Some(self.receiver(&body, v)),
            None => self.track.receiver.clone(),
        };
        let lost = LostHands::take_from(doubts.field("holdout"), &mut holdout, self.track.output, rigs.1);
        let (object, up) = (holdout.object.clone(), holdout.up);
        let parts = parts(&self.track, Some(holdout), receiver.clone());
        let query = checked_query(parts, rigs, &object_exists, v);
        let Some(mut query) = query else {
            return Err(violations.into_error());
        };
        // The object that the track has is looked up when the frame is answered.
        let before = self.track.holdout.get_or_insert_default();
        if object != before.object && !object_exists(&query.object_id) {
            violations
                .field("holdout")
                .child("object")
                .add(format_args!("is {}, which does not exist", quoted(&object)));
        }
        query.limits.budget = query.limits.budget.or(Some(FRAME_BUDGET));
        if let Some(hand) = &frame.receiving_hand {
            check_receiving_hand(hand, &query, rigs.1, v);
        }
        violations.finish(())?;
        let warnings = sentences(doubts.into_listed());
        self.sequence = Some(sequence);
        if lost.is_without_giver(&self.hands) {
            return Ok(Latest::Wrong(WrongFrame {
                sequence,
                arrived,
                warnings,
            }));
        }
        lost.put_back(&self.hands, &mut query);
        self.hands.learn(&query);
        self.captured = captured.or(self.captured);
        before.object = object;
        before.up = up;
        self.track.receiver = receiver;
        Ok(Latest::Frame(Box::new(Frame {
            sequence,
            captured,
            restarts_clock,
            arrived,
            query,
            receiving_hand: frame.receiving_hand,
            is_committed: frame.committed,
            warnings,
        })))
    }

    /// The holdout of a frame, with what is the track's.
    fn holdout(&self, sent: v1::Holdout, v: &Violations) -> v1::Holdout {
        let set = [
            ("scale", sent.scale.is_some()),
            ("mass_kg", sent.mass_kg.is_some()),
        ];
        check_unset(v.field("holdout"), set, "it is the track's");
        let of_track = self.track.holdout.as_ref();
        v1::Holdout {
            object: match of_track {
                Some(of_track) if sent.object.is_empty() => of_track.object.clone(),
                _ => sent.object,
            },
            up: sent.up.or(of_track.and_then(|of_track| of_track.up)),
            scale: of_track.and_then(|of_track| of_track.scale),
            mass_kg: of_track.and_then(|of_track| of_track.mass_kg),
            ..sent
        }
    }

    /// The receiver with the body of a frame.
    fn receiver(&self, body: &v1::Receiver, v: &Violations) -> v1::Receiver {
        let set = [
            ("rig", !body.rig.is_empty()),
            ("handedness", body.handedness != 0),
            ("scale", body.scale.is_some()),
            ("both_hands", body.both_hands),
        ];
        check_unset(v.field("receiver"), set, "it is the track's");
        let v1::Receiver {
            rig,
            handedness,
            scale,
            ..
        } = self.track.receiver.clone().unwrap_or_default();
        v1::Receiver {
            rig,
            handedness,
            scale,
            both_hands: false,
            ..*body
        }
    }

    /// When a frame was captured.
    fn capture_time(
        &self,
        sent: Option<prost_types::Duration>,
        violations: &Violations,
        doubts: &Violations,
    ) -> Option<Duration> {
        let name = "capture_time";
        let Some(sent) = sent else {
            if self.needs_time {
                doubts.add(name, "is missing; nothing can be predicted without it");
            }
            return None;
        };
        let captured = duration(violations.field(name), sent)?;
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

/// The receiver's hand must be one that the track may pose.
fn check_receiving_hand(sent: &v1::HandPose, query: &FindQuery, rigs: &RigStore, v: &Violations) {
    let field = v.field("receiving_hand");
    let frames = Frames::of_query(query, rigs);
    if let Some(hand) = posed_hand(field, sent, Place::InClient, AngleBounds::Rig, &frames) {
        // It may be the other hand than that of the grasp.
        check_is(field, &hand, &query.receiving_hand, true);
    }
}
