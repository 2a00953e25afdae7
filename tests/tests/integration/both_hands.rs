//! Two hands over the wire.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_client::{
    AtlasUse, Convention, FindAnswer, FindRequest, GraspSource, Handedness, Hands, Outcome, Pose,
};
use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{BOX_OBJ, assert_blamed, floating_remote, seconds};

/// Edges of the box, in metres: those of [`BOX_OBJ`] in decimetres.
const LARGE_BOX: Vec3 = Vec3::new(0.4, 0.3, 0.2);

/// In newtons.
const WEIGHT: f32 = 2.0 * 9.80665;

/// Creates a box of 40 × 30 × 20 cm and 2 kg.
async fn create_box(server: &TestServer) {
    let create = v1::CreateObjectRequest {
        object_id: "crate".to_owned(),
        mesh: BOX_OBJ.as_bytes().to_vec(),
        mass_kg: 2.0,
        unit_metres: Some(10.0),
        ..Default::default()
    };
    let created = server.objects().await.create_object(create).await;
    created.expect("the box can be created");
}

fn request(seed: u64) -> FindRequest {
    FindRequest {
        client_from_object: Pose {
            position: Vec3::new(0.2, 1.1, -0.4),
            orientation: Quat::from_rotation_y(0.7),
        },
        seed: Some(seed),
        budget: Some(Duration::from_secs(10)),
        hands: Some(Hands::Both),
        ..FindRequest::new("objects/crate")
    }
}

async fn ask(server: &TestServer, request: &FindRequest) -> FindAnswer {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_bear_the_weight_of_a_large_box_together() {
    let server = TestServer::start().await;
    create_box(&server).await;
    for seed in 0..4 {
        let request = request(seed);
        let answer = ask(&server, &request).await;
        assert_eq!(answer.outcome, Outcome::Found);
        assert_eq!(answer.report.source, Some(GraspSource::Search));
        let hands = [
            answer.grasp.expect("a hand"),
            answer.other_grasp.expect("the other hand"),
        ];
        assert_eq!(
            hands.each_ref().map(|hand| hand.handedness),
            [Handedness::Right, Handedness::Left]
        );
        assert_eq!(hands[0].rig, hands[1].rig);
        let contacts = || hands.iter().flat_map(|hand| &hand.contacts);
        let force: Vec3 = contacts().map(|contact| contact.client_force).sum();
        assert!((force - Vec3::Y * WEIGHT).length() <= 0.021 * WEIGHT, "{force}");
        let client_from_object = request.client_from_object;
        for contact in contacts() {
            let beyond = contact.object_position.abs() - 0.5 * LARGE_BOX;
            assert!(
                beyond.max_element().abs() < 1e-4,
                "{} is off the box",
                contact.object_position
            );
            let position =
                client_from_object.orientation * contact.object_position + client_from_object.position;
            assert!(position.distance(contact.client_position) < 1e-5);
        }
        for hand in &hands {
            assert!(
                hand.contacts
                    .iter()
                    .any(|contact| contact.client_force.length() > 1.0)
            );
            assert!(hand.score.is_some() && hand.key_frames.is_empty());
        }
        let margins = hands
            .each_ref()
            .map(|hand| hand.margins.expect("it is physically valid"));
        assert_eq!(margins[0].epsilon, margins[1].epsilon);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn receiving_hand_names_the_first_of_two_hands() {
    let server = TestServer::start().await;
    create_box(&server).await;
    let mut request = request(1);
    request.receiving_hand.handedness = Some(Handedness::Left);
    let answer = ask(&server, &request).await;
    let hands = [answer.grasp, answer.other_grasp].map(|hand| hand.expect("a hand").handedness);
    assert_eq!(hands, [Handedness::Left, Handedness::Right]);
}

#[tokio::test(flavor = "multi_thread")]
async fn two_hands_in_any_convention_are_the_same() {
    let server = TestServer::start().await;
    create_box(&server).await;
    let own = FindRequest {
        client_from_object: Pose::IDENTITY,
        reproducible: true,
        ..request(3)
    };
    let unreal = FindRequest {
        convention: Convention::Unreal,
        ..own.clone()
    };
    let own = ask(&server, &own).await.other_grasp.expect("the other hand");
    let unreal = ask(&server, &unreal).await.other_grasp.expect("the other hand");
    for (own, unreal) in own.contacts.iter().zip(&unreal.contacts) {
        // Unreal: +X forward (-z), +Y right (+x), +Z up (+y), in centimetres.
        let Vec3 { x, y, z } = own.client_position;
        assert!(unreal.client_position.distance(100.0 * Vec3::new(-z, x, y)) < 1e-3);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn two_handed_grasps_are_no_answer_to_requests_for_one_hand() {
    let server = TestServer::start().await;
    create_box(&server).await;
    for seed in 0..3 {
        assert_eq!(
            ask(&server, &request(seed)).await.report.source,
            Some(GraspSource::Search)
        );
    }
    // A box of 20 cm and more is too thick for one hand, which half of such a grasp would not be.
    let one_hand = FindRequest {
        hands: None,
        budget: Some(Duration::from_millis(50)),
        atlas: Some(AtlasUse::Allowed),
        ..request(9)
    };
    let answer = ask(&server, &one_hand).await;
    assert_eq!(answer.grasp, None);
    assert_eq!(answer.other_grasp, None);
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_with_what_they_do_not_support_is_refused() {
    let server = TestServer::start().await;
    let both = v1::FindGraspRequest {
        hands: v1::Hands::Both.into(),
        budget: Some(seconds(1)),
        ..floating_remote()
    };
    let thesis = v1::FindGraspRequest {
        validity: v1::Validity::Thesis.into(),
        ..both.clone()
    };
    let ladder = v1::FindGraspRequest {
        strategy: v1::Strategy::F.into(),
        ..both.clone()
    };
    let key_frames = v1::FindGraspRequest {
        plan_key_frames: true,
        ..both.clone()
    };
    let unknown = v1::FindGraspRequest {
        hands: 7,
        ..floating_remote()
    };
    for (request, field) in [
        (thesis, "hands"),
        (ladder, "hands"),
        (key_frames, "plan_key_frames"),
        (unknown, "hands"),
    ] {
        assert_blamed(&server, request, &[field]).await;
    }
}
