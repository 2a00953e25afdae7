//! Where a picture is taken from.

use glam::{Mat3, Quat, Vec2, Vec3};
use grasp_synthesis::base::pose::Pose;

/// Vertical opening angle in radians (26°): a portrait lens. Wider exaggerates what is near, narrower flattens.
const VERTICAL_FOV: f32 = 0.45;

/// Share of the picture's half width and height that is left free on each side.
const MARGIN: f32 = 0.06;

/// Least distance of the camera from what it frames, in metres.
const MIN_DISTANCE: f32 = 0.01;

/// A perspective camera: it looks along its own -z, +x is right and +y is up in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    pub(crate) world_from_camera: Pose,
    /// Tangents of half the horizontal and half the vertical opening angle.
    pub(crate) tangents: Vec2,
}

impl Camera {
    /// The closest camera that sees all points, looking against `direction` (from the scene to the camera); without points it
    /// looks at the origin from 1 m away. `up` is up in the picture, as far as `direction` allows. `aspect` is the width of the
    /// picture divided by its height.
    pub(crate) fn framing(
        points: impl IntoIterator<Item = Vec3>,
        direction: Vec3,
        up: Vec3,
        aspect: f32,
    ) -> Self {
        let orientation = looking_against(direction, up);
        let tan_y = (VERTICAL_FOV * 0.5).tan();
        let tangents = Vec2::new(tan_y * aspect, tan_y);
        let inner = tangents * (1.0 - MARGIN);

        // In camera axes p is inside when ±(p.x - c.x) <= t (c.z - p.z), so the tightest camera is bounded by the
        // largest ±p.x + t p.z on either side; their mean gives c.x and c.z, and likewise for y.
        let to_axes = orientation.conjugate();
        let mut upper = Vec2::NEG_INFINITY;
        let mut lower = Vec2::NEG_INFINITY;
        let mut nearest = f32::NEG_INFINITY;
        for point in points {
            let p = to_axes * point;
            upper = upper.max(p.truncate() + inner * p.z);
            lower = lower.max(-p.truncate() + inner * p.z);
            nearest = nearest.max(p.z);
        }
        let position = if nearest.is_finite() {
            let centre = (upper - lower) * 0.5;
            let distances = (upper + lower) / (2.0 * inner);
            let z = distances.max_element().max(nearest + MIN_DISTANCE);
            orientation * centre.extend(z)
        } else {
            orientation * Vec3::Z
        };
        Self {
            world_from_camera: Pose {
                position,
                orientation,
            },
            tangents,
        }
    }

    /// The unit direction from the camera through a place of the picture: x from 0 (left) to 1 (right), y from 0 (top) to 1
    /// (bottom).
    pub(crate) fn ray(&self, at: Vec2) -> Vec3 {
        let plane = Vec2::new(at.x * 2.0 - 1.0, 1.0 - at.y * 2.0) * self.tangents;
        let direction = self.world_from_camera.transform_vector(plane.extend(-1.0));
        direction.normalize_or(Vec3::NEG_Z)
    }
}

/// The orientation of a camera whose +z is `direction` and whose +y is near `up`.
fn looking_against(direction: Vec3, up: Vec3) -> Quat {
    let z = direction.normalize_or(Vec3::Z);
    let x = up
        .cross(z)
        .try_normalize()
        .unwrap_or_else(|| z.any_orthonormal_vector());
    Quat::from_mat3(&Mat3::from_cols(x, z.cross(x), z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn framing_sees_every_point_and_touches_the_margin() {
        // Points on a skewed spiral, without any symmetry.
        let cloud = || {
            (0..200_u16).map(|i| {
                let t = f32::from(i) * 0.1;
                let (x, z) = (0.02 * t * t.cos() + 0.3, 0.01 * t * (1.3 * t).sin());
                Vec3::new(x, 0.015 * t - 0.1, z)
            })
        };
        for (direction, aspect) in [
            (Vec3::new(1.0, 0.4, 0.2), 9.0 / 7.0),
            (Vec3::new(-0.3, -0.9, 0.1), 0.5),
            (Vec3::Y, 2.0),
        ] {
            let camera = Camera::framing(cloud(), direction, Vec3::Y, aspect);
            let mut closest = f32::INFINITY;
            for point in cloud() {
                let local = camera.world_from_camera.inverse().transform_point(point);
                let at = local.truncate() / (-local.z * camera.tangents);
                closest = closest.min(1.0 - at.abs().max_element());
                // The ray through its place in the picture meets the point.
                let ray = camera.ray(Vec2::new(0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y));
                let to_point = point - camera.world_from_camera.position;
                assert!(local.z < 0.0 && ray.cross(to_point).length() < 1e-5);
            }
            assert!((closest - MARGIN).abs() < 1e-3, "{closest}");
        }
    }
}
