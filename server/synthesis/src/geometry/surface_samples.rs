//! Points drawn evenly from a mesh's surface.

use glam::Vec3;

use super::{Segment, mesh::TriangleMesh, mesh_bvh::MeshBvh};
use crate::base::random::AttemptStream;

/// Draws points from some triangles of a mesh, each part of their area with the same probability.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceSampler<'a> {
    mesh: &'a TriangleMesh,
    /// Twice the area of the used triangles up to and including each, in m².
    cumulative_areas: Vec<f64>,
}

impl<'a> SurfaceSampler<'a> {
    /// Prepares draws from the triangles that `is_used` accepts.
    pub(crate) fn new(mesh: &'a TriangleMesh, is_used: impl Fn(u32) -> bool) -> Self {
        let mut sum = 0.0;
        let cumulative_areas = (0..mesh.triangles().len())
            .map(|triangle| {
                if is_used(triangle as u32) {
                    let [a, b, c] = mesh.corners(triangle).map(Vec3::as_dvec3);
                    sum += (b - a).cross(c - a).length();
                }
                sum
            })
            .collect();
        Self {
            mesh,
            cumulative_areas,
        }
    }

    /// Draws the triangle and the position of sample number `sample` of `count`. Samples are stratified: each has its own
    /// share of the area. `None` if no triangle is used.
    pub(crate) fn sample(
        &self,
        sample: u64,
        count: u64,
        stream: &mut AttemptStream,
    ) -> Option<(usize, Vec3)> {
        let sum = self.cumulative_areas.last().copied().filter(|sum| *sum > 0.0)?;
        let area = (sample as f64 + f64::from(stream.unit())) / count as f64 * sum;
        let triangle = self
            .cumulative_areas
            .partition_point(|&end| end <= area)
            .min(self.cumulative_areas.len() - 1);
        let [a, b, c] = self.mesh.corners(triangle);
        let (mut u, mut v) = (stream.unit(), stream.unit());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Some((triangle, a + (b - a) * u + (c - a) * v))
    }
}

/// Samples from which the cost of all is estimated.
const PROBES: u64 = 32;

/// Packs of triangles that all rays from a set of samples may have to look at.
const MAX_PACKS: usize = 1 << 19;

/// Edges of holes that all those rays may have to look at, if it has to be found for each end whether it is inside.
const MAX_RIM_EDGES: usize = 1 << 21;

/// Of how many samples one is to be used if a ray starts at each and goes into the surface for a length in metres: 1, unless
/// thousands of triangles overlap along every ray or holes have thousands of edges.
pub(crate) fn ray_stride(
    surface: &MeshBvh,
    sampler: &SurfaceSampler<'_>,
    samples: u64,
    seed: u64,
    length: f32,
) -> usize {
    let step = (samples / PROBES).max(1);
    let packs: usize = (0..samples)
        .step_by(step as usize)
        .filter_map(|sample| sampler.sample(sample, samples, &mut AttemptStream::new(seed, sample)))
        .map(|(triangle, position)| {
            let inward = -surface.mesh().normal(triangle);
            surface.packs_along(Segment::new(position, position + inward * length))
        })
        .sum();
    let for_packs = (packs * step as usize).div_ceil(MAX_PACKS);
    let for_rims = (surface.rim_edges() * samples as usize).div_ceil(MAX_RIM_EDGES);
    for_packs.max(for_rims).max(1)
}

/// Points drawn from a mesh to learn the shape of its parts. Fewer miss thin parts next to large ones; the time to compare
/// them all grows with the square, to 3 ms.
const SAMPLES: u64 = 1024;

/// Seed of the samples: arbitrary, but fixed so that a mesh always has the same shape.
const SEED: u64 = 0x5448_4943;

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// The point, in metres.
    pub position: Vec3,
    /// The outward unit normal of its triangle.
    pub normal: Vec3,
}

/// Draws points evenly from a whole mesh, always the same.
pub fn even_samples(mesh: &TriangleMesh) -> Vec<SurfaceSample> {
    let sampler = SurfaceSampler::new(mesh, |_| true);
    (0..SAMPLES)
        .filter_map(|sample| {
            let mut stream = AttemptStream::new(SEED, sample);
            sampler.sample(sample, SAMPLES, &mut stream)
        })
        .map(|(triangle, position)| SurfaceSample {
            position,
            normal: mesh.normal(triangle),
        })
        .collect()
}
