//! The receiver's body over the wire: the arm reaches, and the answer shows it.

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, receiver::Body};
use grasp_tests::TestServer;

use crate::{
    fixtures::{assert_blamed, floating_remote, held_remote, milliseconds, receiving},
    parts::{hand, reproducible, with},
};

/// In front of the remote at the origin, to the receiver's right, in metres.
const SHOULDER: Vec3 = Vec3::new(0.15, 0.25, 0.4);

/// A floating remote for a receiver's right hand.
fn request(receiver: v1::Receiver) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        receiver: Some(receiver),
        ..reproducible(floating_remote()).with_seed(5)
    }
    .receiving(v1::Handedness::Right)
}

async fn ask(server: &TestServer, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

/// The grasp that is found.
async fn grasp(server: &TestServer, request: &v1::FindGraspRequest) -> v1::Grasp {
    let answer = ask(server, request).await;
    answer.grasp().expect("it is within reach").clone()
}

/// Shoulder and elbow of an arm.
fn places(arm: &v1::Arm) -> [Vec3; 2] {
    [arm.client_shoulder, arm.client_elbow].map(|place| place.expect("an arm has it").into())
}

fn wrist(grasp: &v1::Grasp) -> Vec3 {
    grasp.client_from_wrist().expect("a hand has a wrist").position()
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
    let found = grasp(&server, &request(receiver)).await;
    let arm = found.arm.expect("the receiver has a body");
    assert!(places(&arm)[0].distance(SHOULDER) < 1e-5);
    assert_reaches(&arm, wrist(&found), [0.31, 0.25], 1e-4);
    // Without a giver or a body, there is no arm.
    let bare = grasp(&server, &request(v1::Receiver::default())).await;
    assert_eq!(bare.arm, None);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_arm_and_its_reach_bound_together() {
    let server = TestServer::start().await;
    let reaching = |upper_arm_length, max_reach| v1::Receiver {
        upper_arm_length,
        max_reach,
        ..v1::Receiver::with_shoulder(SHOULDER)
    };
    let far = |grasp: &v1::Grasp| wrist(grasp).distance(SHOULDER);
    let unbounded = grasp(&server, &request(reaching(Some(0.3), None))).await;
    let bound = far(&unbounded) - 0.01;
    let bounded = grasp(&server, &request(reaching(Some(0.3), Some(bound)))).await;
    assert!(far(&bounded) <= bound + 1e-5, "{} {bound}", far(&bounded));
    assert!(bounded.arm.is_some());
    // Without lengths, there is no arm, only how far the wrist may be, of either hand.
    let mut armless = request(reaching(None, Some(bound)));
    armless.receiver_mut().handedness = 0;
    let within = grasp(&server, &armless).await;
    assert!(far(&within) <= bound + 1e-5, "{} {bound}", far(&within));
    assert_eq!(within.arm, None);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reach_of_a_standing_body_is_that_of_either_shoulder() {
    let server = TestServer::start().await;
    let root = v1::Pose::new(Vec3::new(0.0, -1.15, 0.45), Quat::IDENTITY);
    let mut request = request(v1::Receiver {
        max_reach: Some(0.45),
        ..v1::Receiver::standing(root, 1.7)
    });
    request.receiver_mut().handedness = 0;
    for seed in 0..4 {
        request.search_mut().seed = Some(seed);
        let found = grasp(&server, &request).await;
        let [shoulder, _] = places(&found.arm.expect("the receiver has a body"));
        let far = shoulder.distance(wrist(&found));
        assert!(far <= 0.45 + 1e-4, "{far}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_standing_body_is_the_same_in_every_convention() {
    let server = TestServer::start().await;
    // Behind the remote on +Z, facing it, with the ground 1.15 m below.
    let root = v1::Pose::new(Vec3::new(-0.05, -1.15, 0.45), Quat::from_rotation_y(0.1));
    let found = grasp(&server, &request(v1::Receiver::standing(root, 1.7))).await;
    let own = found.arm.expect("the receiver has a body");
    let shoulder = root.transform_point(1.7 * Vec3::new(0.129, 0.818, 0.0));
    assert!(places(&own)[0].distance(shoulder) < 1e-4);
    assert_reaches(&own, wrist(&found), [0.186 * 1.7, 0.146 * 1.7], 1e-3);
    // Unity mirrors z; Unreal: +X forward (-z), +Y right (+x), +Z up (+y), in centimetres.
    let unity = |v: Vec3| Vec3::new(v.x, v.y, -v.z);
    let unreal = |v: Vec3| 100.0 * Vec3::new(-v.z, v.x, v.y);
    let same = |v: Vec3| v;
    let converted: [&dyn Fn(Vec3) -> Vec3; 3] = [&unity, &unreal, &same];
    let engines = [
        (v1::Convention::Unity, Quat::from_rotation_y(-0.1), 1.0),
        (v1::Convention::Unreal, Quat::from_rotation_z(-0.1), 100.0),
        (v1::Convention::Godot, root.orientation(), 1.0),
    ];
    for ((convention, orientation, unit), convert) in engines.into_iter().zip(converted) {
        let root = v1::Pose::new(convert(root.position()), orientation);
        let request = request(v1::Receiver::standing(root, 1.7 * unit)).with_convention(convention);
        let arm = grasp(&server, &request).await.arm;
        let arm = arm.expect("the receiver has a body");
        for (own, theirs) in places(&own).into_iter().zip(places(&arm)) {
            let distance = convert(own).distance(theirs);
            assert!(distance < 2e-3 * unit, "{convention:?}: {distance}");
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_lets_the_search_choose_the_hand_with_its_own_shoulder() {
    let server = TestServer::start().await;
    let root = v1::Pose::new(Vec3::new(0.0, -1.15, 0.45), Quat::IDENTITY);
    let mut request = request(v1::Receiver::standing(root, 1.7));
    request.receiver_mut().handedness = 0;
    for seed in 0..4 {
        request.search_mut().seed = Some(seed);
        let found = grasp(&server, &request).await;
        let arm = found.arm.expect("the receiver has a body");
        let handedness = hand(&found).handedness();
        let side = match handedness {
            v1::Handedness::Left => -1.0,
            _ => 1.0,
        };
        let shoulder = root.transform_point(1.7 * Vec3::new(side * 0.129, 0.818, 0.0));
        assert!(places(&arm)[0].distance(shoulder) < 1e-4, "{handedness:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_beyond_the_arm_is_rejected_and_limited_by_reach() {
    let server = TestServer::start().await;
    let mut request = request(v1::Receiver::with_shoulder(Vec3::new(0.0, 0.3, 1.5)));
    request.search_mut().max_attempts = Some(200);
    let answer = ask(&server, &request).await;
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    let report = answer.report.expect("every answer has a report");
    assert!(
        report
            .rejections
            .iter()
            .any(|count| count.check() == v1::Check::Requirements)
    );
    let limits: Vec<_> = report.limits.iter().map(v1::Verdict::check).collect();
    assert_eq!(limits, [v1::Check::Reach]);
    server.stop().await;
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
        let arm = grasp(&server, &request).await.arm;
        assert_eq!(arm.is_some(), is_assumed, "{body:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_receiver_is_validated() {
    let server = TestServer::start().await;
    let vector = |x: f32| v1::Vector3 { x, y: 0.0, z: 0.0 };
    let shoulder = |x: f32| v1::Receiver {
        body: Some(Body::ClientShoulder(vector(x))),
        ..receiving(v1::Handedness::Right)
    };
    let standing = |height: f32| v1::Receiver {
        body: Some(Body::ClientFromRoot(v1::Pose::default())),
        height,
        ..receiving(v1::Handedness::Right)
    };
    let of = |receiver: v1::Receiver| v1::FindGraspRequest {
        receiver: Some(receiver),
        ..floating_remote()
    };
    let bones = v1::Receiver {
        upper_arm_length: Some(0.7),
        forearm_length: Some(0.0),
        ..shoulder(0.5)
    };
    let reach = |max_reach: f32, receiver: v1::Receiver| v1::Receiver {
        max_reach: Some(max_reach),
        ..receiver
    };
    let no_body = || receiving(v1::Handedness::Right);
    let cases: Vec<(v1::FindGraspRequest, &[&str])> = vec![
        (of(shoulder(f32::NAN)), &["receiver.client_shoulder"]),
        (of(shoulder(3.1)), &["receiver.client_shoulder"]),
        (of(standing(0.0)), &["receiver.height"]),
        (of(standing(2.6)), &["receiver.height"]),
        (
            of(bones),
            &["receiver.upper_arm_length", "receiver.forearm_length"],
        ),
        (of(reach(0.0, shoulder(0.5))), &["receiver.max_reach"]),
        (of(reach(f32::NAN, standing(1.7))), &["receiver.max_reach"]),
        (of(reach(0.5, no_body())), &["receiver.max_reach"]),
        (
            with(of(no_body()), |request| {
                request.receiver_mut().body = Some(Body::Anywhere(true));
                request.receiver_mut().max_reach = Some(0.5);
            }),
            &["receiver.max_reach"],
        ),
        (
            with(of(standing(1.7)), |request| {
                request.requirements_mut().thesis = Some(thesis());
            }),
            &["receiver.client_from_root"],
        ),
        (
            of(v1::Receiver {
                handedness: 0,
                both_hands: true,
                ..standing(1.7)
            }),
            &["receiver.client_from_root"],
        ),
        (
            of(v1::Receiver {
                handedness: 0,
                ..shoulder(0.5)
            }),
            &["receiver.handedness"],
        ),
        (
            of(v1::Receiver {
                handedness: 0,
                upper_arm_length: Some(0.3),
                ..reach(0.6, shoulder(0.5))
            }),
            &["receiver.handedness"],
        ),
        (
            of(v1::Receiver {
                handedness: 9,
                ..Default::default()
            }),
            &["receiver.handedness"],
        ),
        (
            with(floating_remote(), |request| {
                request.search_mut().refinement_time = Some(prost_types::Duration {
                    seconds: 0,
                    nanos: -1,
                });
            }),
            &["search.refinement_time"],
        ),
    ];
    for (request, fields) in cases {
        assert_blamed(&server, request, fields).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn thesis_validity_knows_no_body_but_a_reach() {
    let server = TestServer::start().await;
    let of = |receiver| {
        with(request(receiver), |request| {
            request.requirements_mut().thesis = Some(thesis());
        })
    };
    let anywhere = v1::Receiver {
        body: Some(Body::Anywhere(true)),
        ..Default::default()
    };
    assert_eq!(grasp(&server, &of(anywhere)).await.arm, None);
    let within = v1::Receiver {
        max_reach: Some(0.45),
        ..v1::Receiver::with_shoulder(SHOULDER)
    };
    let found = grasp(&server, &of(within)).await;
    assert!(wrist(&found).distance(SHOULDER) <= 0.45 + 1e-5);
    server.stop().await;
}

/// The checks of the thesis.
fn thesis() -> v1::ThesisOptions {
    v1::ThesisOptions {
        thesis_validity: true,
        ..Default::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refinement_of_no_time_takes_the_first_valid_attempt() {
    let server = TestServer::start().await;
    let attempt = async |refinement_time: Option<prost_types::Duration>, seed: u64| {
        let request = with(reproducible(held_remote()), |request| {
            request.search_mut().refinement_time = refinement_time;
        });
        let request = request.receiving(v1::Handedness::Right).with_seed(seed);
        let answer = ask(&server, &request).await;
        answer
            .origin
            .and_then(|origin| origin.attempt)
            .expect("it can be taken")
    };
    let mut improved = 0;
    for seed in 0..8 {
        let first = attempt(Some(milliseconds(0)), seed).await;
        // A reproducible search counts attempts, whatever the time.
        let short = attempt(Some(milliseconds(1)), seed).await;
        assert_eq!(short, attempt(None, seed).await);
        assert!((first..=first + 16).contains(&short), "{first} {short}");
        improved += usize::from(short > first);
    }
    assert!(improved > 0, "no first grasp was improved");
    server.stop().await;
}
