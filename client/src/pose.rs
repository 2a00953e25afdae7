//! Rigid transforms.

use std::ops::Mul;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A rigid transform; a field or variable named `a_from_b` maps points of frame b to frame a.
///
/// In JSON: `{"position": [x, y, z], "orientation": [x, y, z, w]}`; both parts are optional.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Position of b's origin in a: metres, or centimetres in the Unreal convention.
    #[serde(default)]
    pub position: Vec3,
    /// Orientation of b in a: a unit quaternion. The server rejects norms that differ from 1 by more than 1 %.
    #[serde(default)]
    pub orientation: Quat,
}

impl Pose {
    /// The identity.
    pub const IDENTITY: Self = Self {
        position: Vec3::ZERO,
        orientation: Quat::IDENTITY,
    };

    /// A transform from its parts.
    pub const fn new(position: Vec3, orientation: Quat) -> Self {
        Self {
            position,
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

    /// Maps a point of frame b to frame a.
    pub fn transform_point(self, point: Vec3) -> Vec3 {
        self.orientation * point + self.position
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Mul for Pose {
    type Output = Self;

    /// `a_from_b * b_from_c = a_from_c`.
    fn mul(self, b_from_c: Self) -> Self {
        Self {
            position: self.transform_point(b_from_c.position),
            orientation: self.orientation * b_from_c.orientation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn product_applies_right_factor_first() {
        let a_from_b = Pose::new(
            Vec3::new(1.0, 2.0, 3.0),
            Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
        );
        let b_from_c = Pose::new(Vec3::new(1.0, 0.0, 0.0), Quat::IDENTITY);
        // By hand: c's origin lies at +x in b, and a quarter turn about z takes +x to +y.
        let origin = (a_from_b * b_from_c).transform_point(Vec3::ZERO);
        assert!(origin.abs_diff_eq(Vec3::new(1.0, 3.0, 3.0), 1e-6), "{origin}");
    }

    #[test]
    fn inverse_undoes_transform() {
        let a_from_b = Pose::new(
            Vec3::new(-0.3, 0.2, 5.0),
            Quat::from_euler(glam::EulerRot::YXZ, 0.3, -1.2, 2.0),
        );
        let point = Vec3::new(0.1, -0.7, 0.4);
        let back = a_from_b
            .inverse()
            .transform_point(a_from_b.transform_point(point));
        assert!(back.abs_diff_eq(point, 1e-5), "{back}");
    }

    #[test]
    fn json_parts_are_optional_and_unknown_ones_rejected() {
        let pose: Pose = serde_json::from_str(r#"{"position": [1, 2, 3]}"#).unwrap();
        assert_eq!(pose, Pose::new(Vec3::new(1.0, 2.0, 3.0), Quat::IDENTITY));
        assert!(serde_json::from_str::<Pose>(r#"{"rotation": [0, 0, 0, 1]}"#).is_err());
    }
}
