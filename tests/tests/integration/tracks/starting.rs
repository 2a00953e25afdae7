//! What a track begins with, and what it changes to.

use glam::Vec3;
use grasp_proto::v1::track_holdout_request::Message;
use grasp_proto::v1::{self, StandingStatus};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};

use super::{Tracked, frame, open, setup, status_of};

/// A hand as a grasp has it.
fn hand_of(grasp: &v1::Grasp) -> v1::HandAtObject {
    v1::HandAtObject {
        rig: grasp.rig.clone(),
        handedness: grasp.handedness,
        hand_scale: None,
        object_from_wrist: grasp.object_from_wrist,
        digits: grasp.digits.clone(),
    }
}

/// A track of the remote that begins with a hand.
fn setup_with(hand: v1::HandAtObject) -> v1::TrackSetup {
    let mut setup = setup(v1::TrackPolicy::default());
    if let Some(holdout) = &mut setup.holdout {
        holdout.standing = Some(v1::StandingGrasp {
            hand: Some(hand),
            ..Default::default()
        });
    }
    setup
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_begins_with_a_current_grasp() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let found = track.ask(frame(0, Pose::IDENTITY)).await.grasp.expect("a grasp");
    let mut setup = setup_with(hand_of(&found));
    setup.policy = Some(v1::TrackPolicy {
        detail: v1::AnswerDetail::Changes.into(),
        ..Default::default()
    });
    let mut next = Tracked::start(&server, Message::Setup(setup)).await.unwrap();
    let answer = next.ask(frame(0, Pose::IDENTITY)).await;
    assert_eq!(status_of(&answer), StandingStatus::Kept);
    let kept = answer.grasp.expect("the first answer is whole");
    assert_eq!(kept.object_from_wrist, found.object_from_wrist);
    assert!(next.ask(frame(1, Pose::IDENTITY)).await.grasp.is_none());
    // One that is not valid is followed by one near it.
    let wrist = super::pose_of(found.object_from_wrist);
    let deep = v1::HandAtObject {
        object_from_wrist: Some(wire_pose(wrist * Pose::from_position(Vec3::Y * -0.03))),
        ..hand_of(&found)
    };
    let mut next = Tracked::start(&server, Message::Setup(setup_with(deep)))
        .await
        .unwrap();
    let answer = next.ask(frame(0, Pose::IDENTITY)).await;
    let standing = answer.standing.as_ref().unwrap();
    assert_eq!(status_of(&answer), StandingStatus::Replanned);
    assert!(standing.fall.is_some() && standing.way.is_some(), "{standing:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_changes_its_object_and_begins_without_a_grasp_there() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server, v1::TrackPolicy::default()).await;
    let (mut pushed, name) = open::open(&server).await;
    for sequence in 0..3 {
        track.ask(frame(sequence, Pose::IDENTITY)).await;
    }
    let other = |sequence| v1::TrackFrame {
        object: "objects/scissors".to_owned(),
        presenting_hand: None,
        ..frame(sequence, Pose::IDENTITY)
    };
    let answer = track.ask(other(3)).await;
    let standing = answer.standing.clone().unwrap();
    assert_eq!(
        (standing.status(), standing.fall),
        (StandingStatus::Replanned, None)
    );
    let grasp = answer.grasp.expect("a grasp");
    // It is one of the scissors.
    let mut checked = v1::FindGraspRequest {
        object: "objects/scissors".to_owned(),
        client_from_object: other(3).client_from_object,
        ..Default::default()
    };
    let request = |holdout: &v1::FindGraspRequest| v1::ValidateGraspRequest {
        holdout: Some(holdout.clone()),
        grasp: Some(v1::GraspToValidate {
            form: Some(v1::grasp_to_validate::Form::Hand(hand_of(&grasp))),
        }),
        find_nearest: false,
    };
    let mut client = server.grasps().await;
    let valid = client.validate_grasp(request(&checked)).await.unwrap();
    assert!(valid.into_inner().valid);
    "objects/remote".clone_into(&mut checked.object);
    let valid = client.validate_grasp(request(&checked)).await.unwrap();
    assert!(!valid.into_inner().valid);
    // It stays the object of later frames.
    let next = v1::TrackFrame {
        presenting_hand: None,
        ..frame(4, Pose::IDENTITY)
    };
    let kept = track.ask(next).await;
    assert_eq!(status_of(&kept), StandingStatus::Kept);
    assert_eq!(kept.grasp.unwrap().object_from_wrist, grasp.object_from_wrist);
    // Pushed frames do the same.
    open::push(&server, &name, frame(0, Pose::IDENTITY))
        .await
        .unwrap();
    open::next(&mut pushed).await;
    open::push(&server, &name, other(1)).await.unwrap();
    let answer = open::next(&mut pushed).await;
    assert_eq!(status_of(&answer), StandingStatus::Replanned);
    let missing = v1::TrackFrame {
        object: "objects/missing".to_owned(),
        ..frame(2, Pose::IDENTITY)
    };
    let status = open::push(&server, &name, missing).await.unwrap_err();
    assert_eq!(crate::fixtures::blamed_fields(&status), ["frame.object"]);
    server.stop().await;
}
