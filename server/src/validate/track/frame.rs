//! Checks the frames of a track one after the other. Hands may have lost tracking for some: headsets send zeros then, or joints in
//! impossible places.

use std::time::{Duration, Instant};

use grasp_proto::v1::{self, presenting_hand::Form};

use super::sentences;
use crate::{
    error::ServiceError,
    rigs::store::RigStore,
    validate::{
        Field, FindQuery, GiverHand, Violations, check_unset,
        current_grasp::check_is,
        duration,
        find_grasp::checked_query,
        hand::{AngleBounds, Place, posed_hand, presenting_hand},
        holdout::Frames,
        quoted,
    },
};

/// Budget of the search for a frame if the track names none: the rest of a frame at 90 Hz.
const FRAME_BUDGET: Duration = Duration::from_millis(8);

#[derive(Debug)]
pub(crate) struct Frame {
    pub sequence: u64,
    /// When it was captured, on the client's clock.
    pub captured: Option<Duration>,
    /// True if that clock was restarted.
    pub restarts_clock: bool,
    pub arrived: Instant,
    pub query: FindQuery,
    pub receiving_hand: Option<v1::HandPose>,
    pub is_committed: bool,
    /// Faults that do not prevent an answer.
    pub warnings: Vec<String>,
}

#[derive(Debug)]
pub(crate) struct WrongFrame {
    pub sequence: u64,
    pub arrived: Instant,
    pub warnings: Vec<String>,
}

#[derive(Debug)]
pub(crate) enum Latest {
    Frame(Box<Frame>),
    Wrong(WrongFrame),
}

impl Latest {
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

#[derive(Debug)]
pub(crate) struct TrackIntake {
    /// The track, as changed by frames.
    track: v1::Track,
    sequence: Option<u64>,
    captured: Option<Duration>,
    /// Where hands were when they were tracked last.
    hands: LastHands,
    /// True if frames should have a time.
    needs_time: bool,
    /// True if frames may overtake each other on their way.
    may_overtake: bool,
}

impl TrackIntake {
    /// The intake of a checked track. `may_overtake` if each frame comes in a call of its own.
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

