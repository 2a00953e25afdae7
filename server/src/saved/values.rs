//! What records of objects and rigs have in common. Records have messages of their own, whose fields never change their numbers, so that
//! the contract may change.

use grasp_proto::v1;
use prost::{Enumeration, Message};

/// A point or a direction.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Vector {
    #[prost(float, tag = "1")]
    x: f32,
    #[prost(float, tag = "2")]
    y: f32,
    #[prost(float, tag = "3")]
    z: f32,
}

/// A rotation.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Quaternion {
    #[prost(float, tag = "1")]
    x: f32,
    #[prost(float, tag = "2")]
    y: f32,
    #[prost(float, tag = "3")]
    z: f32,
    #[prost(float, tag = "4")]
    w: f32,
}

/// A rigid transform.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vector>,
    #[prost(message, optional, tag = "2")]
    orientation: Option<Quaternion>,
}

/// The joint angles of a digit.
#[derive(Clone, Copy, PartialEq, Message)]
pub(crate) struct Angles {
    #[prost(float, tag = "1")]
    base_yaw: f32,
    #[prost(float, tag = "2")]
    base_pitch: f32,
    #[prost(float, tag = "3")]
    second_pitch: f32,
    #[prost(float, optional, tag = "4")]
    third_pitch: Option<f32>,
}

/// A hand, if it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Enumeration)]
#[repr(i32)]
pub(crate) enum Side {
    Either = 0,
    Left = 1,
    Right = 2,
}

impl From<v1::Vector3> for Vector {
    fn from(v1::Vector3 { x, y, z }: v1::Vector3) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector> for v1::Vector3 {
    fn from(Vector { x, y, z }: Vector) -> Self {
        Self { x, y, z }
    }
}

impl From<v1::Quaternion> for Quaternion {
    fn from(v1::Quaternion { x, y, z, w }: v1::Quaternion) -> Self {
        Self { x, y, z, w }
    }
}

impl From<Quaternion> for v1::Quaternion {
    fn from(Quaternion { x, y, z, w }: Quaternion) -> Self {
        Self { x, y, z, w }
    }
}

impl From<v1::Pose> for Pose {
    fn from(pose: v1::Pose) -> Self {
        Self {
            position: pose.position.map(Into::into),
            orientation: pose.orientation.map(Into::into),
        }
    }
}

impl From<Pose> for v1::Pose {
    fn from(pose: Pose) -> Self {
        Self {
            position: pose.position.map(Into::into),
            orientation: pose.orientation.map(Into::into),
        }
    }
}

impl From<v1::DigitAngles> for Angles {
    fn from(angles: v1::DigitAngles) -> Self {
        Self {
            base_yaw: angles.base_yaw,
            base_pitch: angles.base_pitch,
            second_pitch: angles.second_pitch,
            third_pitch: angles.third_pitch,
        }
    }
}

impl From<Angles> for v1::DigitAngles {
    fn from(angles: Angles) -> Self {
        Self {
            base_yaw: angles.base_yaw,
            base_pitch: angles.base_pitch,
            second_pitch: angles.second_pitch,
            third_pitch: angles.third_pitch,
        }
    }
}

impl From<v1::Handedness> for Side {
    fn from(handedness: v1::Handedness) -> Self {
        match handedness {
            v1::Handedness::Unspecified => Self::Either,
            v1::Handedness::Left => Self::Left,
            v1::Handedness::Right => Self::Right,
        }
    }
}

impl From<Side> for v1::Handedness {
    fn from(side: Side) -> Self {
        match side {
            Side::Either => Self::Unspecified,
            Side::Left => Self::Left,
            Side::Right => Self::Right,
        }
    }
}
