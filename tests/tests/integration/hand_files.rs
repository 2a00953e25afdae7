//! What is checked, told and may be changed when rigs are made of clients' files.

use std::time::Duration;

use grasp_assets::{hands::glb, holdouts::holdout};
use grasp_characters::{
    Character, Style,
    names::{mixamo, numbered_from_palm},
};
use grasp_client::{
    AngleRange, ClientError, DigitLimits, FindRequest, Handedness, NewRig, Outcome, ReceivingHand, Rig,
    RigSource, built_in::request_for,
};
use grasp_proto::v1;
use grasp_synthesis::model::hand;
use grasp_tests::{TestServer, recorded::data_folder_or_skip};
use tonic::Code;

use crate::fixtures::blamed_fields;

/// A request for a grasp of a held-out remote control with the right hand of a rig.
fn find_with(rig: &Rig) -> FindRequest {
    FindRequest {
        receiving_hand: ReceivingHand {
            rig: Some(rig.name.clone()),
            handedness: Some(Handedness::Right),
            hand_scale: None,
        },
        budget: Some(Duration::from_secs(10)),
        ..request_for(holdout("remote-hold1").unwrap())
    }
}

/// The built-in hand of a side as a file.
fn file(side: hand::Handedness) -> Vec<u8> {
    glb("adult", side).expect("the rig is built in").to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_in_two_files_are_one_rig_with_widths_as_the_client_wants_them() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let pair = |id: &str| NewRig {
        handedness: Some(Handedness::Right),
        other_model: Some(file(hand::Handedness::Left)),
        ..NewRig::of_model(id, file(hand::Handedness::Right))
    };
    let plain = client.create_rig(&pair("pair")).await.unwrap();
    assert!(
        plain
            .hands
            .iter()
            .all(|hand| !hand.mirrored && !hand.nodes.is_empty())
    );
    let narrow = NewRig {
        width_scale: Some(0.8),
        radii: [("palm".to_owned(), 0.0111)].into(),
        ..pair("narrow")
    };
    let narrow = client.create_rig(&narrow).await.unwrap();
    for (own, measured) in narrow.hands.iter().zip(&plain.hands) {
        let joints = own.stretched_joints.iter().zip(&measured.stretched_joints);
        for (place, (own, measured)) in joints.enumerate() {
            let expected = if place == 0 { 0.0111 } else { 0.8 * measured.radius };
            assert!((own.radius - expected).abs() < 1e-6, "{place}");
        }
    }
    for rig in [&plain, &narrow] {
        let answer = client.find_grasp(&find_with(rig)).await.unwrap();
        assert_eq!(answer.outcome, Outcome::Found, "{}", rig.name);
    }

    let mut rigs = server.rigs().await;
    let wrong = v1::CreateRigRequest {
        rig_id: "wrong".to_owned(),
        source: Some(v1::create_rig_request::Source::Joints(v1::JointsAtRest::default())),
        other_model: vec![1],
        width_scale: f32::NAN,
        radii: [("elbow".to_owned(), 0.01), ("wrist".to_owned(), 0.0)].into(),
        ..Default::default()
    };
    let status = rigs.create_rig(wrong).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = blamed_fields(&status);
    for field in ["other_model", "width_scale", "radii"] {
        assert!(fields.iter().any(|blamed| blamed == field), "{field}: {fields:?}");
    }
    let same = NewRig {
        other_model: Some(file(hand::Handedness::Right)),
        ..pair("same")
    };
    let same = NewRig {
        handedness: None,
        ..same
    };
    let refused = client.create_rig(&same).await.unwrap_err();
    assert!(refused.to_string().contains("handedness"), "{refused}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn thick_fingers_that_overlap_at_rest_take_things() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let adult = client.get_rig("rigs/adult").await.unwrap();
    let hands = adult.hands.iter().map(|hand| {
        let mut joints = hand.stretched_joints.to_vec();
        for joint in &mut joints[6..] {
            joint.radius *= 1.3;
        }
        grasp_client::HandJoints {
            handedness: hand.handedness,
            joint_set: grasp_client::JointSet::OpenXr26,
            joints,
        }
    });
    let thick = NewRig {
        source: RigSource::Joints(hands.collect()),
        ..NewRig::of_model("thick", Vec::new())
    };
    let thick = client.create_rig(&thick).await.unwrap();
    let answer = client.find_grasp(&find_with(&thick)).await.unwrap();
    assert_eq!(answer.outcome, Outcome::Found);

    if let Some(folder) = data_folder_or_skip("thick_fingers_that_overlap_at_rest_take_things") {
        let model = std::fs::read(folder.join("reports/newcomer-fat-fingers/hand_r.gltf")).unwrap();
        let rig = client
            .create_rig(&NewRig::of_model("foreign", model))
            .await
            .unwrap();
        let answer = client.find_grasp(&find_with(&rig)).await.unwrap();
        assert_eq!(answer.outcome, Outcome::Found, "{:?}", answer.report);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_that_can_take_nothing_is_refused() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let still = AngleRange { min: 0.0, max: 0.0 };
    let stiff = DigitLimits {
        base_yaw: still,
        base_pitch: still,
        second_pitch: still,
        third_pitch: still,
    };
    let stiff = NewRig {
        handedness: Some(Handedness::Right),
        limits: Some([stiff; 5]),
        ..NewRig::of_model("stiff", file(hand::Handedness::Right))
    };
    let refused = client.create_rig(&stiff).await.unwrap_err();
    assert!(
        matches!(refused, ClientError::InvalidArgument(_))
            && refused.to_string().contains("takes none of 3 boxes"),
        "{refused}"
    );
    assert!(client.get_rig("rigs/stiff").await.is_err());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn warnings_tell_what_was_taken_from_the_adult() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let style = Style {
        name: mixamo,
        ..Style::PLAIN
    };
    let rig = NewRig::of_model("mixamo", Character::new(&style).glb);
    let rig = client.create_rig(&rig).await.unwrap();
    assert!(
        rig.warnings
            .iter()
            .any(|warning| warning.contains("index-finger-metacarpal") && warning.contains("rig adult")),
        "{:?}",
        rig.warnings
    );
    let style = Style {
        name: numbered_from_palm,
        ..Style::PLAIN
    };
    let rig = NewRig::of_model("numbered", Character::new(&style).glb);
    let rig = client.create_rig(&rig).await.unwrap();
    assert_eq!(rig.warnings, [""; 0], "the skin shows the tips");
    server.stop().await;
}
