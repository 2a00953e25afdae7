//! Screen-space ambient occlusion.
//!
//! Each pixel tests points of a hemisphere above its surface (Shanmugam and Arikan 2007, Mittring 2007) and counts those
//! behind the visible surface. The pattern is rotated per pixel in blocks of 4 × 4; [`OcclusionMap::openness`] averages
//! it out over neighbours on the same surface.

use std::f32::consts::TAU;

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use crate::{camera::Camera, surface::SurfacePoint};

/// Points per pixel; more is smoother and slower.
const SAMPLES: usize = 20;

/// Pixels along each side of a block of rotated patterns.
const BLOCK: usize = 4;

/// Factor on measured occlusion: compensates for occluders that the camera does not see.
const STRENGTH: f32 = 1.35;

/// The openness of every pixel.
pub(crate) struct OcclusionMap {
    width: usize,
    height: usize,
    /// 0 to 1.
    raw: Vec<f32>,
    /// Distance from the camera's plane in metres; infinite for the background.
    depths: Vec<f32>,
    radius: f32,
}

impl OcclusionMap {
    /// Measures occlusion within `radius` metres. `seen` is the surface visible in the middle of each pixel.
    pub(crate) fn new(
        camera: &Camera,
        width: usize,
        height: usize,
        seen: &[Option<SurfacePoint>],
        radius: f32,
    ) -> Self {
        let forward = camera.world_from_camera.transform_vector(Vec3::NEG_Z);
        let eye = camera.world_from_camera.position;
        let depths: Vec<f32> = seen
            .iter()
            .map(|point| point.map_or(f32::INFINITY, |p| (p.position - eye).dot(forward)))
            .collect();
        let camera_from_world = camera.world_from_camera.inverse().to_affine();
        let pattern = half_ball();
        let size = Vec2::new(width as f32, height as f32);
        let depth_at = |at: Vec2| {
            let x = (at.x.max(0.0) as usize).min(width - 1);
            let y = (at.y.max(0.0) as usize).min(height - 1);
            depths[y * width + x]
        };

        let openness_of = |index: usize, point: &SurfacePoint| {
            let (x, y) = (index % width, index / width);
            let tangent = point.normal.any_orthonormal_vector();
            let turn = (turn_of(x, y) * TAU).sin_cos();
            let bitangent = point.normal.cross(tangent);
            let x_axis = tangent * turn.1 + bitangent * turn.0;
            let world_from_pattern = Mat3::from_cols(x_axis, point.normal.cross(x_axis), point.normal);
            // Lifted off the surface to ignore its own facets.
            let origin = point.position + point.normal * (radius * 0.02);
            let own_depth = depths[index];
            let mut occluded = 0.0;
            for direction in &pattern {
                let probe = origin + world_from_pattern * *direction * radius;
                let local = camera_from_world.transform_point3(probe);
                if local.z > -1e-3 {
                    continue;
                }
                let at = camera.project_local(local);
                let surface = depth_at(at.truncate() * size);
                let behind = at.z - surface;
                if behind > radius * 0.01 {
                    // A surface far in front is unrelated and occludes nothing here.
                    let gap = (own_depth - surface).max(0.0) / radius;
                    occluded += 1.0 / (1.0 + (gap * 0.8).powi(4));
                }
            }
            (1.0 - STRENGTH * occluded / SAMPLES as f32).clamp(0.0, 1.0)
        };
        let raw = seen
            .par_iter()
            .enumerate()
            .map(|(index, point)| point.as_ref().map_or(1.0, |point| openness_of(index, point)))
            .collect();
        Self {
            width,
            height,
            raw,
            depths,
            radius,
        }
    }

    /// The openness of the point at pixel (x, y), `depth` metres from the camera's plane: the mean over neighbours at
    /// about the same distance.
    pub(crate) fn openness(&self, x: usize, y: usize, depth: f32) -> f32 {
        let reach = BLOCK / 2;
        let (mut sum, mut total) = (0.0, 0.0);
        for row in y.saturating_sub(reach)..(y + reach + 1).min(self.height) {
            for column in x.saturating_sub(reach)..(x + reach + 1).min(self.width) {
                let index = row * self.width + column;
                // Half weight at the rim makes 5 pixels count as one block of 4.
                let rim = |a: usize, b: usize| if a.abs_diff(b) == reach { 0.5 } else { 1.0 };
                let difference = (self.depths[index] - depth) / (self.radius * 0.12);
                let weight = rim(row, y) * rim(column, x) / (1.0 + difference * difference);
                sum += weight * self.raw[index];
                total += weight;
            }
        }
        if total > 1e-6 { sum / total } else { 1.0 }
    }
}

/// Points in the hemisphere around +z, denser around +z and toward the centre, on a golden-angle spiral.
fn half_ball() -> [Vec3; SAMPLES] {
    const GOLDEN_TURN: f32 = 0.381_966;
    std::array::from_fn(|i| {
        let share = (i as f32 + 0.5) / SAMPLES as f32;
        // Cosine-weighted: an evenly filled disc, projected onto the hemisphere.
        let radius = share.sqrt();
        let (sin, cos) = (i as f32 * GOLDEN_TURN * TAU).sin_cos();
        let direction = Vec3::new(radius * cos, radius * sin, (1.0 - share).sqrt());
        // Lengths in another order than the angles.
        let length = ((i * 7 % SAMPLES) as f32 + 0.5) / SAMPLES as f32;
        direction * (0.08 + 0.92 * length * length.sqrt())
    })
}

/// Rotation of the pattern at a pixel, in turns: 16 values, each once per block, with neighbours far apart.
fn turn_of(x: usize, y: usize) -> f32 {
    const ORDER: [u8; 16] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
    f32::from(ORDER[(y % BLOCK) * BLOCK + x % BLOCK]) / 16.0
}
