//! Checks tracks: their fixed part, and each frame.

mod frame;

use std::time::Duration;

use grasp_proto::v1;

use super::{
    Violations, check_unset, check_within, current_grasp::SCORE_GAINS, duration, find_grasp::checked_query,
    requirements::check_no_experiment, searches::check_one_hand,
};
use crate::{
    convention::Convention,
    error::{ServiceError, Violation},
    rigs::store::RigStore,
};

pub(crate) use frame::{Frame, Latest, TrackIntake};

/// Longest least time between changes.
const MAX_DWELL: Duration = Duration::from_mins(1);

/// How long a grasp is kept that comes a little too close to a hand, if the track does not say: a swaying hand is back by then.
const GRACE: Duration = Duration::from_millis(200);
const MAX_GRACE: Duration = Duration::from_secs(5);

/// Farthest prediction: people do not move at one velocity for longer.
const MAX_HORIZON: Duration = Duration::from_millis(500);

#[derive(Debug)]
pub(crate) struct TrackQuery {
    pub intake: TrackIntake,
    pub policy: TrackPolicy,
    pub object_id: String,
    pub convention: Convention,
    pub current: Option<v1::HandPose>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackPolicy {
    /// How much higher the score of another grasp must be to replace a valid one; `None` if never.
    pub min_score_gain: Option<f32>,
    /// Least time between a change and one to a better grasp.
    pub min_dwell: Duration,
    /// How far ahead of its capture a frame is answered.
    pub horizon: Option<Duration>,
    /// How long a grasp is kept that comes a little too close to a hand; zero: not even for a frame.
    pub grace: Duration,
    pub may_change_hand: bool,
}

/// Checks a track. `may_overtake` if each of its frames comes in a call of its own.
pub(crate) fn track_query(
    mut track: v1::Track,
    may_overtake: bool,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<TrackQuery, ServiceError> {
    let v = &Violations::default();
    let policy = track_policy(&track, v);
    check_fixed(&track, v);
    let current = track.current.take();
    let mut parts = frame::parts(&track, track.holdout.clone(), track.receiver.clone());
    parts.current = current.clone().map(|grasp| v1::CurrentGrasp {
        grasp: Some(grasp),
        ..Default::default()
    });
    let query = checked_query(parts, (default_rig, rigs), object_exists, v);
    v.move_path("current.grasp", "current");
    let query = v.finish_some(query)?;
    Ok(TrackQuery {
        current,
        intake: TrackIntake::new(track, policy.horizon.is_some(), may_overtake),
        policy,
        object_id: query.object_id,
        convention: query.convention,
    })
}

pub(crate) fn sentences(violations: Vec<Violation>) -> Vec<String> {
    let sentence = |of: Violation| format!("{} {}", of.field, of.description).trim_start().to_owned();
    violations.into_iter().map(sentence).collect()
}

fn check_fixed(track: &v1::Track, v: &Violations) {
    if let Some(holdout) = &track.holdout {
        let of_frames = [
            ("client_from_object", holdout.client_from_object.is_some()),
            ("presenting_hand", holdout.presenting_hand.is_some()),
            ("other_hands", !holdout.other_hands.is_empty()),
            ("obstacles", !holdout.obstacles.is_empty()),
        ];
        check_unset(v.field("holdout"), of_frames, "it comes with frames");
    }
    check_one_hand(track.receiver.as_ref(), v);
    let is_replay = track.search.is_some_and(|search| search.replay_attempt.is_some());
    let why_not = "tracks cannot be replayed, use FindGrasp";
    check_unset(v.field("search"), [("replay_attempt", is_replay)], why_not);
    check_no_experiment(track.requirements.as_ref(), v);
}

fn track_policy(track: &v1::Track, v: &Violations) -> TrackPolicy {
    if let Some(gain) = track.min_score_gain {
        check_within(v.field("min_score_gain"), gain, SCORE_GAINS);
    }
    let at_most = |name, sent: Option<prost_types::Duration>, longest: Duration| {
        let field = v.field(name);
        let time = duration(field, sent?)?;
        let [shown, most] = [time, longest].map(|time| time.as_secs_f64());
        let text = format_args!("is {shown} s; it must be at most {most} s");
        field.check(time <= longest, text);
        Some(time)
    };
    TrackPolicy {
        min_dwell: at_most("min_dwell", track.min_dwell, MAX_DWELL).unwrap_or_default(),
        horizon: at_most("prediction_horizon", track.prediction_horizon, MAX_HORIZON)
            .filter(|horizon| !horizon.is_zero()),
        grace: at_most("grace", track.grace, MAX_GRACE).unwrap_or(GRACE),
        min_score_gain: track.min_score_gain,
        may_change_hand: track.may_change_hand,
    }
}
