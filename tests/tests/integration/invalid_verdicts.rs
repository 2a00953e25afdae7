//! Requests to check a grasp or to rate a holdout that break the contract are rejected with every wrong field.

use grasp_proto::v1::{self, Handedness};
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{blamed_fields, floating_remote, of_thesis},
    parts::with,
};

/// A stretched hand at the object's origin.
fn stretched(rig: &str) -> v1::HandPose {
    v1::HandPose::new(rig, Handedness::Right)
        .with_client_from_wrist(v1::Pose::default())
        .with_digits([Some(v1::DigitAngles::default()); 5])
}

/// A request to check it.
fn checking(hand: v1::HandPose, request: v1::FindGraspRequest) -> v1::ValidateGraspRequest {
    v1::ValidateGraspRequest::from(request).with_pose(hand)
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_a_grasp_is_named_at_once() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let hand = v1::HandPose {
        handedness: 0,
        scale: Some(9.0),
        convention: 99,
        thumb: Some(v1::DigitAngles {
            base_yaw: f32::NAN,
            ..Default::default()
        }),
        ring: Some(v1::DigitAngles {
            base_pitch: 4.0,
            ..Default::default()
        }),
        ..stretched("rigs/nobody")
    };
    let request = with(of_thesis(floating_remote()), |request| {
        request.holdout_mut().object = "objects/anvil".to_owned();
        request.receiver_mut().both_hands = true;
        request.requirements_mut().friction = Some(-1.0);
        request.output_mut().convention = 77;
    });
    let wrong = v1::ValidateGraspRequest {
        nearest_budget: Some(prost_types::Duration::default()),
        ..checking(hand, request)
    };
    let status = client.validate_grasp(wrong).await.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = blamed_fields(&status);
    for field in [
        "pose.handedness",
        "pose.rig",
        "pose.scale",
        "pose.convention",
        "pose.thumb.base_yaw",
        "pose.ring.base_pitch",
        "requirements.thesis.thesis_validity",
        "receiver.both_hands",
        "requirements.friction",
        "output.convention",
        "nearest_budget",
        "holdout.object",
    ] {
        assert!(
            fields.iter().any(|blamed| blamed == field),
            "{field} is not in {fields:?}"
        );
    }
    let empty = client.validate_grasp(v1::ValidateGraspRequest::default()).await;
    assert_eq!(
        blamed_fields(&empty.expect_err("it is empty")),
        ["grasp", "holdout"]
    );
    // What the request says about the receiving hand contradicts the grasp.
    let contradicting = with(floating_remote(), |request| {
        request.receiver = Some(v1::Receiver {
            rig: "rigs/thesis".to_owned(),
            handedness: Handedness::Left.into(),
            scale: Some(1.5),
            ..Default::default()
        });
    });
    let hand = stretched("rigs/adult");
    let refused = client.validate_grasp(checking(hand.clone(), contradicting)).await;
    assert_eq!(
        blamed_fields(&refused.expect_err("it contradicts itself")),
        ["receiver.handedness", "receiver.rig", "receiver.scale"]
    );
    // A hand is somewhere, and has all its digits.
    let lost = v1::HandPose {
        client_from_wrist: None,
        index: None,
        ..hand.clone()
    };
    let refused = client.validate_grasp(checking(lost, floating_remote())).await;
    assert_eq!(
        blamed_fields(&refused.expect_err("it is nowhere")),
        ["pose", "pose.index"]
    );
    // An object that does not exist is not found if nothing else is wrong.
    let missing = with(floating_remote(), |request| {
        request.holdout_mut().object = "objects/anvil".to_owned();
    });
    let missing = client.validate_grasp(checking(hand, missing)).await;
    assert_eq!(missing.expect_err("there is none").code(), Code::NotFound);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_an_evaluation_is_named_at_once() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let empty = v1::PresentingHand { form: None };
    let request = with(floating_remote(), |request| {
        request.requirements_mut().friction = Some(f32::NAN);
        request.receiver_mut().both_hands = true;
        request.search_mut().replay_attempt = Some(1);
        request.output_mut().key_frames = true;
    });
    let wrong = v1::EvaluateHoldoutRequest {
        other_presenting_hands: vec![empty.clone(), stretched("rigs/nobody").into()],
        ..request.into()
    };
    let status = client.evaluate_holdout(wrong).await.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    let mut fields = blamed_fields(&status);
    fields.sort();
    assert_eq!(
        fields,
        [
            "other_presenting_hands[0]",
            "other_presenting_hands[1].pose.rig",
            "output.key_frames",
            "receiver.both_hands",
            "requirements.friction",
            "search.replay_attempt",
        ]
    );
    let thesis = v1::EvaluateHoldoutRequest::from(of_thesis(floating_remote()));
    let thesis = client.evaluate_holdout(thesis).await;
    assert_eq!(
        blamed_fields(&thesis.expect_err("it is of the thesis")),
        ["requirements.thesis.thesis_validity"]
    );
    let many = v1::EvaluateHoldoutRequest {
        other_presenting_hands: vec![empty; 65],
        ..Default::default()
    };
    let status = client
        .evaluate_holdout(many)
        .await
        .expect_err("there are too many");
    let fields = blamed_fields(&status);
    assert!(
        fields.contains(&"other_presenting_hands".to_owned()),
        "{fields:?}"
    );
    server.stop().await;
}
