//! `FindGrasp`: the parts of an answer, its score and key frames, and the limits of its search.

use std::{collections::BTreeMap, time::Duration};

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdout;
use grasp_proto::{
    v1::{self, receiver::Body},
    wire_duration,
};
use grasp_tests::TestServer;
use tonic::Request;

use crate::fixtures::{
    bounded, box_request, budget_of, built_in_request, create, find, floating_remote, hand as hand_of,
    held_remote, impossible, impossible_at_once, reproducible, unchanging, vec3, with, with_object,
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
    // The reserve would take more, but the budget keeps a quarter of the deadline.
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

fn wrist(grasp: &v1::Grasp) -> v1::Pose {
    hand_of(grasp).client_from_wrist.expect("every grasp has a wrist")
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

#[tokio::test(flavor = "multi_thread")]
async fn the_arm_of_a_given_shoulder_reaches_the_wrist_and_a_receiver_anywhere_has_none() {
    let server = TestServer::start().await;
    let receiver = v1::Receiver {
        upper_arm_length: Some(0.31),
        forearm_length: Some(0.25),
        ..v1::Receiver::with_shoulder(SHOULDER)
    };
    let found = grasp(&server, received(receiver)).await;
    let arm = found.arm.expect("the receiver has a body");
    let [shoulder, elbow] = [arm.client_shoulder, arm.client_elbow].map(vec3);
    assert!(shoulder.distance(SHOULDER) < 1e-5);
    assert!((shoulder.distance(elbow) - 0.31).abs() < 1e-4, "{arm:?}");
    assert!(
        (elbow.distance(wrist(&found).position()) - 0.25).abs() < 1e-4,
        "{arm:?}"
    );
    let degrees = [arm.wrist_flexion, arm.wrist_deviation].map(f32::to_degrees);
    assert!(
        (-70.1..=80.1).contains(&degrees[0]) && (-20.1..=30.1).contains(&degrees[1]),
        "{degrees:?}"
    );
    // Without a giver or a body, there is no arm; with a giver, one is assumed unless the receiver is anywhere.
    let bare = grasp(&server, received(v1::Receiver::default())).await;
    assert_eq!(bare.arm, None);
    for (body, is_assumed) in [(None, true), (Some(Body::Anywhere(true)), false)] {
        let request = with(reproducible(held_remote()), |request| {
            request.receiver_mut().body = body;
        });
        assert_eq!(
            grasp(&server, request).await.arm.is_some(),
            is_assumed,
            "{body:?}"
        );
    }
}

/// Edges of the box, in metres: those of [`BOX_OBJ`] in decimetres.
const LARGE_BOX: Vec3 = Vec3::new(0.4, 0.3, 0.2);

/// Weight of the box in newtons.
const WEIGHT: f32 = 2.0 * 9.80665;

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_bear_the_weight_of_a_large_box_together() {
    let server = TestServer::start().await;
    create(&server, box_of("crate", 10.0, 2.0)).await.unwrap();
    let client_from_object = v1::Pose::new(Vec3::new(0.2, 1.1, -0.4), Quat::from_rotation_y(0.7));
    for seed in 0..4 {
        let request = v1::FindGraspRequest::new("objects/crate")
            .with_client_from_object(client_from_object)
            .with_seed(seed)
            .with_budget(LONG);
        let request = with(request, |request| request.receiver_mut().both_hands = true);
        let answer = find(&server, request).await;
        assert_eq!(
            (answer.outcome(), answer.source()),
            (v1::Outcome::Found, v1::GraspSource::Search)
        );
        let hands = &answer.grasps;
        let sides: Vec<_> = hands.iter().map(|grasp| hand_of(grasp).handedness()).collect();
        assert_eq!(sides, [v1::Handedness::Right, v1::Handedness::Left]);
        let in_client = hands.iter().flat_map(v1::Grasp::client_contacts);
        let force: Vec3 = in_client.clone().map(|contact| contact.force()).sum();
        assert!((force - Vec3::Y * WEIGHT).length() <= 0.021 * WEIGHT, "{force}");
        for (contact, in_client) in hands.iter().flat_map(|hand| &hand.contacts).zip(in_client) {
            let beyond = contact.position().abs() - 0.5 * LARGE_BOX;
            assert!(
                beyond.max_element().abs() < 1e-4,
                "{} is off the box",
                contact.position()
            );
            // The wrists place the object where the request does.
            let position = client_from_object.transform_point(contact.position());
            assert!(position.distance(in_client.position()) < 1e-5);
        }
        for hand in hands {
            assert!(hand.contacts.iter().any(|contact| contact.force().length() > 1.0));
            assert!(hand.score.is_some() && hand.key_frames.is_empty());
            let epsilon = hand.margin(v1::Check::Closure);
            assert!(epsilon.is_some() && epsilon == hands[0].margin(v1::Check::Closure));
        }
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

/// Holdouts that are answered quickly.
const HOLDOUTS: [&str; 3] = ["remote-genhold3", "scissors-hold1", "scissors-genhold1"];

/// A request for one of them with key frames.
fn rated(name: &str, convention: v1::Convention) -> v1::FindGraspRequest {
    let request = built_in_request(holdout(name).expect("a built-in holdout"))
        .with_seed(5)
        .with_convention(convention)
        .with_key_frames();
    with(reproducible(request), |request| {
        if convention != v1::Convention::Openxr {
            // The giver's pose is written in the built-in holdouts' own convention.
            request.holdout_mut().presenting_hand = None;
        }
    })
}

/// The terms of a score and their weights, as the server's page lists them.
fn weights_on_the_page() -> BTreeMap<&'static str, f32> {
    let page = include_str!("../../../server/README.md");
    let (_, table) = page
        .split_once("| Term | Weight |")
        .expect("the page has the table");
    let (table, _) = table.split_once("\n\n").expect("the table ends");
    let rows = table.lines().skip(2).flat_map(|row| {
        let mut cells = row.trim_start_matches('|').split('|').map(str::trim);
        let (names, weight) = (cells.next().unwrap_or_default(), cells.next().unwrap_or_default());
        let weight = weight
            .trim_end_matches(" each")
            .parse()
            .expect("a weight is a number");
        names.split(", ").map(move |name| (name, weight))
    });
    rows.collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_score_is_the_weighted_mean_of_its_terms() {
    let server = TestServer::start().await;
    for name in HOLDOUTS {
        let grasp = grasp(&server, rated(name, v1::Convention::Openxr)).await;
        let score = grasp.score.expect("a physical grasp is rated");
        let terms = &grasp.score_terms;
        let in_answer = terms.iter().map(|term| (term.name.as_str(), term.weight));
        assert_eq!(in_answer.collect::<BTreeMap<_, _>>(), weights_on_the_page());
        let (mut sum, mut weights) = (0.0, 0.0);
        for term in terms {
            assert!((0.0..=1.0).contains(&term.value), "{name}: {term:?}");
            assert!(term.weight > 0.0, "{name}: {term:?}");
            sum += term.value * term.weight;
            weights += term.weight;
        }
        assert!((score - sum / weights).abs() < 1e-5, "{name}: {score}, {terms:?}");
        // Comfort is rated by E alone, closeness by the reported clearance.
        let value = |wanted: &str| {
            let term = terms.iter().find(|term| term.name == wanted);
            term.expect("named above").value
        };
        let comfort = grasp.thesis.expect("it has a comfort").comfort;
        assert!(
            (value("comfort") - (-comfort / 0.04).exp()).abs() < 1e-4,
            "{name}"
        );
        let clearance = grasp.margin(v1::Check::GiverClearance);
        let expected = (clearance.expect("there is a giver") / 0.04).min(1.0);
        assert!((value("giver_clearance") - expected).abs() < 1e-4, "{name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn key_frames_end_in_the_grasp() {
    use v1::KeyFrameKind::{Approach, Close, PreGrasp};
    let server = TestServer::start().await;
    for (convention, per_metre) in [(v1::Convention::Openxr, 1.0), (v1::Convention::Unreal, 100.0)] {
        let grasp = grasp(&server, rated(HOLDOUTS[0], convention)).await;
        let [approach, pre_grasp, close] = &grasp.key_frames[..] else {
            panic!("{:?}", grasp.key_frames);
        };
        let kinds = [approach, pre_grasp, close].map(v1::KeyFrame::kind);
        assert_eq!(kinds, [Approach, PreGrasp, Close]);
        assert_eq!(close.hand, grasp.hand);
        let [from, to] = [approach, pre_grasp].map(|frame| {
            let hand = frame.hand.as_ref().expect("a key frame has a hand");
            hand.client_from_wrist.expect("a hand has a place").position()
        });
        let way = from.distance(to) / per_metre;
        assert!((way - 0.12).abs() < 1e-4, "{way} m");
    }
}

fn origin(answer: &v1::FindGraspResponse) -> &v1::GraspOrigin {
    answer.origin.as_ref().expect("every answer has an origin")
}

/// The request for this attempt alone.
fn replay(request: v1::FindGraspRequest, attempt: Option<u64>) -> v1::FindGraspRequest {
    with(request, |request| {
        let search = request.search_mut();
        search.replay_attempt = attempt;
        search.max_attempts = None;
        search.choice = v1::GraspChoice::Unspecified.into();
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_workers_gives_the_same_bytes() {
    for request in [floating_remote(), held_remote()] {
        let request = reproducible(request);
        let mut answers = Vec::new();
        for workers in [1, 2, 3, 8] {
            let server = TestServer::start_with(|config| config.workers = workers.try_into().unwrap()).await;
            let answer = find(&server, request.clone()).await;
            assert_eq!(answer.outcome(), v1::Outcome::Found, "{request:?}");
            answers.push(unchanging(answer));
            server.stop().await;
        }
        assert!(answers.windows(2).all(|pair| pair[0] == pair[1]));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_absent_seed_is_drawn_and_the_reported_one_replays_the_grasp() {
    let server = TestServer::start().await;
    let unseeded = with(floating_remote(), |request| request.search_mut().seed = None);
    let first = find(&server, unseeded.clone()).await;
    let found = origin(&first);
    let other = find(&server, unseeded).await;
    assert_ne!(found.seed, origin(&other).seed);
    let request = floating_remote()
        .with_seed(found.seed)
        .receiving(first.hand().expect("it can be held").handedness());
    let second = find(&server, replay(request, found.attempt)).await;
    assert_eq!(second.grasps, first.grasps);
    assert_eq!((second.attempts(), origin(&second).attempt), (1, found.attempt));
}
