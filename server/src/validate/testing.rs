//! Helpers of tests.

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, presenting_hand::Form, receiver::Body, shape::Kind};

use super::{Field, Violations, fixtures::stretched_hand};
use crate::{convention::Convention, error::ServiceError};

type Request = v1::FindGraspRequest;

/// All conventions.
pub(crate) const CONVENTIONS: [Convention; 6] = [
    Convention::OpenXr,
    Convention::Unity,
    Convention::UnityFlipX,
    Convention::Unreal,
    Convention::UnrealXzy,
    Convention::Godot,
];

/// The fields that an answer blames and what it says of them; `None` if it is right.
pub(super) fn violations_of<T>(answer: Result<T, ServiceError>) -> Vec<(String, String)> {
    match answer {
        Ok(_) => Vec::new(),
        Err(ServiceError::Invalid(violations)) => violations
            .into_iter()
            .map(|violation| (violation.field, violation.description))
            .collect(),
        Err(other) => panic!("{other}"),
    }
}

/// The fields that an answer blames; `None` if it is right.
pub(super) fn blamed<T>(answer: Result<T, ServiceError>) -> Vec<String> {
    violations_of(answer)
        .into_iter()
        .map(|(field, _)| field)
        .collect()
}

/// What is read of a field of this name, and the fields that are blamed.
pub(super) fn read_at<T>(name: &str, read: impl FnOnce(Field<'_>) -> T) -> (T, Vec<String>) {
    let violations = Violations::default();
    let value = read(violations.field(name));
    (value, blamed(violations.finish(())))
}

pub(super) fn vector(x: f32) -> v1::Vector3 {
    (Vec3::X * x).into()
}

pub(super) fn placed(x: f32) -> v1::Pose {
    v1::Pose {
        position: Some(vector(x)),
        orientation: None,
    }
}

pub(super) fn turned(w: f32) -> v1::Pose {
    v1::Pose {
        position: None,
        orientation: Some(v1::Quaternion {
            w,
            ..Default::default()
        }),
    }
}

pub(super) const fn duration(seconds: i64, nanos: i32) -> prost_types::Duration {
    prost_types::Duration { seconds, nanos }
}

pub(super) fn object(request: &mut Request, name: &str) {
    request.holdout_mut().object = name.to_owned();
}

pub(super) fn giver(request: &mut Request) -> &mut v1::HandPose {
    match request
        .holdout_mut()
        .presenting_hand
        .as_mut()
        .unwrap()
        .form
        .as_mut()
    {
        Some(Form::Pose(hand)) => hand,
        _ => panic!("the hand is posed"),
    }
}

pub(super) fn held(request: &mut Request) -> &mut v1::HandPose {
    request.current.as_mut().unwrap().grasp.as_mut().unwrap()
}

/// The hand as it is now, where the grasp is unless it is changed.
pub(super) fn present(request: &mut Request) -> &mut v1::HandPose {
    let current = request.current.as_mut().unwrap();
    current.hand.get_or_insert_with(|| current.grasp.clone().unwrap())
}

pub(super) fn tube(request: &mut Request) -> &mut v1::TubeShape {
    match request.holdout_mut().obstacles[0].kind.as_mut() {
        Some(Kind::Tube(tube)) => tube,
        _ => panic!("the first is a tube"),
    }
}

pub(super) fn half_extents(request: &mut Request, half_extents: Vec3) {
    request.holdout_mut().obstacles[1] = v1::Shape::solid_box(v1::Pose::default(), half_extents);
}

pub(super) fn half_space(request: &mut Request) -> &mut v1::HalfSpaceShape {
    match request.holdout_mut().obstacles[2].kind.as_mut() {
        Some(Kind::HalfSpace(half_space)) => half_space,
        _ => panic!("the third is a half-space"),
    }
}

pub(super) fn shoulder(request: &mut Request, x: f32) {
    request.receiver_mut().body = Some(Body::ClientShoulder(vector(x)));
}

pub(super) fn standing(request: &mut Request, root: v1::Pose, height: f32) {
    request.receiver_mut().body = Some(Body::ClientFromRoot(root));
    request.receiver_mut().height = height;
}

pub(super) fn thesis(request: &mut Request) -> &mut v1::ThesisOptions {
    request.requirements_mut().thesis.get_or_insert_default()
}

/// A request in which most fields are set.
pub(super) fn valid() -> Request {
    let wrist = v1::Pose::new(Vec3::new(0.0, 0.1, 0.2), Quat::IDENTITY);
    let hand = |side| stretched_hand(side).with_object_from_wrist(wrist);
    Request {
        receiver: Some(v1::Receiver {
            handedness: v1::Handedness::Right.into(),
            upper_arm_length: Some(0.3),
            max_reach: Some(0.7),
            ..v1::Receiver::with_shoulder(Vec3::new(0.1, 1.2, 0.0))
        }),
        requirements: Some(v1::Requirements {
            client_approach: Some(vector(1.0)),
            max_approach_angle: 0.4,
            ..Default::default()
        }),
        ..Request::new("objects/remote")
    }
    .with_presenting_hand(hand(v1::Handedness::Left))
    .with_obstacle(v1::Shape::capsule(Vec3::ZERO, Vec3::X, 0.1))
    .with_obstacle(v1::Shape::solid_box(v1::Pose::default(), Vec3::ONE))
    .with_obstacle(v1::Shape::half_space(Vec3::ZERO, Vec3::Y))
    .with_current(v1::CurrentGrasp::new(hand(v1::Handedness::Right)))
}
