//! The receiver's body over the wire: the arm reaches, and the answer shows it.

use glam::{Quat, Vec3};
use grasp_client::{
    Arm, Convention, FindAnswer, FindRequest, Handedness, LimitKind, Outcome, Pose, Receiver, ReceiverStance,
    Rejection, Validity,
};
use grasp_proto::v1::{self, receiver::Body};
use grasp_tests::TestServer;

use crate::fixtures::{assert_blamed, floating_remote, held_remote, milliseconds, receiving};

/// In front of the remote at the origin, to the receiver's right, in metres.
const SHOULDER: Vec3 = Vec3::new(0.15, 0.25, 0.4);

/// A floating remote for a receiver's right hand.
fn request(receiver: Option<Receiver>) -> FindRequest {
    let mut request = FindRequest {
        seed: Some(5),
        reproducible: true,
        budget: Some(std::time::Duration::from_secs(10)),
        receiver,
        ..FindRequest::new("objects/remote")
    };
    request.receiving_hand.handedness = Some(Handedness::Right);
    request
}

async fn ask(server: &TestServer, request: &FindRequest) -> FindAnswer {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

/// Checks that the bones of an arm reach from its shoulder to a wrist.
fn assert_reaches(arm: &Arm, wrist: Vec3, [upper_arm, forearm]: [f32; 2], tolerance: f32) {
    let lengths = [
        arm.client_shoulder.distance(arm.client_elbow),
        arm.client_elbow.distance(wrist),
    ];
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
    let receiver = Receiver {
        upper_arm_length: Some(0.31),
        forearm_length: Some(0.25),
        ..Receiver::with_shoulder(SHOULDER)
    };
    let answer = ask(&server, &request(Some(receiver))).await;
    let grasp = answer.grasp.expect("the remote is within reach");
    let arm = grasp.arm.expect("the receiver has a body");
    assert!(!arm.assumed && arm.client_shoulder.distance(SHOULDER) < 1e-5);
    assert_reaches(&arm, grasp.client_from_wrist.position, [0.31, 0.25], 1e-4);
    // Without a giver or a body, there is no arm.
    let bare = ask(&server, &request(None)).await.grasp.expect("it can be held");
    assert_eq!(bare.arm, None);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_standing_body_is_the_same_in_every_convention() {
    let server = TestServer::start().await;
    // Behind the remote on +Z, facing it, with the ground 1.15 m below.
    let root = Pose::new(Vec3::new(-0.05, -1.15, 0.45), Quat::from_rotation_y(0.1));
    let own = ask(&server, &request(Some(Receiver::standing(root, 1.7)))).await;
    let grasp = own.grasp.expect("it is within reach");
    let own = grasp.arm.expect("the receiver has a body");
    let shoulder = root.transform_point(1.7 * Vec3::new(0.129, 0.818, 0.0));
    assert!(own.client_shoulder.distance(shoulder) < 1e-4);
    assert_reaches(
        &own,
        grasp.client_from_wrist.position,
        [0.186 * 1.7, 0.146 * 1.7],
        1e-3,
    );
    // Unity mirrors z; Unreal: +X forward (-z), +Y right (+x), +Z up (+y), in centimetres.
    let unity = |v: Vec3| Vec3::new(v.x, v.y, -v.z);
    let unreal = |v: Vec3| 100.0 * Vec3::new(-v.z, v.x, v.y);
    let same = |v: Vec3| v;
    let converted: [&dyn Fn(Vec3) -> Vec3; 3] = [&unity, &unreal, &same];
    let engines = [
        (Convention::Unity, Quat::from_rotation_y(-0.1), 1.0),
        (Convention::Unreal, Quat::from_rotation_z(-0.1), 100.0),
        (Convention::Godot, root.orientation, 1.0),
    ];
    for ((convention, orientation, unit), convert) in engines.into_iter().zip(converted) {
        let body = Receiver::standing(Pose::new(convert(root.position), orientation), 1.7 * unit);
        let request = FindRequest {
            convention,
            ..request(Some(body))
        };
        let arm = ask(&server, &request).await.grasp.and_then(|grasp| grasp.arm);
        let arm = arm.expect("it is within reach in every convention");
        for (own, theirs) in [
            (own.client_shoulder, arm.client_shoulder),
            (own.client_elbow, arm.client_elbow),
        ] {
            let distance = convert(own).distance(theirs);
            assert!(distance < 2e-3 * unit, "{convention:?}: {distance}");
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_lets_the_search_choose_the_hand_with_its_own_shoulder() {
    let server = TestServer::start().await;
    let root = Pose::new(Vec3::new(0.0, -1.15, 0.45), Quat::IDENTITY);
    let mut request = request(Some(Receiver::standing(root, 1.7)));
    request.receiving_hand.handedness = None;
    for seed in 0..4 {
        request.seed = Some(seed);
        let grasp = ask(&server, &request).await.grasp.expect("it is within reach");
        let arm = grasp.arm.expect("the receiver has a body");
        let side = match grasp.handedness {
            Handedness::Left => -1.0,
            Handedness::Right => 1.0,
        };
        let shoulder = root.transform_point(1.7 * Vec3::new(side * 0.129, 0.818, 0.0));
        assert!(
            arm.client_shoulder.distance(shoulder) < 1e-4,
            "{:?}",
            grasp.handedness
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_beyond_the_arm_is_rejected_and_limited_by_reach() {
    let server = TestServer::start().await;
    let request = FindRequest {
        max_attempts: Some(200),
        ..request(Some(Receiver::with_shoulder(Vec3::new(0.0, 0.3, 1.5))))
    };
    let answer = ask(&server, &request).await;
    assert_eq!(answer.outcome, Outcome::BudgetExhausted);
    let report = answer.report;
    assert!(
        report
            .rejections
            .iter()
            .any(|count| count.rejection == Rejection::UnmetConstraint)
    );
    let kinds: Vec<_> = report.limits.iter().map(|limit| limit.kind).collect();
    assert_eq!(kinds, [LimitKind::Reach]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stance_anywhere_assumes_no_arm() {
    let server = TestServer::start().await;
    let held = v1::FindGraspRequest {
        reproducible: true,
        ..held_remote()
    };
    for (stance, is_assumed) in [
        (v1::ReceiverStance::Unspecified, true),
        (v1::ReceiverStance::FacingGiver, true),
        (v1::ReceiverStance::Any, false),
    ] {
        let request = v1::FindGraspRequest {
            receiver_stance: stance.into(),
            ..held.clone()
        };
        let answer = server
            .grasps()
            .await
            .find_grasp(request)
            .await
            .unwrap()
            .into_inner();
        let arm = answer.grasp.expect("it can be taken").arm;
        assert_eq!(arm.is_some_and(|arm| arm.assumed), is_assumed, "{stance:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_receiver_is_validated() {
    let server = TestServer::start().await;
    let vector = |x: f32| v1::Vector3 { x, y: 0.0, z: 0.0 };
    let shoulder = |x: f32| v1::Receiver {
        body: Some(Body::ClientShoulder(vector(x))),
        ..Default::default()
    };
    let standing = |height: f32| v1::Receiver {
        body: Some(Body::Standing(v1::StandingBody {
            client_from_root: None,
            height,
        })),
        ..Default::default()
    };
    let with = |receiver: v1::Receiver| v1::FindGraspRequest {
        receiver: Some(receiver),
        receiving_hand: Some(receiving(v1::Handedness::Right)),
        ..floating_remote()
    };
    let bones = v1::Receiver {
        upper_arm_length: Some(0.7),
        forearm_length: Some(0.0),
        ..shoulder(0.5)
    };
    let any = v1::ReceiverStance::Any.into();
    let cases: [(v1::FindGraspRequest, &[&str]); 12] = [
        (with(v1::Receiver::default()), &["receiver"]),
        (with(shoulder(f32::NAN)), &["receiver.client_shoulder"]),
        (with(shoulder(3.1)), &["receiver.client_shoulder"]),
        (with(standing(0.0)), &["receiver.standing.height"]),
        (with(standing(2.6)), &["receiver.standing.height"]),
        (
            with(bones),
            &["receiver.upper_arm_length", "receiver.forearm_length"],
        ),
        (
            v1::FindGraspRequest {
                receiver_stance: any,
                ..with(shoulder(0.5))
            },
            &["receiver_stance"],
        ),
        (
            v1::FindGraspRequest {
                receiver_stance: 9,
                ..floating_remote()
            },
            &["receiver_stance"],
        ),
        (
            v1::FindGraspRequest {
                validity: v1::Validity::Thesis.into(),
                ..with(standing(1.7))
            },
            &["receiver"],
        ),
        (
            v1::FindGraspRequest {
                hands: v1::Hands::Both.into(),
                ..with(standing(1.7))
            },
            &["receiver"],
        ),
        (
            v1::FindGraspRequest {
                receiving_hand: None,
                ..with(shoulder(0.5))
            },
            &["receiving_hand.handedness"],
        ),
        (
            v1::FindGraspRequest {
                improvement: Some(prost_types::Duration {
                    seconds: 0,
                    nanos: -1,
                }),
                ..floating_remote()
            },
            &["improvement"],
        ),
    ];
    for (request, fields) in cases {
        assert_blamed(&server, request, fields).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn thesis_validity_ignores_the_stance() {
    let server = TestServer::start().await;
    let request = FindRequest {
        validity: Some(Validity::Thesis),
        receiver_stance: Some(ReceiverStance::Any),
        ..request(None)
    };
    let grasp = ask(&server, &request).await.grasp.expect("it can be held");
    assert_eq!(grasp.arm, None);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn improvement_of_none_takes_the_first_valid_attempt() {
    let server = TestServer::start().await;
    let attempt = async |improvement: Option<prost_types::Duration>, seed: u64| {
        let request = v1::FindGraspRequest {
            improvement,
            reproducible: true,
            seed: Some(seed),
            receiving_hand: Some(receiving(v1::Handedness::Right)),
            ..held_remote()
        };
        let answer = server
            .grasps()
            .await
            .find_grasp(request)
            .await
            .unwrap()
            .into_inner();
        answer
            .report
            .and_then(|report| report.attempt)
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
