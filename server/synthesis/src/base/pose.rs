//! Rigid transforms.

use std::ops::Mul;

use glam::{Affine3A, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A rigid transform. A variable named `a_from_b` maps points of frame b to frame a.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// The origin of b in a, in metres.
    pub position: Vec3,
    /// The orientation of b in a, a unit quaternion.
    pub orientation: Quat,
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Self = Self {
        position: Vec3::ZERO,
        orientation: Quat::IDENTITY,
    };

    /// A transform from position (metres) and orientation, which must be a unit quaternion.
    pub fn new(position: Vec3, orientation: Quat) -> Self {
        debug_assert!(
            orientation.is_normalized(),
            "orientation {orientation} is not a unit quaternion"
        );
        Self {
            position,
            orientation,
        }
    }

    /// A translation, in metres.
    pub const fn from_position(position: Vec3) -> Self {
        Self {
            position,
            orientation: Quat::IDENTITY,
        }
    }

    /// A rotation about the origin.
    pub const fn from_orientation(orientation: Quat) -> Self {
        Self {
            position: Vec3::ZERO,
            orientation,
        }
    }

    /// The inverse: `b_from_a` for `a_from_b`.
    #[must_use]
    pub fn inverse(self) -> Self {
        let orientation = self.orientation.conjugate();
        Self {
            position: -(orientation * self.position),
            orientation,
        }
    }

    /// Maps a point of frame b to frame a, in metres.
    pub fn transform_point(self, point: Vec3) -> Vec3 {
        self.orientation * point + self.position
    }

    /// Rotates a vector of frame b into frame a.
    pub fn transform_vector(self, vector: Vec3) -> Vec3 {
        self.orientation * vector
    }

    /// The transform as a matrix, which is cheaper to apply to many points.
    pub fn to_affine(self) -> Affine3A {
        Affine3A::from_rotation_translation(self.orientation, self.position)
    }

    /// The mirror image in the plane x = 0, which turns a right hand into a left one.
    #[must_use]
    pub fn mirrored_x(self) -> Self {
        let q = self.orientation;
        Self {
            position: self.position * Vec3::new(-1.0, 1.0, 1.0),
            // M R M with M = diag(-1, 1, 1): keeps the x part of the rotation axis and flips y and z.
            orientation: Quat::from_xyzw(q.x, -q.y, -q.z, q.w),
        }
    }

    /// True if every component is finite.
    pub fn is_finite(self) -> bool {
        self.position.is_finite() && self.orientation.is_finite()
    }
}

impl Mul for Pose {
    type Output = Self;

    /// `a_from_b * b_from_c = a_from_c`. Renormalises the rotation so that long chains stay rigid.
    fn mul(self, b_from_c: Self) -> Self {
        Self {
            position: self.transform_point(b_from_c.position),
            orientation: (self.orientation * b_from_c.orientation).normalize(),
        }
    }
}
