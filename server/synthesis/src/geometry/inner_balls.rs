//! Balls inside the volume of a mesh, large ones first: whatever overlaps one of them certainly overlaps the volume.

use glam::Vec3;

use super::{mesh_bvh::MeshBvh, surface_samples::SurfaceSampler};
use crate::base::random::AttemptStream;

/// Points of the surface at which balls are grown. Twice as many fill a hand hardly better.
const SAMPLES: u64 = 192;

/// Seed of the points.
const SEED: u64 = 1;

/// Largest radius in metres: more than half the thickness of a forearm.
const LARGEST: f32 = 0.06;

/// Steps in which a ball shrinks. Most are done after four.
const STEPS: usize = 8;

/// Share of a radius by which the last step may change it.
const SETTLED: f32 = 0.01;

/// Bound on the rounding error of a radius, in metres.
const ROUNDING: f32 = 2e-6;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub centre: Vec3,
    /// Its radius in metres.
    pub radius: f32,
}

/// Up to `count` balls inside the volume of a mesh, the largest first, none with its centre inside an earlier one. `None` if the
/// mesh has no volume.
///
/// Each touches the surface at a sample and shrinks until it contains no other point of it (Ma, Bae and Choi, "3D medial axis
/// point approximation using nearest neighbors and the normal field", 2012).
pub fn inner_balls(surface: &MeshBvh, count: usize) -> Vec<Ball> {
    let outward = surface.mesh().signed_volume().signum() as f32;
    let sampler = SurfaceSampler::new(surface.mesh(), |_| true);
    let mut grown: Vec<Ball> = (0..SAMPLES)
        .filter_map(|sample| {
            let (triangle, point) = sampler.sample(sample, SAMPLES, &mut AttemptStream::new(SEED, sample))?;
            ball_at(surface, point, surface.mesh().normal(triangle) * outward)
        })
        .collect();
    grown.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    let mut chosen: Vec<Ball> = Vec::with_capacity(count);
    for ball in grown {
        if chosen.len() == count {
            break;
        }
        let is_covered = |earlier: &Ball| earlier.centre.distance(ball.centre) < earlier.radius;
        if !chosen.iter().any(is_covered) {
            chosen.push(ball);
        }
    }
    chosen
}

/// The ball inside the volume that touches the surface at a point with an outward normal; `None` if there is no room.
fn ball_at(surface: &MeshBvh, point: Vec3, normal: Vec3) -> Option<Ball> {
    let mut radius = LARGEST;
    for _ in 0..STEPS {
        let centre = point - normal * radius;
        let Some(nearest) = surface.closest_point_within(centre, radius) else {
            break;
        };
        let offset = point - nearest.position;
        let along = offset.dot(normal);
        if along <= 0.0 || nearest.distance >= radius * (1.0 - SETTLED) {
            break;
        }
        radius = radius.min(offset.length_squared() / (2.0 * along));
    }
    let centre = point - normal * radius;
    let nearest = surface.closest_point_within(centre, LARGEST)?;
    let radius = nearest.distance - ROUNDING;
    (radius > 0.0 && surface.contains(centre)).then_some(Ball { centre, radius })
}