    /// Checks a frame; `None` if a later one came before it, so that it may be ignored. A wrong frame changes nothing.
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
        let checked = match self.checked(frame, arrived, rigs, object_exists) {
            Err(ServiceError::Invalid(violations)) => Latest::Wrong(WrongFrame {
                sequence,
                arrived,
                warnings: sentences(violations),
            }),
            checked => checked?,
        };
        Ok(Some(checked))
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
        let v = &Violations::default();
        let doubts = &Violations::default();
        if let Some(last) = self.sequence.filter(|&last| sequence <= last) {
            let text = format_args!("is {sequence}; it should be more than {last}, that of the frame before");
            doubts.add("sequence", text);
        }
        let captured = self.capture_time(frame.capture_time, v, doubts);
        let restarts_clock = captured.is_some() && captured < self.captured;
        let mut holdout = self.holdout(frame.holdout.unwrap_or_default(), v);
        let receiver = match frame.receiver {
            Some(body) => Some(self.receiver(&body, v)),
            None => self.track.receiver.clone(),
        };
        let lost = LostHands::take_from(doubts.field("holdout"), &mut holdout, self.track.output, rigs.1);
        let (object, up) = (holdout.object.clone(), holdout.up);
        let parts = parts(&self.track, Some(holdout), receiver.clone());
        let Some(mut query) = checked_query(parts, rigs, &object_exists, v) else {
            return v.finish_some(None);
        };
        // The object that the track has is looked up when the frame is answered.
        let before = self.track.holdout.get_or_insert_default();
        if object != before.object && !object_exists(&query.object_id) {
            let text = format_args!("is {}, which does not exist", quoted(&object));
            v.field("holdout").child("object").add(text);
        }
        query.limits.budget = query.limits.budget.or(Some(FRAME_BUDGET));
        if let Some(hand) = &frame.receiving_hand {
            check_receiving_hand(hand, &query, rigs.1, v);
        }
        v.finish(())?;
        let warnings = sentences(doubts.take_listed());
        self.sequence = Some(sequence);
        if lost.giver && !self.hands.is_known {
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

    fn holdout(&self, sent: v1::Holdout, v: &Violations) -> v1::Holdout {
        let set = [
            ("scale", sent.scale.is_some()),
            ("mass_kg", sent.mass_kg.is_some()),
        ];
        check_unset(v.field("holdout"), set, "it is the track's");
        let of_track = self.track.holdout.clone().unwrap_or_default();
        v1::Holdout {
            object: if sent.object.is_empty() {
                of_track.object
            } else {
                sent.object
            },
            up: sent.up.or(of_track.up),
            scale: of_track.scale,
            mass_kg: of_track.mass_kg,
            ..sent
        }
    }

    fn receiver(&self, body: &v1::Receiver, v: &Violations) -> v1::Receiver {
        let set = [
            ("rig", !body.rig.is_empty()),
            ("handedness", body.handedness != 0),
            ("scale", body.scale.is_some()),
            ("both_hands", body.both_hands),
        ];
        check_unset(v.field("receiver"), set, "it is the track's");
        let of_track = self.track.receiver.clone().unwrap_or_default();
        v1::Receiver {
            rig: of_track.rig,
            handedness: of_track.handedness,
            scale: of_track.scale,
            both_hands: false,
            ..*body
        }
    }

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
        if let Some(before) = self.captured.filter(|&before| captured < before) {
            let [now, before] = [captured, before].map(|time| time.as_secs_f64());
            let text = format_args!(
                "is {now} s, before {before} s, that of the frame before; what is moving is known anew from this one on"
            );
            doubts.add(name, text);
        }
        Some(captured)
    }
}

/// The receiver's hand must be one that the track may pose.
fn check_receiving_hand(sent: &v1::HandPose, query: &FindQuery, rigs: &RigStore, v: &Violations) {
    let field = v.field("receiving_hand");
    let frames = Frames::of_query(query, rigs);
    if let Some(hand) = posed_hand(field, sent, Place::InClient, AngleBounds::Rig, &frames) {
        // It may be the hand opposite to the grasp's.
        check_is(field, &hand, &query.receiving_hand, true);
    }
}

#[derive(Debug, Default)]
struct LastHands {
    /// True after a frame in which no hand was lost.
    is_known: bool,
    /// The giver's, in the object's frame: it holds the object.
    giver: Option<GiverHand>,
    /// The others, in the client's frame.
    others: Vec<GiverHand>,
}

#[derive(Debug, Default)]
struct LostHands {
    giver: bool,
    /// Their places in the frame.
    others: Vec<usize>,
}

impl LostHands {
    /// Takes the hands that have lost tracking out of a holdout, and adds the reasons.
    fn take_from(
        parent: Field<'_>,
        holdout: &mut v1::Holdout,
        output: Option<v1::OutputOptions>,
        rigs: &RigStore,
    ) -> Self {
        let frames = Frames::of(Some(holdout), output, rigs);
        let field = parent.child("presenting_hand");
        let giver = holdout
            .presenting_hand
            .take_if(|hand| is_lost(field, hand, &frames));
        let mut others = Vec::new();
        for (place, hand) in std::mem::take(&mut holdout.other_hands).into_iter().enumerate() {
            if is_lost(parent.child("other_hands").at(place), &hand, &frames) {
                others.push(place);
            } else {
                holdout.other_hands.push(hand);
            }
        }
        Self {
            giver: giver.is_some(),
            others,
        }
    }

    /// Puts them where they were last seen. Other hands that were never seen stay absent.
    fn put_back(&self, last: &LastHands, query: &mut FindQuery) {
        if self.giver
            && let Some(mut giver) = last.giver.clone()
        {
            giver.move_by(query.client_from_object);
            query.presenting_hand = Some(giver);
        }
        for &place in &self.others {
            if let Some(hand) = last.others.get(place) {
                query
                    .other_hands
                    .insert(place.min(query.other_hands.len()), hand.clone());
            }
        }
    }
}

impl LastHands {
    fn learn(&mut self, query: &FindQuery) {
        let object_from_client = query.client_from_object.inverse();
        self.is_known = true;
        self.giver = query.presenting_hand.clone().map(|mut giver| {
            if let GiverHand::Jointed(hand) = &mut giver {
                hand.warnings.clear();
            }
            giver.move_by(object_from_client);
            giver
        });
        self.others.clone_from(&query.other_hands);
    }
}

/// True if a hand is well-formed but in an impossible place. Adds the reason.
fn is_lost(field: Field<'_>, sent: &v1::PresentingHand, frames: &Frames<'_>) -> bool {
    let is_posed = match &sent.form {
        // A full or empty list of joints, of a known side.
        Some(Form::Joints(sent))
            if sent.handedness() != v1::Handedness::Unspecified
                && matches!(sent.joints.len(), 0 | 25 | 26) =>
        {
            false
        }
        Some(Form::Pose(_)) => true,
        Some(Form::Joints(_) | Form::Mesh(_)) | None => return false,
    };
    let doubts = field.violations();
    let before = doubts.len();
    presenting_hand(field, sent.clone(), frames);
    let is_lost = doubts.len() > before && (!is_posed || doubts.are_all_of("client_from_wrist", before));
    if !is_lost {
        doubts.truncate(before);
    }
    is_lost
}
