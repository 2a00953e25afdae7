//! Further hands and obstacles that break the contract are rejected with every wrong field.

use glam::Vec3;
use grasp_proto::v1::{self, shape::Kind};
use grasp_tests::TestServer;

use crate::{
    fixtures::{assert_blamed, floating_remote, held_remote, of_thesis},
    parts::with,
};

type Mutation = fn(&mut v1::FindGraspRequest);

fn vector(x: f32, y: f32, z: f32) -> v1::Vector3 {
    v1::Vector3 { x, y, z }
}

/// The remote with two further hands, a tapered capsule, a box and a floor, far away.
fn request() -> v1::FindGraspRequest {
    let holdout = held_remote().holdout.expect("it has a holdout");
    let hand = holdout.presenting_hand.expect("it is held");
    let capsule = v1::Shape {
        kind: Some(Kind::Tube(v1::TubeShape {
            points: vec![vector(0.0, -1.0, 0.0), vector(0.0, -1.0, 0.5)],
            radii: vec![0.1, 0.2],
        })),
    };
    let below = v1::Pose {
        position: Some(vector(0.0, -2.0, 0.0)),
        orientation: None,
    };
    let floor = v1::Shape::half_space(Vec3::NEG_Y * 2.0, Vec3::NEG_Y);
    with(floating_remote(), |request| {
        let holdout = request.holdout_mut();
        holdout.other_hands = vec![hand.clone(), hand];
        holdout.obstacles = vec![
            capsule,
            v1::Shape::solid_box(below, Vec3::new(5.0, 0.01, 5.0)),
            floor,
        ];
        request.search_mut().max_attempts = Some(1);
    })
}

fn second_hand(request: &mut v1::FindGraspRequest) -> &mut v1::HandPose {
    match &mut request.holdout_mut().other_hands[1].form {
        Some(v1::presenting_hand::Form::Pose(hand)) => hand,
        other => panic!("{other:?}"),
    }
}

fn obstacles(request: &mut v1::FindGraspRequest) -> &mut Vec<v1::Shape> {
    &mut request.holdout_mut().obstacles
}

fn tube_of(request: &mut v1::FindGraspRequest) -> &mut v1::TubeShape {
    match &mut obstacles(request)[0].kind {
        Some(Kind::Tube(tube)) => tube,
        other => panic!("{other:?}"),
    }
}

fn box_of(request: &mut v1::FindGraspRequest) -> &mut v1::BoxShape {
    match &mut obstacles(request)[1].kind {
        Some(Kind::Box(solid)) => solid,
        other => panic!("{other:?}"),
    }
}

fn floor_of(request: &mut v1::FindGraspRequest) -> &mut v1::HalfSpaceShape {
    match &mut obstacles(request)[2].kind {
        Some(Kind::HalfSpace(side)) => side,
        other => panic!("{other:?}"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_further_hands_and_obstacles_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(request()).await;
    assert!(answer.is_ok(), "the unchanged request is accepted: {answer:?}");
    let table: &[(Mutation, &str)] = &[
        (|r| r.holdout_mut().other_hands[0].form = None, "other_hands[0]"),
        (
            |r| second_hand(r).rig = "rigs/robot".into(),
            "other_hands[1].pose.rig",
        ),
        (
            |r| second_hand(r).ring.as_mut().unwrap().base_pitch = f32::NAN,
            "other_hands[1].pose.ring.base_pitch",
        ),
        (
            |r| {
                let hand = second_hand(r).clone();
                r.holdout_mut().other_hands = vec![hand.into(); 4];
            },
            "other_hands",
        ),
        (|r| obstacles(r)[1].kind = None, "obstacles[1]"),
        (|r| tube_of(r).points.clear(), "obstacles[0].tube.points"),
        (
            |r| {
                tube_of(r).points = vec![vector(0.0, -1.0, 0.0); 65];
                obstacles(r).truncate(1);
            },
            "obstacles[0].tube.points",
        ),
        (
            |r| tube_of(r).points[1].y = f32::INFINITY,
            "obstacles[0].tube.points[1]",
        ),
        (|r| tube_of(r).radii.clear(), "obstacles[0].tube.radii"),
        (|r| tube_of(r).radii.push(0.1), "obstacles[0].tube.radii"),
        (|r| tube_of(r).radii[0] = 0.0, "obstacles[0].tube.radii[0]"),
        (|r| tube_of(r).radii[1] = -0.1, "obstacles[0].tube.radii[1]"),
        (|r| tube_of(r).radii[1] = 1001.0, "obstacles[0].tube.radii[1]"),
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
                box_of(r).pose = Some(v1::Pose {
                    position: Some(vector(0.0, 1e6, 0.0)),
                    orientation: None,
                });
            },
            "obstacles[1].box.pose.position",
        ),
        (|r| floor_of(r).normal = None, "obstacles[2].half_space.normal"),
        (
            |r| floor_of(r).normal = Some(vector(0.0, 0.0, 0.0)),
            "obstacles[2].half_space.normal",
        ),
        (
            |r| floor_of(r).point = Some(vector(0.0, f32::NAN, 0.0)),
            "obstacles[2].half_space.point",
        ),
        (|r| *obstacles(r) = vec![obstacles(r)[0].clone(); 65], "obstacles"),
    ];
    for (mutate, field) in table {
        let field = format!("holdout.{field}");
        assert_blamed(&server, with(request(), mutate), &[&field]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn thesis_validity_rejects_further_hands_and_obstacles() {
    let server = TestServer::start().await;
    let thesis = of_thesis(request());
    let fields = ["holdout.other_hands", "holdout.obstacles"];
    assert_blamed(&server, thesis, &fields).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_hands_and_obstacles_are_reported_together() {
    let server = TestServer::start().await;
    let wrong = with(request(), |request| {
        second_hand(request).handedness = 0;
        *tube_of(request) = v1::TubeShape {
            points: vec![vector(f32::NAN, 0.0, 0.0), vector(0.0, 0.0, 1e6)],
            radii: vec![f32::NAN, 2000.0],
        };
        *box_of(request) = v1::BoxShape::default();
        *floor_of(request) = v1::HalfSpaceShape::default();
    });
    let fields = [
        "holdout.other_hands[1].pose.handedness",
        "holdout.obstacles[0].tube.points[0]",
        "holdout.obstacles[0].tube.points[1]",
        "holdout.obstacles[0].tube.radii[0]",
        "holdout.obstacles[0].tube.radii[1]",
        "holdout.obstacles[1].box.half_extents",
        "holdout.obstacles[2].half_space.normal",
    ];
    assert_blamed(&server, wrong, &fields).await;
    server.stop().await;
}
