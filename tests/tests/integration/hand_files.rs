//! What is checked, told and may be changed when rigs are made of clients' files.

use grasp_assets::{hands::glb, holdouts::holdout};
use grasp_characters::{
    Character, Style,
    names::{mixamo, numbered_from_palm},
};
use grasp_client::ClientError;
use grasp_proto::v1;
use grasp_synthesis::model::hand;
use grasp_tests::{TestServer, recorded::data_folder_or_skip};
use tonic::Code;

use crate::{
    fixtures::{blamed_fields, built_in_request},
    parts::with,
};

/// A request for a grasp of a held-out remote control with the right hand of a rig.
fn find_with(rig: &v1::HandRig) -> v1::FindGraspRequest {
    let request = built_in_request(holdout("remote-hold1").unwrap()).receiving(v1::Handedness::Right);
    with(request, |request| {
        request.receiver_mut().rig.clone_from(&rig.name);
    })
}

/// The built-in hand of a side as a file.
fn file(side: hand::Handedness) -> Vec<u8> {
    glb("adult", side).expect("the rig is built in").to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_in_two_files_are_one_rig_with_widths_as_the_client_wants_them() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let pair = |id: &str| v1::CreateRigRequest {
        rig_id: id.to_owned(),
        models: vec![file(hand::Handedness::Right), file(hand::Handedness::Left)],
        handedness: v1::Handedness::Right.into(),
        ..Default::default()
    };
    let plain = client.create_rig(&pair("pair")).await.unwrap();
    assert!(
        plain
            .hands
            .iter()
            .all(|hand| !hand.mirrored && !hand.nodes.is_empty())
    );
    let narrow = v1::CreateRigRequest {
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
        assert_eq!(answer.outcome(), v1::Outcome::Found, "{}", rig.name);
    }

    let mut rigs = server.rigs().await;
    let wrong = v1::CreateRigRequest {
        models: vec![vec![1]; 3],
        width_scale: Some(f32::NAN),
        radii: [("elbow".to_owned(), 0.01), ("wrist".to_owned(), 0.0)].into(),
        ..v1::CreateRigRequest::of_model("wrong", Vec::new())
    };
    let status = rigs.create_rig(wrong).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
    let fields = blamed_fields(&status);
    for field in ["models", "width_scale", "radii"] {
        assert!(fields.iter().any(|blamed| blamed == field), "{field}: {fields:?}");
    }
    let same = v1::CreateRigRequest {
        models: vec![file(hand::Handedness::Right); 2],
        handedness: v1::Handedness::Unspecified.into(),
        ..pair("same")
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
        let mut joints = hand.stretched_joints.clone();
        for joint in &mut joints[6..] {
            joint.radius *= 1.3;
        }
        v1::HandJoints::new(hand.handedness(), joints)
    });
    let thick = v1::CreateRigRequest {
        rig_id: "thick".to_owned(),
        joints: hands.collect(),
        ..Default::default()
    };
    let thick = client.create_rig(&thick).await.unwrap();
    let answer = client.find_grasp(&find_with(&thick)).await.unwrap();
    assert_eq!(answer.outcome(), v1::Outcome::Found);

    if let Some(folder) = data_folder_or_skip("thick_fingers_that_overlap_at_rest_take_things") {
        let model = std::fs::read(folder.join("reports/newcomer-fat-fingers/hand_r.gltf")).unwrap();
        let rig = client
            .create_rig(&v1::CreateRigRequest::of_model("foreign", model))
            .await
            .unwrap();
        let answer = client.find_grasp(&find_with(&rig)).await.unwrap();
        assert_eq!(answer.outcome(), v1::Outcome::Found, "{:?}", answer.report);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hand_that_can_take_nothing_is_refused() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let digits = [
        v1::Digit::Thumb,
        v1::Digit::Index,
        v1::Digit::Middle,
        v1::Digit::Ring,
        v1::Digit::Little,
    ];
    let still = v1::DigitAngles::new([0.0; 4]);
    let stiff = digits.map(|digit| v1::DigitLimits {
        digit: digit.into(),
        min: Some(still),
        max: Some(still),
    });
    let stiff = v1::CreateRigRequest {
        handedness: v1::Handedness::Right.into(),
        limits: stiff.to_vec(),
        ..v1::CreateRigRequest::of_model("stiff", file(hand::Handedness::Right))
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
    let rig = v1::CreateRigRequest::of_model("mixamo", Character::new(&style).glb);
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
    let rig = v1::CreateRigRequest::of_model("numbered", Character::new(&style).glb);
    let rig = client.create_rig(&rig).await.unwrap();
    assert_eq!(rig.warnings, [""; 0], "the skin shows the tips");
    server.stop().await;
}
