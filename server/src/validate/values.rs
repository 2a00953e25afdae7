//! Checks numbers, vectors, poses and durations of the contract, wherever they are.

use std::{fmt::Display, ops::RangeInclusive, time::Duration};

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_synthesis::{base::pose::Pose, model::hand::Handedness};

use super::Field;
use crate::convention::Convention;

/// Largest number of characters that an error quotes of a client's text.
const MAX_QUOTED: usize = 80;

/// Largest deviation of a quaternion's norm from 1.
const QUATERNION_TOLERANCE: f32 = 0.01;

/// Largest distance from the client's origin along an axis, in metres, beyond which floats are coarser than 0.1 mm.
pub(super) const FARTHEST: f32 = 1000.0;

/// Largest coefficient of static friction; silicone rubber on itself stays below 2.
const MAX_FRICTION: f32 = 5.0;

/// Largest number of seconds in a `google.protobuf.Duration`: 10,000 years.
const MAX_DURATION_SECONDS: u64 = 315_576_000_000;

/// A client's text in quotes, shortened if it is long.
pub(crate) fn quoted(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(MAX_QUOTED).collect();
    let ellipsis = if characters.next().is_some() { "…" } else { "" };
    format!("{start:?}{ellipsis}")
}

/// A field of message type that must be present.
pub(super) fn required<T>(field: Field<'_>, sent: Option<T>) -> Option<T> {
    sent.or_else(|| field.reject("is absent; it is required"))
}

/// Adds a violation for each of the fields that is set.
pub(super) fn check_unset<const N: usize>(parent: Field<'_>, fields: [(&str, bool); N], why_not: &str) {
    for (name, _) in fields.into_iter().filter(|(_, is_set)| *is_set) {
        parent.child(name).add(format_args!("is set; {why_not}"));
    }
}

/// True if a list has at most so many elements, which are named by `what`.
pub(super) fn check_count(field: Field<'_>, count: usize, most: usize, what: &str) -> bool {
    if count > most {
        field.add(format_args!("has {count} {what}; it may have up to {most}"));
    }
    count <= most
}

/// True if a number is more than 0 and at most `most`.
pub(super) fn check_positive(field: Field<'_>, value: f32, most: f32) -> bool {
    let is_within = value > 0.0 && value <= most;
    if !is_within {
        field.add(format_args!(
            "is {value}; it must be more than 0 and at most {most}"
        ));
    }
    is_within
}

/// True if a number is in its range.
pub(super) fn check_within<T: Copy + PartialOrd + Display>(
    field: Field<'_>,
    value: T,
    range: RangeInclusive<T>,
) -> bool {
    let is_within = range.contains(&value);
    if !is_within {
        let (least, most) = range.into_inner();
        field.add(format_args!("is {value}; it must be {least} to {most}"));
    }
    is_within
}

/// A duration of more than 0.
pub(super) fn positive_duration(field: Field<'_>, sent: prost_types::Duration) -> Option<Duration> {
    let duration = duration(field, sent)?;
    if duration.is_zero() {
        return field.reject("is 0 s and 0 ns; it must be more than 0");
    }
    Some(duration)
}

/// A duration of at least 0.
pub(super) fn duration(field: Field<'_>, sent: prost_types::Duration) -> Option<Duration> {
    let text = || format!("{} s and {} ns", sent.seconds, sent.nanos);
    let in_range =
        sent.seconds.unsigned_abs() <= MAX_DURATION_SECONDS && sent.nanos.unsigned_abs() < 1_000_000_000;
    let one_sign = i64::from(sent.nanos.signum()) * sent.seconds.signum() >= 0;
    if !in_range || !one_sign {
        return field.reject(format_args!(
            "is {}, which is not a valid google.protobuf.Duration",
            text()
        ));
    }
    if let (Ok(seconds), Ok(nanos)) = (u64::try_from(sent.seconds), u32::try_from(sent.nanos)) {
        return Some(Duration::new(seconds, nanos));
    }
    field.reject(format_args!("is {}; it must not be negative", text()))
}

/// A coefficient of friction.
pub(super) fn friction(field: Field<'_>, value: f32) -> f32 {
    check_positive(field, value, MAX_FRICTION);
    value
}

/// A finite vector; zero if it is not finite.
pub(super) fn finite(field: Field<'_>, sent: v1::Vector3) -> Vec3 {
    let vector = Vec3::from(sent);
    if vector.is_finite() {
        return vector;
    }
    field.add(format_args!("is {vector}; every number must be finite"));
    Vec3::ZERO
}

/// A point in the client's axes and unit.
fn client_point(field: Field<'_>, sent: v1::Vector3, convention: Convention) -> Vec3 {
    let point = finite(field, sent);
    let farthest = FARTHEST / convention.metres_per_unit();
    if point.abs().max_element() <= farthest {
        return point;
    }
    field.add(format_args!(
        "is {point}; no coordinate may be more than {farthest} from 0 (1 km)"
    ));
    Vec3::ZERO
}

