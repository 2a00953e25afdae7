//! Conversions between messages and numbers.
//!
//! Methods that have the name of a field return what it means: an absent position is the origin, for instance.

use std::{ops::Mul, time::Duration};

use glam::{Quat, Vec3};

use crate::v1;

/// A duration of a message. Negative ones, which no sound message has, are 0.
#[must_use]
pub fn std_duration(duration: prost_types::Duration) -> Duration {
    // The conversion of prost's overflows for the least number of seconds.
    match (u64::try_from(duration.seconds), u32::try_from(duration.nanos)) {
        (Ok(seconds), Ok(nanos)) => Duration::new(seconds, nanos),
        _ => Duration::ZERO,
    }
}

/// A duration for a message. Saturates far beyond any budget or deadline.
#[must_use]
pub fn wire_duration(duration: Duration) -> prost_types::Duration {
    prost_types::Duration {
        seconds: i64::try_from(duration.as_secs()).unwrap_or(i64::MAX),
        nanos: duration.subsec_nanos().cast_signed(),
    }
}

impl From<Vec3> for v1::Vector3 {
    fn from(Vec3 { x, y, z }: Vec3) -> Self {
        Self { x, y, z }
    }
}

impl From<v1::Vector3> for Vec3 {
    fn from(v1::Vector3 { x, y, z }: v1::Vector3) -> Self {
        Self::new(x, y, z)
    }
}

impl From<Quat> for v1::Quaternion {
    fn from(quaternion: Quat) -> Self {
        let [x, y, z, w] = quaternion.to_array();
        Self { x, y, z, w }
    }
}

impl From<v1::Quaternion> for Quat {
    fn from(v1::Quaternion { x, y, z, w }: v1::Quaternion) -> Self {
        Self::from_xyzw(x, y, z, w)
    }
}

/// A vector; an absent one is 0.
pub(crate) fn vector(vector: Option<v1::Vector3>) -> Vec3 {
    vector.map_or(Vec3::ZERO, Vec3::from)
}

impl v1::Pose {
    /// A pose at this position, with this orientation.
    #[must_use]
    pub fn new(position: Vec3, orientation: Quat) -> Self {
        Self {
            position: Some(position.into()),
            orientation: Some(orientation.into()),
        }
    }

    /// Where its origin is.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        vector(self.position)
    }

    /// How it is turned.
    #[must_use]
    pub fn orientation(&self) -> Quat {
        self.orientation.map_or(Quat::IDENTITY, Quat::from)
    }

    /// `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let orientation = self.orientation().conjugate();
        Self::new(-(orientation * self.position()), orientation)
    }

    /// Maps a point of frame b to frame a.
    #[must_use]
    pub fn transform_point(&self, point: Vec3) -> Vec3 {
        self.orientation() * point + self.position()
    }
}

impl Mul for v1::Pose {
    type Output = Self;

    /// `a_from_b * b_from_c = a_from_c`.
    fn mul(self, b_from_c: Self) -> Self {
        Self::new(
            self.transform_point(b_from_c.position()),
            self.orientation() * b_from_c.orientation(),
        )
    }
}
