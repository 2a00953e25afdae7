//! The choice of a view: the camera from which the important parts are most visible.

use std::f32::consts::TAU;

use glam::{Mat3, Quat, Vec2, Vec3};
use grasp_synthesis::base::pose::Pose;
use rayon::prelude::*;

use crate::{parts::Part, render::Stage};

/// Vertical field of view in radians (26°), as of a portrait lens: wider ones exaggerate near parts, narrower ones flatten.
const VERTICAL_FOV: f32 = 0.45;

/// Share of the picture's half width and height that is left free on each side.
const MARGIN: f32 = 0.06;

/// Least distance of the camera from the points that it frames, in metres.
const MIN_DISTANCE: f32 = 0.01;

/// Candidate directions: their number around the vertical …
const AZIMUTHS: u32 = 12;

/// … at each of these elevations in radians, with a weight: people look slightly down at hands.
const ELEVATIONS: [(f32, f32); 3] = [(-0.15, 0.88), (0.35, 1.0), (0.85, 0.93)];

/// Pixels per row of the trial pictures of candidates.
const TRIAL_WIDTH: usize = 112;

/// A perspective camera: it looks along its own -z, +x is right and +y is up in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    pub(crate) world_from_camera: Pose,
    /// Tangents of half the horizontal and half the vertical field of view.
    pub(crate) tangents: Vec2,
}

impl Camera {
    /// The closest camera that sees all points, looking against `direction` (from the scene to the camera). `up` is up in the
    /// picture, as far as `direction` allows. `aspect` is the width of the picture divided by its height.
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
        let centre = (upper - lower) * 0.5;
        let distances = (upper + lower) / (2.0 * inner);
        let z = distances.max_element().max(nearest + MIN_DISTANCE);
        Self {
            world_from_camera: Pose {
                position: orientation * centre.extend(z),
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
    let x = up.cross(z).try_normalize();
    let x = x.unwrap_or_else(|| z.any_orthonormal_vector());
    Quat::from_mat3(&Mat3::from_cols(x, z.cross(x), z))
}

/// The best camera that frames all parts of positive `importance`. Each part counts with that weight, negative if it is better
/// hidden, by its visible area relative to the largest of any candidate.
pub(crate) fn best_view(
    parts: &[Part],
    stage: &Stage,
    importance: impl Fn(&Part) -> f32,
    up: Vec3,
    aspect: f32,
) -> Camera {
    let weights: Vec<f32> = parts.iter().map(importance).collect();
    let important = parts.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0);
    let framed: Vec<Vec3> = important.flat_map(|(part, _)| part.positions.clone()).collect();
    let low = framed.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = framed.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    let to_up = Quat::from_rotation_arc(Vec3::Y, up.normalize_or(Vec3::Y));
    let mut candidates: Vec<(Camera, f32)> = Vec::new();
    for (elevation, welcome) in ELEVATIONS {
        for step in 0..AZIMUTHS {
            let azimuth = Quat::from_rotation_y(step as f32 / AZIMUTHS as f32 * TAU);
            let direction = to_up * azimuth * Vec3::new(0.0, elevation.sin(), elevation.cos());
            let camera = Camera::framing(framed.iter().copied(), direction, up, aspect);
            candidates.push((camera, welcome));
        }
    }

    // Area in the scene, not in pixels: otherwise the short end of a long object, seen from close up, would count as much as
    // its side.
    let areas: Vec<Vec<f32>> = candidates
        .par_iter()
        .map(|(camera, _)| {
            let distance = camera.world_from_camera.position.distance(0.5 * (low + high));
            let mut areas = vec![0.0; parts.len()];
            for part in visible_parts(stage, camera, aspect) {
                areas[part] += distance * distance;
            }
            areas
        })
        .collect();
    let largest = |part: usize| {
        let areas = areas.iter().map(|areas| areas[part]);
        areas.fold(f32::MIN_POSITIVE, f32::max)
    };
    let largest: Vec<f32> = (0..weights.len()).map(largest).collect();
    let score = |candidate: usize| {
        // The root favours showing a little of every part over all of one.
        let shown = |part: usize| weights[part] * (areas[candidate][part] / largest[part]).sqrt();
        candidates[candidate].1 * (0..weights.len()).map(shown).sum::<f32>()
    };
    // Ties go to the first.
    let best = (0..candidates.len())
        .rev()
        .max_by(|&a, &b| score(a).total_cmp(&score(b)));
    candidates[best.unwrap_or_default()].0
}

/// The parts that the pixels of a trial picture show. Markers hide nothing.
fn visible_parts(stage: &Stage, camera: &Camera, aspect: f32) -> Vec<usize> {
    let eye = camera.world_from_camera.position;
    let height = ((TRIAL_WIDTH as f32 / aspect) as usize).max(1);
    let size = Vec2::new(TRIAL_WIDTH as f32, height as f32);
    let mut parts = Vec::new();
    for pixel in 0..TRIAL_WIDTH * height {
        let at = Vec2::new((pixel % TRIAL_WIDTH) as f32, (pixel / TRIAL_WIDTH) as f32) + 0.5;
        let seen = stage.seen(eye, camera.ray(at / size));
        let marker = seen.marker.filter(|_| !seen.is_marker_hidden());
        parts.extend(marker.iter().chain(&seen.solid).map(|hit| hit.part));
    }
    parts
}

#[cfg(test)]
mod tests {
    use grasp_synthesis::geometry::tapered_capsule::TaperedCapsule;

    use super::*;
    use crate::parts::{Finish, capsule, sphere};

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

    fn best_direction(parts: &[Part]) -> Vec3 {
        let importance = |part: &Part| if part.name == "wall" { 0.0 } else { 1.0 };
        let view = best_view(parts, &Stage::new(parts), importance, Vec3::Y, 1.3);
        view.world_from_camera.transform_vector(Vec3::Z)
    }

    #[test]
    fn shows_long_objects_from_the_side_and_avoids_a_wall() {
        let rod = TaperedCapsule::new(Vec3::NEG_X * 0.2, Vec3::X * 0.2, 0.02, 0.02);
        let along = best_direction(&[capsule("rod", &rod, Vec3::ONE)]).x.abs();
        assert!(along < 0.75, "looks along the rod: {along}");
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0));
        let wall = Part::new("wall", corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], Vec3::ONE);
        for side in [-1.0, 1.0] {
            let ball = sphere("ball", Vec3::Z * 0.3 * side, 0.1, Vec3::ONE);
            let mark = sphere("mark", Vec3::Z * 0.45 * side, 0.03, Vec3::ONE).with_finish(Finish::Marker);
            let view = best_direction(&[wall.clone(), ball, mark]);
            assert!(view.z * side > 0.3, "looks from {view}");
        }
    }
}
