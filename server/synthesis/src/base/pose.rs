//! Rigid transforms.

use std::ops::Mul;

use glam::{Affine3A, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A rigid transform; a variable named `a_from_b` takes points of frame b to frame a.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Where the origin of b lies in a, in metres.
    pub position: Vec3,
    /// How b is turned in a: a unit quaternion.
    pub orientation: Quat,
}

impl Pose {
    /// The transform that leaves everything where it is.
    pub const IDENTITY: Self = Self {
        position: Vec3::ZERO,
        orientation: Quat::IDENTITY,
    };

    /// A transform from its parts; `orientation` must be a unit quaternion.
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

    /// A translation.
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

    /// `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(self) -> Self {
        let orientation = self.orientation.conjugate();
        Self {
            position: -(orientation * self.position),
            orientation,
        }
    }

    /// A point of frame b, in metres, seen from frame a.
    pub fn transform_point(self, point: Vec3) -> Vec3 {
        self.orientation * point + self.position
    }

    /// A direction of frame b seen from frame a.
    pub fn transform_vector(self, vector: Vec3) -> Vec3 {
        self.orientation * vector
    }

    /// The same transform as a matrix, cheaper to apply to many points.
    pub fn to_affine(self) -> Affine3A {
        Affine3A::from_rotation_translation(self.orientation, self.position)
    }

    /// The mirror image in the plane x = 0: what makes a left hand of a right one.
    #[must_use]
    pub fn mirrored_x(self) -> Self {
        let q = self.orientation;
        Self {
            position: self.position * Vec3::new(-1.0, 1.0, 1.0),
            // M R M with M = diag(-1, 1, 1): the axis' x part stays, its y and z parts flip.
            orientation: Quat::from_xyzw(q.x, -q.y, -q.z, q.w),
        }
    }

    /// True if every number is finite.
    pub fn is_finite(self) -> bool {
        self.position.is_finite() && self.orientation.is_finite()
    }
}

impl Mul for Pose {
    type Output = Self;

    /// `a_from_b * b_from_c = a_from_c`. The rotation is renormalised, so that long chains stay rigid.
    fn mul(self, b_from_c: Self) -> Self {
        Self {
            position: self.transform_point(b_from_c.position),
            orientation: (self.orientation * b_from_c.orientation).normalize(),
        }
    }
}
