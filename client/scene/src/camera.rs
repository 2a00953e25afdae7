//! Where a picture is taken from.

use glam::{Mat3, Quat, Vec2, Vec3};
use grasp_synthesis::base::pose::Pose;

use crate::scene::Scene;

/// Vertical opening angle in radians (26°): a portrait lens. Wider exaggerates what is near, narrower flattens.
pub const DEFAULT_VERTICAL_FOV: f32 = 0.45;

/// Share of the picture's half width and height that a framed scene leaves free on each side.
const FRAMING_MARGIN: f32 = 0.06;

/// Points closer than this to the camera's plane are cut off, in metres.
pub(crate) const NEAR: f32 = 1e-3;

/// A perspective camera: it looks along its own -z, +x is right and +y is up in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pose of the camera.
    pub world_from_camera: Pose,
    /// Vertical opening angle in radians, more than 0 and less than π.
    pub vertical_fov: f32,
    /// Width of the picture divided by its height.
    pub aspect: f32,
}

impl Camera {
    /// The closest camera that sees all vertices of a scene, looking against `direction` (from the scene to the
    /// camera). `up` is up in the picture, as far as `direction` allows.
    pub fn framing(scene: &Scene, direction: Vec3, up: Vec3, aspect: f32) -> Self {
        Self::framing_points(scene.points(), direction, up, aspect)
    }

    /// The same for points instead of a scene. Without points it looks at the origin from 1 m away.
    pub fn framing_points(
        points: impl IntoIterator<Item = Vec3>,
        direction: Vec3,
        up: Vec3,
        aspect: f32,
    ) -> Self {
        let orientation = looking_against(direction, up);
        let tan_y = (DEFAULT_VERTICAL_FOV * 0.5).tan() * (1.0 - FRAMING_MARGIN);
        let tangents = Vec2::new(tan_y * aspect, tan_y);

        // In camera axes p is inside when ±(p.x - c.x) <= t (c.z - p.z), so the tightest camera is bounded by the
        // largest ±p.x + t p.z on either side; their mean gives c.x and c.z, and likewise for y.
        let to_axes = orientation.conjugate();
        let mut upper = Vec2::NEG_INFINITY;
        let mut lower = Vec2::NEG_INFINITY;
        let mut nearest = f32::NEG_INFINITY;
        for point in points {
            let p = to_axes * point;
            upper = upper.max(p.truncate() + tangents * p.z);
            lower = lower.max(-p.truncate() + tangents * p.z);
            nearest = nearest.max(p.z);
        }
        let position = if nearest.is_finite() {
            let centre = (upper - lower) * 0.5;
            let distances = (upper + lower) / (2.0 * tangents);
            let z = distances.max_element().max(nearest + 10.0 * NEAR);
            orientation * centre.extend(z)
        } else {
            orientation * Vec3::Z
        };
        Self {
            world_from_camera: Pose {
                position,
                orientation,
            },
            vertical_fov: DEFAULT_VERTICAL_FOV,
            aspect,
        }
    }

    /// The tangents of half the horizontal and half the vertical opening angle.
    pub(crate) fn tangents(&self) -> Vec2 {
        let y = (self.vertical_fov * 0.5).tan();
        Vec2::new(y * self.aspect, y)
    }

    /// The image position of a point of the world: x from 0 (left) to 1 (right), y from 0 (top) to 1 (bottom), z its distance
    /// from the camera's plane in metres. None for points that are not in front of the camera.
    pub fn project(&self, point: Vec3) -> Option<Vec3> {
        let local = self.world_from_camera.inverse().transform_point(point);
        (local.z < -NEAR).then(|| self.project_local(local))
    }

    /// The same for a point in the camera's frame, in front of it.
    pub(crate) fn project_local(&self, local: Vec3) -> Vec3 {
        let depth = -local.z;
        let plane = local.truncate() / (self.tangents() * depth);
        Vec3::new(0.5 + 0.5 * plane.x, 0.5 - 0.5 * plane.y, depth)
    }

    /// The direction, not of unit length, from the camera through an image position (as in
    /// [`Camera::project`]): it advances by 1 m along the camera's view.
    pub fn ray(&self, at: Vec2) -> Vec3 {
        let plane = Vec2::new(at.x * 2.0 - 1.0, 1.0 - at.y * 2.0) * self.tangents();
        self.world_from_camera.transform_vector(plane.extend(-1.0))
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

    fn cloud() -> Vec<Vec3> {
        // Points on a skewed spiral, without any symmetry.
        (0..200_u16)
            .map(|i| {
                let t = f32::from(i) * 0.1;
                Vec3::new(
                    0.02 * t * t.cos() + 0.3,
                    0.015 * t - 0.1,
                    0.01 * t * (1.3 * t).sin(),
                )
            })
            .collect()
    }

    #[test]
    fn framing_sees_every_point_and_touches_the_margin() {
        for (direction, aspect) in [
            (Vec3::new(1.0, 0.4, 0.2), 9.0 / 7.0),
            (Vec3::new(-0.3, -0.9, 0.1), 0.5),
            (Vec3::Y, 2.0),
        ] {
            let camera = Camera::framing_points(cloud(), direction, Vec3::Y, aspect);
            let margin = FRAMING_MARGIN * 0.5;
            let mut closest = f32::INFINITY;
            for point in cloud() {
                let at = camera.project(point).expect("in front of the camera");
                let gap = at.x.min(1.0 - at.x).min(at.y).min(1.0 - at.y);
                assert!(gap > margin - 1e-4, "{point} at {at} is outside");
                closest = closest.min(gap);
            }
            assert!((closest - margin).abs() < 1e-3, "not tight: {closest}");
        }
    }

    #[test]
    fn rays_invert_projection() {
        let camera = Camera::framing_points(cloud(), Vec3::new(0.3, 0.5, -1.0), Vec3::Y, 1.5);
        for point in cloud() {
            let at = camera.project(point).expect("in front of the camera");
            let back = camera.world_from_camera.position + camera.ray(at.truncate()) * at.z;
            assert!(back.distance(point) < 1e-5, "{back} is not {point}");
        }
    }

    #[test]
    fn up_is_up_and_right_is_right() {
        let camera = Camera::framing_points([Vec3::ZERO, Vec3::ONE], Vec3::Z, Vec3::Y, 1.0);
        let high = camera.project(Vec3::new(0.5, 0.9, 0.5)).unwrap();
        let right = camera.project(Vec3::new(0.9, 0.5, 0.5)).unwrap();
        assert!(high.y < 0.5 && right.x > 0.5);
    }
}
