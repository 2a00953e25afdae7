//! A giver who moves: what stays the same, frames, and answers to the latest frame.

use std::time::Duration;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    hand::{HandAngles, PresentingHand},
    json,
    obstacle::Obstacle,
    pose::Pose,
    receiver::Receiver,
    search::{FindRequest, Grasp},
    standing::StandingReport,
};

/// What stays the same while a giver moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackSetup {
    /// Object, rigs, constraints, convention, and how to search. What frames contain (the object's pose, hands, obstacles) is ignored;
    /// `standing` is the grasp to begin with, of which only the hand may be set; `object`, `up` and `receiver` apply until a frame
    /// replaces them. `budget` limits the search for a frame; none: 8 ms.
    pub holdout: FindRequest,
    /// How to hold on to a grasp.
    #[serde(default)]
    pub policy: TrackPolicy,
}

/// How a track holds on to its grasp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackPolicy {
    /// How much higher the score of another grasp must be to replace a valid one, from 0 to 1; none: a valid grasp is kept.
    pub better_by: Option<f32>,
    /// Least time between a change of grasp and a change to a better one, up to a minute. What is no longer valid is replaced at
    /// once.
    #[serde(rename = "least_seconds_between_changes", with = "json::seconds")]
    pub least_time_between_changes: Duration,
    /// How late answers are when they are shown, up to half a second: frames are answered as they will be then; none: as they are.
    #[serde(rename = "predict_ahead_seconds", with = "json::optional_seconds")]
    pub predict_ahead: Option<Duration>,
    /// Answers repeat only what changed: the whole grasp when it did, else the wrist.
    pub only_changes: bool,
    /// How long a grasp is kept that comes up to a millimetre too close to another person's hand, and whether it is for a single frame
    /// however close, up to 5 s; none: 0.2 s.
    #[serde(rename = "grace_seconds", with = "json::optional_seconds")]
    pub grace: Option<Duration>,
    /// Re-plans may change to the receiver's other hand; otherwise the hand of the first grasp stays.
    pub may_change_hand: bool,
}

/// Giver, object and receiver at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackFrame {
    /// Distinguishes frames; larger than that of the frame before.
    pub sequence: u64,
    /// When it was captured, since any moment; earlier than in the previous frame if the clock was restarted. Nothing is predicted without it.
    #[serde(default, rename = "capture_seconds", with = "json::optional_seconds")]
    pub capture_time: Option<Duration>,
    /// The object's frame in the client's frame.
    #[serde(default)]
    pub client_from_object: Pose,
    /// The giver's hand; none: nobody holds the object. Joints that have lost tracking: it is where it was last, at the object.
    #[serde(default)]
    pub presenting_hand: Option<PresentingHand>,
    /// Up to 3 further hands to keep clear of.
    #[serde(default)]
    pub other_hands: Vec<PresentingHand>,
    /// Up to 64 obstacles to keep clear of.
    #[serde(default)]
    pub obstacles: Vec<Obstacle>,
    /// Where the receiver's hand is now: re-plans prefer grasps near it; none: at the grasp of the last answer.
    #[serde(default)]
    pub receiving_hand: Option<HandAngles>,
    /// The hand is closing: the grasp is only kept, adjusted, or given up with a pose to withdraw to.
    #[serde(default)]
    pub committed: bool,
    /// Direction opposite to gravity, in the client's frame; none: as in the frame before.
    #[serde(default)]
    pub up: Option<Vec3>,
    /// The receiver's body; none: as in the frame before.
    #[serde(default)]
    pub receiver: Option<Receiver>,
    /// The object that is held out from now on; none: as in the frame before.
    #[serde(default)]
    pub object: Option<String>,
}

impl TrackFrame {
    /// The frame of a holdout: its object's pose, hands and obstacles.
    pub fn of(sequence: u64, holdout: &FindRequest) -> Self {
        Self {
            sequence,
            client_from_object: holdout.client_from_object,
            presenting_hand: holdout.presenting_hand.clone(),
            other_hands: holdout.other_hands.clone(),
            obstacles: holdout.obstacles.clone(),
            ..Self::default()
        }
    }
}

/// How far off a prediction was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PredictionError {
    /// The first frame at or after the predicted time.
    pub sequence: u64,
    /// Distance of the object's origin from where it was predicted. Metres, or centimetres in the Unreal convention.
    pub object_distance: f32,
    /// Angle between the predicted and the real pose of the object, in radians.
    pub object_angle: f32,
    /// Largest distance of a joint of the giver's hand from where it was predicted, in the same unit; none unless its joints are
    /// known.
    pub giver_distance: Option<f32>,
}

/// The answer to a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackAnswer {
    /// The frame's number.
    pub sequence: u64,
    /// What became of the grasp. The first one found is replanned.
    pub standing: StandingReport,
    /// The grasp; none without one, and with [`TrackPolicy::only_changes`] if only the wrist has moved.
    pub grasp: Option<Grasp>,
    /// The wrist's joint frame in the client's frame; none without a grasp.
    pub client_from_wrist: Option<Pose>,
    /// Number of frames that this one overtook.
    pub skipped_frames: u32,
    /// Time from the frame's arrival at the server to its answer.
    #[serde(rename = "server_seconds", with = "json::seconds")]
    pub server_time: Duration,
    /// How far off the last prediction was.
    pub last_prediction: Option<PredictionError>,
    /// The grasp's score.
    pub score: Option<f32>,
    /// What is wrong with the frame, and what the server repaired.
    pub warnings: Vec<String>,
}
