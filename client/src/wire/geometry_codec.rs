//! Vectors, poses and durations.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::v1;

use super::Malformed;
use crate::{pose::Pose, query::Convention};

pub(super) fn vector_to_wire(v: Vec3) -> v1::Vector3 {
    v1::Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

pub(super) fn vector_from_wire(v: v1::Vector3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

pub(super) fn pose_to_wire(pose: Pose) -> v1::Pose {
    let q = pose.orientation;
    v1::Pose {
        position: Some(vector_to_wire(pose.position)),
        orientation: Some(v1::Quaternion {
            x: q.x,
            y: q.y,
            z: q.z,
            w: q.w,
        }),
    }
}

/// An absent pose, position or orientation is the identity's.
pub(super) fn pose_from_wire(pose: Option<v1::Pose>) -> Pose {
    let pose = pose.unwrap_or_default();
    Pose {
        position: pose.position.map_or(Vec3::ZERO, vector_from_wire),
        orientation: pose
            .orientation
            .map_or(Quat::IDENTITY, |q| Quat::from_xyzw(q.x, q.y, q.z, q.w)),
    }
}

pub(super) fn convention_to_wire(convention: Convention) -> v1::Convention {
    match convention {
        Convention::OpenXr => v1::Convention::Openxr,
        Convention::Unity => v1::Convention::Unity,
        Convention::Unreal => v1::Convention::Unreal,
        Convention::Godot => v1::Convention::Godot,
        Convention::UnityFlipX => v1::Convention::UnityFlipX,
        Convention::UnrealXzy => v1::Convention::UnrealXzy,
    }
}

/// An unspecified convention is the default.
pub(super) fn convention_from_wire(field: &str, convention: i32) -> Result<Convention, Malformed> {
    match v1::Convention::try_from(convention) {
        Ok(v1::Convention::Unspecified | v1::Convention::Openxr) => Ok(Convention::OpenXr),
        Ok(v1::Convention::Unity) => Ok(Convention::Unity),
        Ok(v1::Convention::Unreal) => Ok(Convention::Unreal),
        Ok(v1::Convention::Godot) => Ok(Convention::Godot),
        Ok(v1::Convention::UnityFlipX) => Ok(Convention::UnityFlipX),
        Ok(v1::Convention::UnrealXzy) => Ok(Convention::UnrealXzy),
        Err(_) => Err(Malformed::unknown_value(field, convention)),
    }
}

/// Saturates at the largest duration of the wire, far beyond any budget or deadline.
pub(super) fn duration_to_wire(duration: Duration) -> prost_types::Duration {
    prost_types::Duration {
        seconds: i64::try_from(duration.as_secs()).unwrap_or(i64::MAX),
        nanos: duration.subsec_nanos().cast_signed(),
    }
}

pub(super) fn duration_from_wire(
    field: &str,
    duration: prost_types::Duration,
) -> Result<Duration, Malformed> {
    Duration::try_from(duration)
        .map_err(|_| Malformed::new(field, format!("is {duration}, which is a negative duration")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converts_every_component_of_a_pose() {
        let pose = Pose::new(Vec3::new(1.0, 2.0, 3.0), Quat::from_xyzw(0.1, 0.2, 0.3, 0.9));
        let wire = pose_to_wire(pose);
        let orientation = wire.orientation.unwrap();
        assert_eq!(
            wire.position,
            Some(v1::Vector3 {
                x: 1.0,
                y: 2.0,
                z: 3.0
            })
        );
        assert_eq!(
            [orientation.x, orientation.y, orientation.z, orientation.w],
            [0.1, 0.2, 0.3, 0.9]
        );
        assert_eq!(pose_from_wire(Some(wire)), pose);
    }

    #[test]
    fn absent_parts_are_the_identity() {
        assert_eq!(pose_from_wire(None), Pose::IDENTITY);
        assert_eq!(pose_from_wire(Some(v1::Pose::default())), Pose::IDENTITY);
    }

    #[test]
    fn durations_round_trip_and_negative_ones_are_rejected() {
        let duration = Duration::new(3, 250_000_001);
        assert_eq!(
            duration_from_wire("budget", duration_to_wire(duration)),
            Ok(duration)
        );
        assert_eq!(duration_to_wire(Duration::MAX).seconds, i64::MAX);
        let negative = prost_types::Duration {
            seconds: -1,
            nanos: 0,
        };
        let error = duration_from_wire("budget", negative).unwrap_err();
        assert_eq!(error.path, "budget");
    }
}
