//! Two hands over the wire.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::{
    fixtures::{BOX_OBJ, assert_blamed, floating_remote, of_thesis},
    parts::{hand as hand_of, reproducible, with, with_object},
};

/// Edges of the box, in metres: those of [`BOX_OBJ`] in decimetres.
const LARGE_BOX: Vec3 = Vec3::new(0.4, 0.3, 0.2);

/// In newtons.
const WEIGHT: f32 = 2.0 * 9.80665;

/// Creates a box of 40 × 30 × 20 cm and 2 kg.
async fn create_box(server: &TestServer) {
    let create = v1::CreateObjectRequest::new("crate", BOX_OBJ, 2.0);
    let create = with_object(create, |object| object.meters_per_unit = Some(10.0));
    let created = server.objects().await.create_object(create).await;
    created.expect("the box can be created");
}

/// The box in the client's frame.
fn client_from_object() -> v1::Pose {
    v1::Pose::new(Vec3::new(0.2, 1.1, -0.4), Quat::from_rotation_y(0.7))
}

fn request(seed: u64) -> v1::FindGraspRequest {
    let request = v1::FindGraspRequest::new("objects/crate")
        .with_client_from_object(client_from_object())
        .with_seed(seed)
        .with_budget(Duration::from_secs(10));
    with(request, |request| request.receiver_mut().both_hands = true)
}

async fn ask(server: &TestServer, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

fn handedness(grasps: &[v1::Grasp]) -> Vec<v1::Handedness> {
    grasps.iter().map(|grasp| hand_of(grasp).handedness()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_bear_the_weight_of_a_large_box_together() {
    let server = TestServer::start().await;
    create_box(&server).await;
    for seed in 0..4 {
        let answer = ask(&server, &request(seed)).await;
        assert_eq!(answer.outcome(), v1::Outcome::Found);
        assert_eq!(answer.source(), v1::GraspSource::Search);
        let hands = &answer.grasps;
        assert_eq!(handedness(hands), [v1::Handedness::Right, v1::Handedness::Left]);
        assert_eq!(hand_of(&hands[0]).rig, hand_of(&hands[1]).rig);
        let contacts = || hands.iter().flat_map(|hand| &hand.contacts);
        let in_client = hands.iter().flat_map(v1::Grasp::client_contacts);
        let force: Vec3 = in_client.clone().map(|contact| contact.force()).sum();
        assert!((force - Vec3::Y * WEIGHT).length() <= 0.021 * WEIGHT, "{force}");
        for (contact, in_client) in contacts().zip(in_client) {
            let beyond = contact.position().abs() - 0.5 * LARGE_BOX;
            assert!(
                beyond.max_element().abs() < 1e-4,
                "{} is off the box",
                contact.position()
            );
            // The wrists place the object where the request does.
            let position = client_from_object().transform_point(contact.position());
            assert!(position.distance(in_client.position()) < 1e-5);
        }
        for hand in hands {
            assert!(hand.contacts.iter().any(|contact| contact.force().length() > 1.0));
            assert!(hand.score.is_some() && hand.key_frames.is_empty());
        }
        let epsilons = [0, 1].map(|hand| hands[hand].margin(v1::Check::Closure));
        assert!(epsilons[0].is_some(), "it is physically valid");
        assert_eq!(epsilons[0], epsilons[1]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_receivers_handedness_names_the_first_of_two_hands() {
    let server = TestServer::start().await;
    create_box(&server).await;
    let answer = ask(&server, &request(1).receiving(v1::Handedness::Left)).await;
    assert_eq!(
        handedness(&answer.grasps),
        [v1::Handedness::Left, v1::Handedness::Right]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn two_hands_in_any_convention_are_the_same() {
    let server = TestServer::start().await;
    create_box(&server).await;
    let own = reproducible(request(3).with_client_from_object(v1::Pose::default()));
    let unreal = own.clone().with_convention(v1::Convention::Unreal);
    let [own, unreal] = [ask(&server, &own).await, ask(&server, &unreal).await].map(|answer| answer.grasps);
    let [own, unreal] = [&own[1].contacts, &unreal[1].contacts];
    assert_eq!(own.len(), unreal.len());
    for (own, unreal) in own.iter().zip(unreal) {
        // Unreal: +X forward (-z), +Y right (+x), +Z up (+y), in centimetres.
        let Vec3 { x, y, z } = own.position();
        assert!(unreal.position().distance(100.0 * Vec3::new(-z, x, y)) < 1e-3);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn two_handed_grasps_are_no_answer_to_requests_for_one_hand() {
    let server = TestServer::start().await;
    create_box(&server).await;
    for seed in 0..3 {
        assert_eq!(
            ask(&server, &request(seed)).await.source(),
            v1::GraspSource::Search
        );
    }
    // A box of 20 cm and more is too thick for one hand, which half of such a grasp would not be.
    let one_hand = with(request(9), |request| request.receiver_mut().both_hands = false);
    let answer = ask(&server, &one_hand.with_budget(Duration::from_millis(50))).await;
    assert_eq!(answer.grasps, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_with_what_they_do_not_support_is_refused() {
    let server = TestServer::start().await;
    let both = with(floating_remote(), |request| {
        request.receiver_mut().both_hands = true;
    });
    let thesis = of_thesis(both.clone());
    let ladder = with(both.clone(), |request| {
        request.requirements_mut().thesis = Some(v1::ThesisOptions {
            strategy: v1::Strategy::F.into(),
            ..Default::default()
        });
    });
    let key_frames = both.with_key_frames();
    for (request, field) in [
        (thesis, "receiver.both_hands"),
        (ladder, "receiver.both_hands"),
        (key_frames, "output.key_frames"),
    ] {
        assert_blamed(&server, request, &[field]).await;
    }
}