/// A point, in metres and `OpenXR` axes.
pub(super) fn point(field: Field<'_>, sent: v1::Vector3, convention: Convention) -> Vec3 {
    convention.point_to_openxr(client_point(field, sent, convention))
}

/// A vector of any length but 0, in `OpenXR` axes, as a unit vector; `None` if it is wrong.
pub(super) fn direction(field: Field<'_>, sent: v1::Vector3, convention: Convention) -> Option<Vec3> {
    let direction = Vec3::from(sent);
    // Scaled first: the squares of huge or tiny numbers overflow or vanish.
    (direction / direction.abs().max_element())
        .try_normalize()
        .filter(|_| direction.is_finite())
        .map(|unit| convention.direction_to_openxr(unit))
        .or_else(|| field.reject(format_args!("is {direction}; it must be finite and not 0")))
}

/// A unit quaternion, renormalised.
fn orientation(field: Field<'_>, sent: v1::Quaternion) -> Quat {
    let quaternion = Quat::from_xyzw(sent.x, sent.y, sent.z, sent.w);
    let norm = quaternion.length();
    if (norm - 1.0).abs() <= QUATERNION_TOLERANCE {
        return quaternion.normalize();
    }
    // NaN and infinity come here too: the comparison is false for them.
    field.add(format_args!(
        "is {quaternion}, of norm {norm}; it must be a unit quaternion, within 1 %"
    ));
    Quat::IDENTITY
}

/// A pose in the client's axes and unit. An absent pose, or an absent part, is the identity.
pub(super) fn pose(field: Field<'_>, sent: Option<v1::Pose>, convention: Convention) -> Pose {
    let v1::Pose {
        position,
        orientation: turn,
    } = sent.unwrap_or_default();
    let position = position.map(|sent| client_point(field.child("position"), sent, convention));
    let turn = turn.map(|sent| orientation(field.child("orientation"), sent));
    Pose::new(position.unwrap_or(Vec3::ZERO), turn.unwrap_or(Quat::IDENTITY))
}

/// A value of an enum of the contract; its default if the contract does not define the number.
pub(super) fn known<E: TryFrom<i32> + Default>(field: Field<'_>, value: i32) -> E {
    E::try_from(value).unwrap_or_else(|_| {
        field.add(format_args!("is {value}, which the contract does not define"));
        E::default()
    })
}

/// A handedness; `None` if it is unspecified or wrong.
pub(super) fn handedness(field: Field<'_>, value: i32) -> Option<Handedness> {
    match known(field, value) {
        v1::Handedness::Left => Some(Handedness::Left),
        v1::Handedness::Right => Some(Handedness::Right),
        v1::Handedness::Unspecified => None,
    }
}

/// A handedness without a default.
pub(super) fn required_handedness(field: Field<'_>, value: i32) -> Option<Handedness> {
    if value == i32::from(v1::Handedness::Unspecified) {
        return field.reject("is required: HANDEDNESS_LEFT or HANDEDNESS_RIGHT");
    }
    handedness(field, value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::validate::Violations;

    #[test]
    fn normalises_quaternions_of_norm_near_1_and_rejects_others() {
        let read = |w| {
            let violations = Violations::default();
            let sent = v1::Quaternion {
                w,
                ..Default::default()
            };
            let q = orientation(violations.field("q"), sent);
            (q, violations.len())
        };
        let (q, count) = read(1.009);
        assert!((q.length() - 1.0).abs() < 1e-6 && count == 0);
        for w in [0.0, 0.98, 1.02, f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30] {
            assert_eq!(read(w), (Quat::IDENTITY, 1), "{w}");
        }
    }

    #[test]
    fn rejects_points_beyond_a_kilometre_and_non_finite_ones() {
        for (x, convention, right) in [
            (999.0, Convention::OpenXr, true),
            (1001.0, Convention::OpenXr, false),
            (1001.0, Convention::Unreal, true),
            (f32::NAN, Convention::OpenXr, false),
            (f32::NEG_INFINITY, Convention::OpenXr, false),
        ] {
            let violations = Violations::default();
            let read = point(
                violations.field("p"),
                v1::Vector3 { x, y: 0.0, z: 0.0 },
                convention,
            );
            assert_eq!(violations.is_empty(), right, "{x} {convention:?}");
            assert!(read.is_finite());
        }
    }

    #[test]
    fn shortens_long_quotes() {
        assert_eq!(quoted("a\nb"), "\"a\\nb\"");
        assert_eq!(quoted(&"é".repeat(500)).chars().count(), MAX_QUOTED + 3);
    }
}
