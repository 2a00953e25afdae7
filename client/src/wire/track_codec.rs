//! Tracks of moving givers.

use grasp_proto::v1;

use super::{
    Malformed,
    geometry_codec::{duration_from_wire, duration_to_wire, pose_from_wire, pose_to_wire, vector_to_wire},
    hand_codec::{hand_angles_to_wire, presenting_hand_to_wire},
    obstacle_codec::obstacle_to_wire,
    receiver_codec::receiver_to_wire,
    required,
    search_codec::{find_request_to_wire, grasp_from_wire},
    standing_codec::report_from_wire,
};
use crate::track::{PredictionError, TrackAnswer, TrackFrame, TrackPolicy, TrackSetup};

pub(crate) fn track_setup_to_wire(setup: &TrackSetup) -> v1::TrackSetup {
    let TrackSetup { holdout, policy } = setup;
    v1::TrackSetup {
        holdout: Some(v1::FindGraspRequest {
            client_from_object: None,
            presenting_hand: None,
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            ..find_request_to_wire(holdout)
        }),
        policy: Some(policy_to_wire(policy)),
    }
}

fn policy_to_wire(policy: &TrackPolicy) -> v1::TrackPolicy {
    let between = policy.least_time_between_changes;
    v1::TrackPolicy {
        better_by: policy.better_by,
        least_time_between_changes: (!between.is_zero()).then(|| duration_to_wire(between)),
        predict_ahead: policy.predict_ahead.map(duration_to_wire),
        detail: if policy.only_changes {
            v1::AnswerDetail::Changes
        } else {
            v1::AnswerDetail::Full
        }
        .into(),
        grace: policy.grace.map(duration_to_wire),
        may_change_hand: policy.may_change_hand,
    }
}

/// A frame of a client that has read so many answers.
pub(crate) fn track_frame_to_wire(frame: &TrackFrame, answers_read: u64) -> v1::TrackFrame {
    v1::TrackFrame {
        sequence: frame.sequence,
        capture_time: frame.capture_time.map(duration_to_wire),
        client_from_object: Some(pose_to_wire(frame.client_from_object)),
        presenting_hand: frame.presenting_hand.as_ref().map(presenting_hand_to_wire),
        other_hands: frame.other_hands.iter().map(presenting_hand_to_wire).collect(),
        obstacles: frame.obstacles.iter().map(obstacle_to_wire).collect(),
        receiving_hand: frame.receiving_hand.as_ref().map(hand_angles_to_wire),
        committed: frame.committed,
        up: frame.up.map(vector_to_wire),
        receiver: frame.receiver.map(receiver_to_wire),
        object: frame.object.clone().unwrap_or_default(),
        answers_read: Some(answers_read),
    }
}

pub(crate) fn track_answer_from_wire(response: v1::TrackHoldoutResponse) -> Result<TrackAnswer, Malformed> {
    let answer = required("answer", response.answer)?;
    let within = |malformed: Malformed| malformed.within("answer");
    Ok(TrackAnswer {
        sequence: answer.sequence,
        standing: required("standing", answer.standing)
            .and_then(|report| report_from_wire(report).map_err(|wrong| wrong.within("standing")))
            .map_err(within)?,
        grasp: answer
            .grasp
            .map(|grasp| grasp_from_wire(grasp).map_err(|wrong| wrong.within("grasp")))
            .transpose()
            .map_err(within)?,
        client_from_wrist: answer.client_from_wrist.map(|pose| pose_from_wire(Some(pose))),
        skipped_frames: answer.skipped_frames,
        server_time: required("server_time", answer.server_time)
            .and_then(|time| duration_from_wire("server_time", time))
            .map_err(within)?,
        last_prediction: answer.last_prediction.map(|error| PredictionError {
            sequence: error.sequence,
            object_distance: error.object_distance,
            object_angle: error.object_angle,
            giver_distance: error.giver_distance,
        }),
        score: answer.score,
        warnings: answer.warnings,
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{pose::Pose, search::FindRequest};

    #[test]
    fn a_setup_leaves_out_what_frames_contain() {
        let mut holdout = FindRequest::new("objects/remote");
        holdout.client_from_object = Pose::new(glam::Vec3::X, glam::Quat::IDENTITY);
        let setup = track_setup_to_wire(&TrackSetup {
            holdout,
            policy: TrackPolicy {
                better_by: Some(0.1),
                least_time_between_changes: Duration::from_millis(200),
                predict_ahead: Some(Duration::from_millis(30)),
                only_changes: true,
                ..TrackPolicy::default()
            },
        });
        let holdout = setup.holdout.unwrap();
        assert_eq!(
            (holdout.object.as_str(), holdout.client_from_object),
            ("objects/remote", None)
        );
        let policy = setup.policy.unwrap();
        assert_eq!(
            (policy.better_by, policy.detail()),
            (Some(0.1), v1::AnswerDetail::Changes)
        );
        assert_eq!(policy.least_time_between_changes.unwrap().nanos, 200_000_000);
        assert_eq!(policy.predict_ahead.unwrap().nanos, 30_000_000);
    }

    #[test]
    fn an_answer_without_a_report_is_malformed() {
        let answer = |answer| track_answer_from_wire(v1::TrackHoldoutResponse { answer });
        assert_eq!(answer(None).unwrap_err(), Malformed::missing("answer"));
        let empty = v1::TrackAnswer::default();
        assert_eq!(
            answer(Some(empty)).unwrap_err(),
            Malformed::missing("answer.standing")
        );
    }
}
