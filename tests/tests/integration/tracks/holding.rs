//! What becomes of the grasp while the giver moves.

use glam::Vec3;
use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};

use super::{Tracked, assert_wrong, frame, held, pose_of, remote, swaying, wrist_of};
use crate::fixtures::milliseconds;

#[tokio::test(flavor = "multi_thread")]
async fn keeps_one_grasp_while_giver_and_object_move_together() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let first = track.ask(frame(0, swaying(0))).await;
    assert_eq!(first.status(), CurrentGraspStatus::Replanned);
    let found = first.grasp.expect("a grasp is found");
    for sequence in 1..60 {
        let answer = track.ask(frame(sequence, swaying(sequence))).await;
        assert_eq!(
            answer.status(),
            CurrentGraspStatus::Kept,
            "frame {sequence}: {answer:?}"
        );
        let grasp = answer.grasp.expect("answers are full");
        let [hand, before] = [&grasp, &found].map(|grasp| grasp.hand.as_ref().expect("it is set"));
        assert_eq!(
            (hand.object_from_wrist, hand.digits(), hand.handedness),
            (before.object_from_wrist, before.digits(), before.handedness),
            "frame {sequence}"
        );
        let client_from_object = frame(sequence, swaying(sequence)).client_from_object();
        let expected = pose_of(Some(client_from_object)) * pose_of(hand.object_from_wrist);
        let wrist = pose_of(hand.client_from_wrist);
        assert!(
            wrist.position.distance(expected.position) < 1e-5,
            "frame {sequence}"
        );
        assert!(grasp.score.is_some_and(|score| score > 0.0));
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn repeats_only_what_changed_if_asked_to() {
    let server = TestServer::start().await;
    let mut track = remote();
    track.output_mut().changes_only = true;
    let mut track = Tracked::of(&server, track).await;
    let first = track.ask(frame(0, swaying(0))).await.grasp.expect("a grasp");
    assert!(!first.contacts.is_empty());
    let second = track.ask(frame(1, swaying(1))).await;
    assert_eq!(second.status(), CurrentGraspStatus::Kept);
    let kept = second.grasp.expect("its wrist");
    let (hand, before) = (kept.hand.clone().unwrap(), first.hand.unwrap());
    assert_eq!(
        (&hand.rig, hand.handedness, hand.object_from_wrist),
        (&before.rig, before.handedness, before.object_from_wrist)
    );
    assert!(hand.client_from_wrist.is_some() && hand.client_from_wrist != before.client_from_wrist);
    assert!(kept.score.is_some());
    assert!(kept.contacts.is_empty() && hand.joints.is_empty() && hand.digits() == [None; 5]);
    server.stop().await;
}

/// An obstacle as large as a fist in the palm of a grasp.
fn in_the_palm(answer: &v1::TrackAnswer) -> v1::Shape {
    let middle = wrist_of(answer).transform_point(Vec3::new(0.0, 0.02, -0.03));
    v1::Shape::capsule(middle, middle + Vec3::Y * 0.001, 0.03)
}

#[tokio::test(flavor = "multi_thread")]
async fn replaces_what_something_gets_in_the_way_of_and_says_why() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let first = track.ask(frame(0, swaying(0))).await;
    let blocked = held(frame(1, swaying(0)), |holdout| {
        holdout.obstacles = vec![in_the_palm(&first)];
    });
    let answer = track.ask(blocked.clone()).await;
    let current = answer.current.clone().unwrap();
    let failed = current.failed_check.clone().expect("it failed a check");
    assert_eq!(failed.check(), v1::Check::ObstacleClearance, "{failed:?}");
    assert!(failed.value.expect("a distance") < 0.0 && !failed.description.is_empty());
    assert_eq!(current.status(), CurrentGraspStatus::Replanned, "{current:?}");
    assert_ne!(
        answer.grasp.as_ref().unwrap().object_from_wrist(),
        first.grasp.unwrap().object_from_wrist()
    );
    // The new one is kept.
    let next = v1::TrackFrame {
        sequence: 2,
        ..blocked
    }
    .captured_at(super::time_of(2));
    let kept = track.ask(next).await;
    assert_eq!(kept.status(), CurrentGraspStatus::Kept);
    assert_eq!(
        kept.grasp.unwrap().object_from_wrist(),
        answer.grasp.unwrap().object_from_wrist()
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn gives_a_committed_grasp_up_until_the_hand_no_longer_closes() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let first = track.ask(frame(0, swaying(0))).await;
    let committed = |sequence| v1::TrackFrame {
        committed: true,
        ..frame(sequence, swaying(0))
    };
    let kept = track.ask(committed(1)).await;
    assert_eq!(kept.status(), CurrentGraspStatus::Kept);
    let blocked = held(committed(2), |holdout| {
        holdout.obstacles = vec![in_the_palm(&first)];
    });
    let aborted = track.ask(blocked).await;
    assert_eq!(aborted.status(), CurrentGraspStatus::Aborted);
    assert!(aborted.grasp.is_none());
    let report = aborted.current.unwrap();
    let failed = report.failed_check.as_ref().unwrap();
    assert_eq!(failed.check(), v1::Check::ObstacleClearance);
    let withdrawal = report.withdrawal.clone().expect("a pose to withdraw to");
    let [from, to] = [
        first.grasp.unwrap().object_from_wrist(),
        withdrawal.object_from_wrist,
    ]
    .map(|wrist| pose_of(wrist).position);
    assert!((0.02..0.5).contains(&from.distance(to)), "{from} to {to}");
    // Nothing is in the way any more, but the hand has begun to withdraw.
    let still = track.ask(committed(3)).await.current.unwrap();
    assert_eq!(
        (still.status(), still.failed_check),
        (CurrentGraspStatus::Aborted, None)
    );
    assert_eq!(still.withdrawal, report.withdrawal);
    let again = track.ask(frame(4, swaying(0))).await;
    assert_eq!(again.status(), CurrentGraspStatus::Kept);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_where_the_object_will_be_and_says_how_far_off_that_was() {
    let server = TestServer::start().await;
    let ahead = 33.333e-3;
    let track = v1::Track {
        prediction_horizon: Some(milliseconds(33)),
        ..remote()
    };
    let mut track = Tracked::of(&server, track).await;
    let drifting = |time: f32| Pose::from_position(Vec3::new(0.4 * time, 0.0, -0.2 * time));
    let mut last = None;
    let mut found = Pose::IDENTITY;
    for sequence in 0..12 {
        let time = sequence as f32 * 11.111e-3;
        let answer = track.ask(frame(sequence, drifting(time))).await;
        if let Some(grasp) = &answer.grasp {
            found = pose_of(grasp.object_from_wrist());
        }
        let held = pose_of(Some(frame(0, Pose::IDENTITY).client_from_object()));
        let expected = drifting(time + if sequence == 0 { 0.0 } else { ahead }) * held * found;
        assert!(
            wrist_of(&answer).position.distance(expected.position) < 5e-4,
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
async fn a_track_answers_as_calls_with_a_current_grasp_do() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let found = track.ask(frame(0, swaying(0))).await.grasp.unwrap();
    let mut client = server.grasps().await;
    let v1::Track {
        holdout,
        receiver,
        search,
        ..
    } = remote();
    let object = holdout.unwrap().object;
    for sequence in 1..10 {
        let moved = frame(sequence, swaying(sequence));
        let holdout = held(moved.clone(), |holdout| holdout.object.clone_from(&object));
        let request = v1::FindGraspRequest {
            holdout: holdout.holdout,
            receiver: receiver.clone(),
            search,
            current: Some(found.current()),
            ..Default::default()
        };
        let asked = client.find_grasp(request).await.unwrap().into_inner();
        let tracked = track.ask(moved).await;
        assert_eq!(
            (asked.grasp(), asked.current.as_ref()),
            (tracked.grasp.as_ref(), tracked.current.as_ref()),
            "frame {sequence}"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_that_is_elsewhere_is_where_ways_begin() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let found = track.ask(frame(0, swaying(0))).await;
    let away = Pose::from_position(Vec3::X * 0.25) * wrist_of(&found);
    // Of its two wrists, that in the client's frame counts.
    let hand = v1::HandPose {
        client_from_wrist: Some(wire_pose(away)),
        ..found.grasp.unwrap().hand.unwrap()
    };
    let at = |sequence, hand: v1::HandPose| v1::TrackFrame {
        receiving_hand: Some(hand),
        ..frame(sequence, swaying(0))
    };
    let answer = track.ask(at(1, hand.clone())).await;
    let motion = answer.current.unwrap().motion.expect("a way to the grasp");
    assert!(
        (motion.distance - 0.25).abs() < 1e-4 && motion.angle < 1e-3,
        "{motion:?}"
    );
    let wrong = v1::HandPose {
        rig: "rigs/thesis".to_owned(),
        ..hand
    };
    assert_wrong(&track.ask(at(2, wrong)).await, "receiving_hand.rig is");
    server.stop().await;
}
