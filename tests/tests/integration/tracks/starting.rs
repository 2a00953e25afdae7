//! What a track begins with, and what it changes to.

use glam::Vec3;
use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};

use super::{Tracked, assert_wrong, created::Created, frame, held, pose_of, remote};

/// A track of the remote that begins with a hand.
fn track_with(hand: v1::HandPose) -> v1::Track {
    v1::Track {
        current: Some(hand),
        ..remote()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_begins_with_a_current_grasp() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await.grasp.expect("a grasp");
    let hand = found.hand.clone().expect("it is set");
    let mut track = track_with(hand.clone());
    track.output_mut().changes_only = true;
    let mut next = Tracked::of(&server, track).await;
    let answer = next.ask(frame(0, Pose::IDENTITY)).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Kept);
    let kept = answer.grasp.expect("it is kept");
    assert_eq!(kept.object_from_wrist(), found.object_from_wrist());
    assert!(!kept.contacts.is_empty(), "the first answer is whole");
    let answer = next.ask(frame(1, Pose::IDENTITY)).await;
    assert!(answer.grasp.expect("it is kept").contacts.is_empty());
    // One that is not valid is followed by one near it.
    let wrist = pose_of(found.object_from_wrist());
    let deep = v1::HandPose {
        object_from_wrist: Some(wire_pose(wrist * Pose::from_position(Vec3::Y * -0.03))),
        ..hand
    };
    let mut next = Tracked::of(&server, track_with(deep)).await;
    let answer = next.ask(frame(0, Pose::IDENTITY)).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Replanned);
    let current = answer.current.unwrap();
    assert!(
        current.failed_check.is_some() && current.motion.is_some(),
        "{current:?}"
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_current_grasp_in_the_clients_frame_is_at_the_object_of_the_first_frame() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await.grasp.expect("a grasp");
    let hand = v1::HandPose {
        object_from_wrist: None,
        ..found.hand.clone().expect("it is set")
    };
    let mut next = Tracked::of(&server, track_with(hand)).await;
    let before = pose_of(found.object_from_wrist());
    for sequence in 0..3 {
        let moved = Pose::from_position(Vec3::X * 0.1 * sequence as f32);
        let answer = next.ask(frame(sequence, moved)).await;
        assert_eq!(answer.status(), CurrentGraspStatus::Kept, "{sequence}");
        let kept = pose_of(answer.grasp.expect("it is kept").object_from_wrist());
        assert!(kept.position.distance(before.position) < 1e-5, "{sequence}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_changes_its_object_and_begins_without_a_grasp_there() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    for sequence in 0..3 {
        track.ask(frame(sequence, Pose::IDENTITY)).await;
    }
    let free = |sequence| {
        held(frame(sequence, Pose::IDENTITY), |holdout| {
            holdout.presenting_hand = None;
        })
    };
    let other = |sequence| {
        held(free(sequence), |holdout| {
            "objects/scissors".clone_into(&mut holdout.object);
        })
    };
    let answer = track.ask(other(3)).await;
    let current = answer.current.clone().unwrap();
    assert_eq!(
        (current.status(), current.failed_check),
        (CurrentGraspStatus::Replanned, None)
    );
    let grasp = answer.grasp.expect("a grasp");
    // It is one of the scissors.
    let request = |object: &str| {
        v1::ValidateGraspRequest::new(object)
            .with_client_from_object(other(3).client_from_object())
            .with_pose(grasp.hand.clone().expect("it is set"))
    };
    let mut client = server.grasps().await;
    let valid = client.validate_grasp(request("objects/scissors")).await.unwrap();
    assert!(valid.into_inner().valid);
    let valid = client.validate_grasp(request("objects/remote")).await.unwrap();
    assert!(!valid.into_inner().valid);
    // It stays the object of later frames.
    let kept = track.ask(free(4)).await;
    assert_eq!(kept.status(), CurrentGraspStatus::Kept);
    assert_eq!(kept.grasp.unwrap().object_from_wrist(), grasp.object_from_wrist());
    // Pushed frames do the same.
    let pushed = Created::remote(&server).await;
    pushed.ask(frame(0, Pose::IDENTITY)).await;
    let answer = pushed.ask(other(1)).await;
    assert_eq!(answer.status(), CurrentGraspStatus::Replanned);
    let missing = held(frame(2, Pose::IDENTITY), |holdout| {
        "objects/missing".clone_into(&mut holdout.object);
    });
    assert_wrong(&pushed.ask(missing).await, "holdout.object");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_moves_with_frames_and_stays_in_those_without() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let with_shoulder = |sequence, client_shoulder: Option<Vec3>| v1::TrackFrame {
        receiver: client_shoulder.map(v1::Receiver::with_shoulder),
        ..frame(sequence, Pose::IDENTITY)
    };
    let far = Some(Vec3::new(0.3, 1.2, -2.0));
    let near = Some(Vec3::new(0.2, 1.4, 0.4));
    for (sequence, shoulder, is_near) in [
        (0, far, false),
        (1, None, false),
        (2, near, true),
        (3, None, true),
    ] {
        let answer = track.ask(with_shoulder(sequence, shoulder)).await;
        assert_eq!(answer.warnings, [""; 0]);
        assert_eq!(answer.grasp.is_some(), is_near, "{sequence}: {answer:?}");
        assert!(
            is_near || super::no_grasp(&answer) == v1::Check::Reach,
            "{answer:?}"
        );
    }
    server.stop().await;
}
