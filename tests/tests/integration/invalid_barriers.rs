//! Further hands and obstacles that break the contract are rejected with every wrong field.

use grasp_proto::v1::{self, obstacle::Shape};
use grasp_tests::TestServer;

use crate::fixtures::{assert_blamed, floating_remote, held_remote};

type Mutation = fn(&mut v1::FindGraspRequest);

fn vector(x: f32, y: f32, z: f32) -> v1::Vector3 {
    v1::Vector3 { x, y, z }
}

fn capsule() -> v1::CapsuleShape {
    v1::CapsuleShape {
        client_start: Some(vector(0.0, -1.0, 0.0)),
        client_end: Some(vector(0.0, -1.0, 0.5)),
        radius: 0.1,
        end_radius: Some(0.2),
    }
}

fn solid_box() -> v1::BoxShape {
    v1::BoxShape {
        client_from_box: None,
        half_extents: Some(vector(5.0, 0.01, 5.0)),
    }
}

fn obstacle(shape: Shape) -> v1::Obstacle {
    v1::Obstacle { shape: Some(shape) }
}

/// The remote with two further hands, a capsule and a box, far away.
fn request() -> v1::FindGraspRequest {
    let hand = held_remote().presenting_hand.expect("it is held");
    v1::FindGraspRequest {
        other_hands: vec![hand.clone(), hand],
        obstacles: vec![
            obstacle(Shape::Capsule(capsule())),
            obstacle(Shape::Box(v1::BoxShape {
                client_from_box: Some(v1::Pose {
                    position: Some(vector(0.0, -2.0, 0.0)),
                    orientation: None,
                }),
                ..solid_box()
            })),
        ],
        max_attempts: Some(1),
        ..floating_remote()
    }
}

fn angles(request: &mut v1::FindGraspRequest) -> &mut v1::HandAngles {
    match &mut request.other_hands[1].form {
        Some(v1::presenting_hand::Form::Angles(angles)) => angles,
        other => panic!("{other:?}"),
    }
}

fn capsule_of(request: &mut v1::FindGraspRequest) -> &mut v1::CapsuleShape {
    match &mut request.obstacles[0].shape {
        Some(Shape::Capsule(capsule)) => capsule,
        other => panic!("{other:?}"),
    }
}

fn box_of(request: &mut v1::FindGraspRequest) -> &mut v1::BoxShape {
    match &mut request.obstacles[1].shape {
        Some(Shape::Box(shape)) => shape,
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_further_hands_and_obstacles_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(request()).await;
    assert!(answer.is_ok(), "the unchanged request is accepted: {answer:?}");
    let table: &[(Mutation, &str)] = &[
        (|r| r.other_hands[0].form = None, "other_hands[0]"),
        (|r| angles(r).rig = "robot".into(), "other_hands[1].angles.rig"),
        (
            |r| angles(r).digits[3].base_pitch = f32::NAN,
            "other_hands[1].angles.digits[3].base_pitch",
        ),
        (
            |r| r.other_hands = vec![r.other_hands[0].clone(); 4],
            "other_hands",
        ),
        (|r| r.obstacles[1].shape = None, "obstacles[1]"),
        (
            |r| capsule_of(r).client_start = None,
            "obstacles[0].capsule.client_start",
        ),
        (
            |r| capsule_of(r).client_end = Some(vector(0.0, f32::INFINITY, 0.0)),
            "obstacles[0].capsule.client_end",
        ),
        (|r| capsule_of(r).radius = 0.0, "obstacles[0].capsule.radius"),
        (
            |r| capsule_of(r).end_radius = Some(-0.1),
            "obstacles[0].capsule.end_radius",
        ),
        (|r| box_of(r).half_extents = None, "obstacles[1].box.half_extents"),
        (
            |r| box_of(r).half_extents = Some(vector(1.0, 0.0, 1.0)),
            "obstacles[1].box.half_extents",
        ),
        (
            |r| box_of(r).half_extents = Some(vector(1.0, f32::NAN, -1.0)),
            "obstacles[1].box.half_extents",
        ),
        (
            |r| box_of(r).half_extents = Some(vector(1.0, 1.0, 1001.0)),
            "obstacles[1].box.half_extents",
        ),
        (
            |r| {
                box_of(r).client_from_box = Some(v1::Pose {
                    position: Some(vector(0.0, 1e6, 0.0)),
                    orientation: None,
                });
            },
            "obstacles[1].box.client_from_box.position",
        ),
        (|r| r.obstacles = vec![r.obstacles[0]; 65], "obstacles"),
    ];
    for (mutate, field) in table {
        let mut request = request();
        mutate(&mut request);
        assert_blamed(&server, request, &[field]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn thesis_validity_rejects_further_hands_and_obstacles() {
    let server = TestServer::start().await;
    let mut thesis = request();
    thesis.validity = v1::Validity::Thesis.into();
    assert_blamed(&server, thesis, &["other_hands", "obstacles"]).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_hands_and_obstacles_are_reported_together() {
    let server = TestServer::start().await;
    let mut wrong = request();
    angles(&mut wrong).handedness = 0;
    *capsule_of(&mut wrong) = v1::CapsuleShape {
        client_start: None,
        client_end: None,
        radius: f32::NAN,
        end_radius: Some(2000.0),
    };
    *box_of(&mut wrong) = v1::BoxShape::default();
    let fields = [
        "other_hands[1].angles.handedness",
        "obstacles[0].capsule.client_start",
        "obstacles[0].capsule.client_end",
        "obstacles[0].capsule.radius",
        "obstacles[0].capsule.end_radius",
        "obstacles[1].box.half_extents",
    ];
    assert_blamed(&server, wrong, &fields).await;
    server.stop().await;
}
