//! `FindGrasp`: what an answer has, and what bounds and directs the search for it.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::{
    v1::{self, receiver::Body},
    wire_duration,
};
use grasp_tests::TestServer;
use prost::Message as _;
use tonic::Request;

use crate::fixtures::{
    BOX_OBJ, bounded, box_request, budget_of, create, find, floating_remote, hand as hand_of, held_remote,
    impossible, impossible_at_once, reproducible, with, with_object,
};

/// Longer than any test takes.
const LONG: Duration = Duration::from_secs(10);

#[tokio::test(flavor = "multi_thread")]
async fn exhausted_attempts_are_an_answer_with_a_report() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(LONG);
    let request = with(reproducible(request), |request| {
        request.search_mut().max_attempts = Some(300);
        request.requirements_mut().thesis = Some(v1::ThesisOptions {
            record_step_times: true,
            ..Default::default()
        });
    });
    let answer = find(&server, request).await;
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    assert_eq!(answer.grasps, []);
    let origin = answer.origin.unwrap();
    assert_eq!((origin.seed, origin.attempt), (7, None));
    assert_eq!(origin.source(), v1::GraspSource::Unspecified);
    let report = answer.report.unwrap();
    assert_eq!(report.attempts, 300);
    let rejected: u64 = report.rejections.iter().map(|rejection| rejection.count).sum();
    assert_eq!(rejected, 300);
    assert_eq!(report.budget, Some(wire_duration(LONG)));
    let thesis = report.thesis.expect("step times were requested");
    assert_eq!(thesis.step_times.len(), 5);
    let miss = report.nearest_miss.expect("an attempt came closest");
    assert!(miss.attempt < 300);
    let hand = miss.hand.expect("it has a hand");
    assert!(hand.client_from_wrist.is_some() && hand.object_from_wrist.is_some());
    assert_eq!((hand.rig.as_str(), hand.digits()), ("rigs/adult", [None; 5]));
    let verdict = miss.verdict.expect("it failed a check");
    assert!(!verdict.passed);
    assert!(report.rejections.iter().any(|count| count.check == verdict.check));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_servers_default_and_maximum_bound_the_budget() {
    let server = TestServer::start_with(|config| {
        config.budgets.default = Duration::from_millis(30);
        config.budgets.maximum = Duration::from_millis(60);
    })
    .await;
    let request = impossible(&server).await;
    for (asked, in_force) in [(request.clone(), 30), (request.with_budget(LONG), 60)] {
        let answer = bounded("the answer", server.grasps().await.find_grasp(asked)).await;
        assert_eq!(
            budget_of(&answer.unwrap().into_inner()),
            Duration::from_millis(in_force)
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_deadline_less_the_reserve_bounds_the_budget() {
    let server =
        TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::from_millis(1900)).await;
    let mut request = Request::new(impossible_at_once(&server).await.with_budget(LONG));
    request.set_timeout(Duration::from_secs(2));
    let answer = bounded("the answer", server.grasps().await.find_grasp(request)).await;
    let answer = answer.expect("the answer comes before the deadline").into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    // A quarter of the deadline, as the reserve would take more.
    assert_eq!(budget_of(&answer), Duration::from_millis(500));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_found_grasp_has_all_its_parts() {
    let server = TestServer::start().await;
    let answer = find(&server, floating_remote()).await;
    assert_eq!(answer.outcome(), v1::Outcome::Found);
    let [grasp] = &answer.grasps[..] else {
        panic!("{answer:?}");
    };
    let hand = hand_of(grasp);
    assert_eq!(
        (hand.rig.as_str(), hand.handedness()),
        ("rigs/adult", v1::Handedness::Right)
    );
    assert_eq!(hand.convention(), v1::Convention::Openxr);
    assert_eq!(hand.scale, None);
    assert!(hand.digits().iter().all(Option::is_some));
    assert_eq!(hand.joints.len(), 26);
    // Without an object pose, both frames are the same; the wrist is the second joint.
    let [in_client, in_object] =
        [hand.client_from_wrist, hand.object_from_wrist].map(|pose| pose.expect("every grasp has a wrist"));
    assert_eq!(in_client.position, in_object.position);
    // A product of rotations is renormalised.
    let [a, b] = [in_client, in_object].map(|pose| pose.orientation());
    assert!(a.abs_diff_eq(b, 1e-6), "{a} {b}");
    assert_eq!(hand.joints[1].pose, hand.client_from_wrist);
    assert!(hand.joints.iter().all(|joint| joint.radius > 0.0));
    assert!(grasp.contacts.len() >= 2);
    assert_eq!(grasp.contacts[0].digit(), v1::Digit::Thumb);
    assert!(
        grasp
            .contacts
            .iter()
            .any(|contact| contact.digit() != v1::Digit::Thumb)
    );
    for contact in &grasp.contacts {
        let is_of_palm = contact.digit() == v1::Digit::Unspecified;
        let phalanges = if is_of_palm { 0..=0 } else { 1..=3 };
        assert!(phalanges.contains(&contact.phalanx), "{contact:?}");
    }
    for check in [v1::Check::Balance, v1::Check::Closure, v1::Check::Penetration] {
        assert!(grasp.margin(check).is_some(), "{check:?}");
    }
    assert!(grasp.margins.iter().all(|margin| margin.passed));
    assert!(answer.origin.as_ref().unwrap().attempt.is_some());
    assert!(answer.report.as_ref().unwrap().nearest_miss.is_none());
}

type Change = fn(&mut v1::FindGraspRequest);

type Check = fn(&v1::Grasp) -> bool;

fn touching(grasp: &v1::Grasp) -> Vec<v1::Digit> {
    grasp.contacts.iter().map(v1::Contact::digit).collect()
}

fn wrist(grasp: &v1::Grasp) -> v1::Pose {
    hand_of(grasp).client_from_wrist.expect("every grasp has a wrist")
}

/// Each alone, with a check of every grasp.
#[tokio::test(flavor = "multi_thread")]
async fn each_requirement_is_met() {
    let server = TestServer::start().await;
    let table: [(Change, Check); 5] = [
        (
            |r| {
                r.receiver_mut().body = Some(Body::ClientShoulder((0.4 * Vec3::X).into()));
                r.receiver_mut().max_reach = Some(0.38);
            },
            |grasp| wrist(grasp).position().distance(Vec3::X * 0.4) <= 0.38 + 1e-5,
        ),
        (
            |r| r.requirements_mut().must_touch = vec![v1::Digit::Little.into()],
            |grasp| touching(grasp).contains(&v1::Digit::Little),
        ),
        (
            |r| r.requirements_mut().must_not_touch = vec![v1::Digit::Little.into()],
            |grasp| !touching(grasp).contains(&v1::Digit::Little),
        ),
        (
            |r| r.requirements_mut().thesis.get_or_insert_default().max_comfort = Some(0.01),
            |grasp| grasp.thesis.expect("it has a comfort").comfort <= 0.01,
        ),
        (
            |r| {
                r.requirements_mut().client_approach = Some(Vec3::NEG_Y.into());
                r.requirements_mut().max_approach_angle = 0.8;
            },
            |grasp| {
                // Halfway between the fingers and the palm's direction, in OpenXR axes.
                let way = wrist(grasp).orientation() * (Vec3::NEG_Z + Vec3::NEG_Y);
                way.angle_between(Vec3::NEG_Y) <= 0.8 + 1e-3
            },
        ),
    ];
    for (row, (constrain, is_met)) in table.into_iter().enumerate() {
        for seed in 0..3 {
            let request = floating_remote()
                .with_seed(seed)
                .with_budget(Duration::from_secs(10));
            let answer = find(&server, with(request, constrain)).await;
            let grasp = answer.grasp();
            let grasp = grasp.unwrap_or_else(|| panic!("row {row}: {:?}", answer.report));
            assert!(is_met(grasp), "row {row}, seed {seed}: {grasp:?}");
        }
    }
}

/// In front of the remote at the origin, to the receiver's right, in metres.
const SHOULDER: Vec3 = Vec3::new(0.15, 0.25, 0.4);

/// A floating remote for a receiver's right hand.
fn received(receiver: v1::Receiver) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        receiver: Some(receiver),
        ..reproducible(floating_remote()).with_seed(5)
    }
    .receiving(v1::Handedness::Right)
}

/// The grasp that is found.
async fn grasp(server: &TestServer, request: v1::FindGraspRequest) -> v1::Grasp {
    let answer = find(server, request).await;
    let grasp = answer.grasp();
    grasp.unwrap_or_else(|| panic!("{:?}", answer.report)).clone()
}

/// Shoulder and elbow of an arm.
fn places(arm: &v1::Arm) -> [Vec3; 2] {
    [arm.client_shoulder, arm.client_elbow].map(|place| place.expect("an arm has it").into())
}

/// Checks that the bones of an arm reach from its shoulder to a wrist.
fn assert_reaches(arm: &v1::Arm, wrist: Vec3, [upper_arm, forearm]: [f32; 2], tolerance: f32) {
    let [shoulder, elbow] = places(arm);
    let lengths = [shoulder.distance(elbow), elbow.distance(wrist)];
    assert!((lengths[0] - upper_arm).abs() < tolerance, "{lengths:?}");
    assert!((lengths[1] - forearm).abs() < tolerance, "{lengths:?}");
    let degrees = [arm.wrist_flexion, arm.wrist_deviation].map(f32::to_degrees);
    assert!(
        (-70.1..=80.1).contains(&degrees[0]) && (-20.1..=30.1).contains(&degrees[1]),
        "{degrees:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn the_arm_of_a_given_shoulder_reaches_the_wrist() {
    let server = TestServer::start().await;
    let receiver = v1::Receiver {
        upper_arm_length: Some(0.31),
        forearm_length: Some(0.25),
        ..v1::Receiver::with_shoulder(SHOULDER)
    };
    let found = grasp(&server, received(receiver)).await;
    let arm = found.arm.expect("the receiver has a body");
    assert!(places(&arm)[0].distance(SHOULDER) < 1e-5);
    assert_reaches(&arm, wrist(&found).position(), [0.31, 0.25], 1e-4);
    // Without a giver or a body, there is no arm.
    let bare = grasp(&server, received(v1::Receiver::default())).await;
    assert_eq!(bare.arm, None);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_receiver_anywhere_assumes_no_arm() {
    let server = TestServer::start().await;
    for (body, is_assumed) in [
        (None, true),
        (Some(Body::Anywhere(false)), true),
        (Some(Body::Anywhere(true)), false),
    ] {
        let request = with(reproducible(held_remote()), |request| {
            request.receiver_mut().body = body;
        });
        let arm = grasp(&server, request).await.arm;
        assert_eq!(arm.is_some(), is_assumed, "{body:?}");
    }
}

/// Edges of the box, in metres: those of [`BOX_OBJ`] in decimetres.
const LARGE_BOX: Vec3 = Vec3::new(0.4, 0.3, 0.2);

/// In newtons.
const WEIGHT: f32 = 2.0 * 9.80665;

/// Creates a box of 40 × 30 × 20 cm and 2 kg.
async fn create_large_box(server: &TestServer) {
    let create = v1::CreateObjectRequest::new("crate", BOX_OBJ, 2.0);
    let create = with_object(create, |object| object.meters_per_unit = Some(10.0));
    let created = server.objects().await.create_object(create).await;
    created.expect("the box can be created");
}

/// The box in the client's frame.
fn client_from_object() -> v1::Pose {
    v1::Pose::new(Vec3::new(0.2, 1.1, -0.4), Quat::from_rotation_y(0.7))
}

fn carried(seed: u64) -> v1::FindGraspRequest {
    let request = v1::FindGraspRequest::new("objects/crate")
        .with_client_from_object(client_from_object())
        .with_seed(seed)
        .with_budget(Duration::from_secs(10));
    with(request, |request| request.receiver_mut().both_hands = true)
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_bear_the_weight_of_a_large_box_together() {
    let server = TestServer::start().await;
    create_large_box(&server).await;
    for seed in 0..4 {
        let answer = find(&server, carried(seed)).await;
        assert_eq!(answer.outcome(), v1::Outcome::Found);
        assert_eq!(answer.source(), v1::GraspSource::Search);
        let hands = &answer.grasps;
        let sides: Vec<_> = hands.iter().map(|grasp| hand_of(grasp).handedness()).collect();
        assert_eq!(sides, [v1::Handedness::Right, v1::Handedness::Left]);
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

/// A request to create the box at a size, with a mass.
fn box_of(id: &str, meters_per_unit: f32, mass_kg: f32) -> v1::CreateObjectRequest {
    with_object(box_request(id), |object| {
        object.meters_per_unit = Some(meters_per_unit);
        object.mass_kg = mass_kg;
    })
}

/// A reproducible search for a grasp of an object that nobody holds.
fn floating(id: &str) -> v1::FindGraspRequest {
    reproducible(v1::FindGraspRequest::new(format!("objects/{id}")))
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(10))
        .with_seed(11)
}

/// An answer without what differs from run to run.
fn unchanging(answer: v1::FindGraspResponse) -> Vec<u8> {
    let report = answer.report.expect("every answer has a report");
    v1::FindGraspResponse {
        report: Some(v1::SearchReport {
            search_time: None,
            ..report
        }),
        ..answer
    }
    .encode_to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_at_another_size_is_held_like_one_created_at_it() {
    let server = TestServer::start().await;
    create(&server, box_of("own", 1.0, 0.1)).await.unwrap();
    // Powers of two scale coordinates without rounding, so that the answers are the same bit for bit.
    for (id, scale) in [("half", 0.5_f32), ("double", 2.0)] {
        create(&server, box_of(id, scale, 0.1 * scale.powi(3)))
            .await
            .unwrap();
        let resized = with(floating("own"), |request| {
            request.holdout_mut().scale = Some(scale);
        });
        let expected = find(&server, floating(id)).await;
        assert_eq!(expected.outcome(), v1::Outcome::Found, "{id}");
        // Prepared by the first call, kept for the second.
        for _ in 0..2 {
            let answer = find(&server, resized.clone()).await;
            assert_eq!(unchanging(answer), unchanging(expected.clone()), "{id}");
        }
    }
}
