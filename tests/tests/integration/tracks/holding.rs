//! What becomes of the grasp while the giver moves.

use glam::Vec3;
use grasp_proto::v1::{self, StandingStatus};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};

use super::{Tracked, frame, pose_of, setup, status_of, swaying};
use crate::fixtures::milliseconds;

#[tokio::test(flavor = "multi_thread")]
async fn keeps_one_grasp_while_giver_and_object_move_together() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let first = track.ask(frame(0, swaying(0))).await;
    assert_eq!(status_of(&first), StandingStatus::Replanned);
    let found = first.grasp.expect("a grasp is found");
    for sequence in 1..60 {
        let answer = track.ask(frame(sequence, swaying(sequence))).await;
        assert_eq!(
            status_of(&answer),
            StandingStatus::Kept,
            "frame {sequence}: {answer:?}"
        );
        let grasp = answer.grasp.expect("answers are full");
        assert_eq!(
            (grasp.object_from_wrist, &grasp.digits, grasp.handedness),
            (found.object_from_wrist, &found.digits, found.handedness),
            "frame {sequence}"
        );
        let expected =
            pose_of(frame(sequence, swaying(sequence)).client_from_object) * pose_of(found.object_from_wrist);
        let wrist = pose_of(answer.client_from_wrist);
        assert!(
            wrist.position.distance(expected.position) < 1e-5,
            "frame {sequence}"
        );
        assert_eq!(answer.client_from_wrist, grasp.client_from_wrist);
        assert!(answer.score.is_some_and(|score| score > 0.0));
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn repeats_only_what_changed_if_asked_to() {
    let server = TestServer::start().await;
    let policy = v1::TrackPolicy {
        detail: v1::AnswerDetail::Changes.into(),
        ..Default::default()
    };
    let mut track = Tracked::remote(&server, policy).await;
    let first = track.ask(frame(0, swaying(0))).await;
    assert!(first.grasp.is_some());
    let second = track.ask(frame(1, swaying(1))).await;
    assert_eq!(status_of(&second), StandingStatus::Kept);
    assert!(second.grasp.is_none() && second.client_from_wrist.is_some());
    server.stop().await;
}

/// An obstacle as large as a fist in the palm of a grasp.
fn in_the_palm(answer: &v1::TrackAnswer) -> v1::Obstacle {
    let wrist = pose_of(answer.client_from_wrist);
    let middle = wrist.transform_point(Vec3::new(0.0, 0.02, -0.03));
    let point = |p: Vec3| {
        Some(v1::Vector3 {
            x: p.x,
            y: p.y,
            z: p.z,
        })
    };
    v1::Obstacle {
        shape: Some(v1::obstacle::Shape::Capsule(v1::CapsuleShape {
            client_start: point(middle),
            client_end: point(middle + Vec3::Y * 0.001),
            radius: 0.03,
            end_radius: None,
        })),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn replaces_what_something_gets_in_the_way_of_and_says_why() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let first = track.ask(frame(0, swaying(0))).await;
    let blocked = v1::TrackFrame {
        obstacles: vec![in_the_palm(&first)],
        ..frame(1, swaying(0))
    };
    let answer = track.ask(blocked.clone()).await;
    let standing = answer.standing.clone().unwrap();
    let fall = standing.fall.clone().expect("it fell");
    assert_eq!(fall.reason(), v1::FallReason::Obstacle, "{fall:?}");
    assert!(fall.figure.expect("a distance") < 0.0 && !fall.description.is_empty());
    assert_eq!(standing.status(), StandingStatus::Replanned, "{standing:?}");
    assert_ne!(
        answer.grasp.as_ref().unwrap().object_from_wrist,
        first.grasp.unwrap().object_from_wrist
    );
    // The new one stands.
    let next = v1::TrackFrame {
        sequence: 2,
        capture_time: Some(super::time_of(2)),
        ..blocked
    };
    let kept = track.ask(next).await;
    assert_eq!(status_of(&kept), StandingStatus::Kept);
    assert_eq!(
        kept.grasp.unwrap().object_from_wrist,
        answer.grasp.unwrap().object_from_wrist
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn gives_a_committed_grasp_up_until_the_hand_no_longer_closes() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let first = track.ask(frame(0, swaying(0))).await;
    let committed = |sequence| v1::TrackFrame {
        committed: true,
        ..frame(sequence, swaying(0))
    };
    let kept = track.ask(committed(1)).await;
    assert_eq!(status_of(&kept), StandingStatus::Kept);
    let blocked = v1::TrackFrame {
        obstacles: vec![in_the_palm(&first)],
        ..committed(2)
    };
    let aborted = track.ask(blocked).await;
    assert_eq!(status_of(&aborted), StandingStatus::Aborted);
    assert!(aborted.grasp.is_none() && aborted.client_from_wrist.is_none());
    let report = aborted.standing.unwrap();
    assert_eq!(report.fall.as_ref().unwrap().reason(), v1::FallReason::Obstacle);
    let withdrawal = report.withdrawal.clone().expect("a pose to withdraw to");
    let [from, to] = [
        first.grasp.unwrap().object_from_wrist,
        withdrawal.object_from_wrist,
    ]
    .map(|wrist| pose_of(wrist).position);
    assert!((0.02..0.5).contains(&from.distance(to)), "{from} to {to}");
    // Nothing is in the way any more, but the hand has begun to withdraw.
    let still = track.ask(committed(3)).await.standing.unwrap();
    assert_eq!((still.status(), still.fall), (StandingStatus::Aborted, None));
    assert_eq!(still.withdrawal, report.withdrawal);
    let again = track.ask(frame(4, swaying(0))).await;
    assert_eq!(status_of(&again), StandingStatus::Kept);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_where_the_object_will_be_and_says_how_far_off_that_was() {
    let server = TestServer::start().await;
    let ahead = 33.333e-3;
    let policy = v1::TrackPolicy {
        predict_ahead: Some(milliseconds(33)),
        ..Default::default()
    };
    let mut track = Tracked::remote(&server, policy).await;
    let drifting = |time: f32| Pose::from_position(Vec3::new(0.4 * time, 0.0, -0.2 * time));
    let mut last = None;
    let mut found = Pose::IDENTITY;
    for sequence in 0..12 {
        let time = sequence as f32 * 11.111e-3;
        let answer = track.ask(frame(sequence, drifting(time))).await;
        if let Some(grasp) = &answer.grasp {
            found = pose_of(grasp.object_from_wrist);
        }
        let held = pose_of(frame(0, Pose::IDENTITY).client_from_object);
        let expected = drifting(time + if sequence == 0 { 0.0 } else { ahead }) * held * found;
        let wrist = pose_of(answer.client_from_wrist);
        assert!(
            wrist.position.distance(expected.position) < 5e-4,
            "frame {sequence}"
        );
        last = answer.last_prediction;
    }
    let error = last.expect("predictions have come true");
    assert!(
        error.object_distance < 1e-4 && error.object_angle < 1e-3,
        "{error:?}"
    );
    assert!(
        error.giver_distance.is_some_and(|distance| distance < 1e-4),
        "{error:?}"
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_answers_as_calls_with_a_standing_grasp_do() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let found = track.ask(frame(0, swaying(0))).await.grasp.unwrap();
    let mut client = server.grasps().await;
    for sequence in 1..10 {
        let moved = frame(sequence, swaying(sequence));
        let request = v1::FindGraspRequest {
            client_from_object: moved.client_from_object,
            presenting_hand: moved.presenting_hand.clone(),
            standing: Some(v1::StandingGrasp {
                hand: Some(v1::HandAtObject {
                    rig: found.rig.clone(),
                    handedness: found.handedness,
                    hand_scale: None,
                    object_from_wrist: found.object_from_wrist,
                    digits: found.digits.clone(),
                }),
                ..Default::default()
            }),
            ..setup(v1::TrackPolicy::default()).holdout.unwrap()
        };
        let asked = client.find_grasp(request).await.unwrap().into_inner();
        let tracked = track.ask(moved).await;
        assert_eq!(
            (asked.grasp, asked.standing),
            (tracked.grasp, tracked.standing),
            "frame {sequence}"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_that_is_elsewhere_is_where_ways_begin() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let found = track.ask(frame(0, swaying(0))).await.grasp.unwrap();
    let away = Pose::from_position(Vec3::X * 0.25) * pose_of(found.client_from_wrist);
    let hand = v1::HandAngles {
        rig: found.rig.clone(),
        handedness: found.handedness,
        client_from_wrist: Some(wire_pose(away)),
        digits: found.digits.clone(),
        hand_scale: None,
    };
    let moved = v1::TrackFrame {
        receiving_hand: Some(hand.clone()),
        ..frame(1, swaying(0))
    };
    let answer = track.ask(moved).await;
    let way = answer.standing.unwrap().way.expect("a way to the grasp");
    assert!((way.distance - 0.25).abs() < 1e-4 && way.angle < 1e-3, "{way:?}");
    let wrong = v1::TrackFrame {
        receiving_hand: Some(v1::HandAngles {
            rig: "thesis".to_owned(),
            ..hand
        }),
        ..frame(2, swaying(0))
    };
    let answer = track.ask(wrong).await;
    assert!(
        answer.warnings[0].starts_with("frame.receiving_hand.rig is"),
        "{:?}",
        answer.warnings
    );
    server.stop().await;
}
