//! Requests to check a grasp or to rate a holdout that break the contract are rejected with every wrong field.

use grasp_proto::v1::{self, grasp_to_validate::Form};
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{blamed_fields, floating_remote},
    validate_grasp::request,
};

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_a_grasp_is_named_at_once() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let digit = v1::DigitAngles {
        base_yaw: f32::NAN,
        base_pitch: 4.0,
        second_pitch: 0.0,
        third_pitch: None,
    };
    let hand = v1::HandAtObject {
        rig: "nobody".to_owned(),
        handedness: 0,
        hand_scale: Some(9.0),
        object_from_wrist: None,
        digits: vec![digit; 4],
    };
    let wrong = v1::ValidateGraspRequest {
        holdout: Some(v1::FindGraspRequest {
            object: "objects/anvil".to_owned(),
            validity: v1::Validity::Thesis.into(),
            hands: v1::Hands::Both.into(),
            friction: Some(-1.0),
            choice: 77,
            ..Default::default()
        }),
        ..request(floating_remote(), Form::Hand(hand))
    };
    let status = client.validate_grasp(wrong).await.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = blamed_fields(&status);
    for field in [
        "grasp.hand.handedness",
        "grasp.hand.rig",
        "grasp.hand.hand_scale",
        "grasp.hand.digits",
        "grasp.hand.digits[0].base_yaw",
        "grasp.hand.digits[3].base_pitch",
        "holdout.validity",
        "holdout.hands",
        "holdout.friction",
        "holdout.choice",
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
    let contradicting = v1::FindGraspRequest {
        receiving_hand: Some(v1::ReceivingHand {
            rig: "thesis".to_owned(),
            handedness: v1::Handedness::Left.into(),
            hand_scale: Some(1.5),
        }),
        ..floating_remote()
    };
    let hand = v1::HandAtObject {
        rig: "adult".to_owned(),
        handedness: v1::Handedness::Right.into(),
        digits: vec![v1::DigitAngles::default(); 5],
        ..Default::default()
    };
    let refused = client
        .validate_grasp(request(contradicting, Form::Hand(hand.clone())))
        .await;
    assert_eq!(
        blamed_fields(&refused.expect_err("it contradicts itself")),
        [
            "holdout.receiving_hand.handedness",
            "holdout.receiving_hand.rig",
            "holdout.receiving_hand.hand_scale"
        ]
    );
    // An object that does not exist is not found if nothing else is wrong.
    let missing = v1::FindGraspRequest {
        object: "objects/anvil".to_owned(),
        ..floating_remote()
    };
    let missing = client.validate_grasp(request(missing, Form::Hand(hand))).await;
    assert_eq!(missing.expect_err("there is none").code(), Code::NotFound);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_wrong_with_an_evaluation_is_named_at_once() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let empty = v1::PresentingHand { form: None };
    let nobody = v1::PresentingHand {
        form: Some(v1::presenting_hand::Form::Angles(v1::HandAngles {
            rig: "nobody".to_owned(),
            handedness: v1::Handedness::Left.into(),
            digits: vec![v1::DigitAngles::default(); 5],
            ..Default::default()
        })),
    };
    let wrong = v1::EvaluateHoldoutRequest {
        holdout: Some(v1::FindGraspRequest {
            only_attempt: Some(1),
            plan_key_frames: true,
            standing: Some(v1::StandingGrasp::default()),
            friction: Some(f32::NAN),
            hands: v1::Hands::Both.into(),
            ..floating_remote()
        }),
        other_presenting_hands: vec![empty.clone(), nobody],
    };
    let status = client.evaluate_holdout(wrong).await.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    let mut fields = blamed_fields(&status);
    fields.sort();
    assert_eq!(
        fields,
        [
            "holdout.friction",
            "holdout.hands",
            "holdout.only_attempt",
            "holdout.plan_key_frames",
            "holdout.standing",
            "other_presenting_hands[0]",
            "other_presenting_hands[1].angles.rig",
        ]
    );
    let many = v1::EvaluateHoldoutRequest {
        holdout: None,
        other_presenting_hands: vec![empty; 65],
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
