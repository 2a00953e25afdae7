//! Points drawn evenly from a mesh's surface, and the thickness of its parts as they show.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DMat3, DVec3, Vec3};

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

/// Samples that estimate the cost of all.
const PROBES: u64 = 32;

/// Budget of triangle packs that all rays from a set of samples may visit.
const MAX_PACKS: usize = 1 << 19;

/// Budget of hole edges that the containment tests at all those rays' ends may visit.
const MAX_RIM_EDGES: usize = 1 << 21;

/// Stride through samples that each cast a ray into the surface, for a length in metres: 1, unless thousands of triangles
/// overlap along every ray or holes have thousands of edges.
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

/// Points drawn from a mesh to learn the shape of its parts.
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

/// Radius of the part of the surface around a sample that counts as near, in metres: the reach of a hand's contacts.
const REACH: f32 = 0.06;

/// Fewest samples in a part, so that a large, sparsely sampled face does not seem tiny.
const MIN_NEIGHBOURS: usize = 16;

/// The thickness of the parts of a mesh around samples of its surface, each measured when it is first needed.
#[derive(Clone, Debug, Default)]
pub struct LocalThickness {
    samples: Vec<(Vec3, Measured)>,
}

/// A thickness once it is measured, in four bytes. Whoever measures it finds the same.
#[derive(Debug)]
struct Measured(AtomicU32);

impl Default for Measured {
    fn default() -> Self {
        Self(AtomicU32::new(f32::NAN.to_bits()))
    }
}

impl Clone for Measured {
    fn clone(&self) -> Self {
        Self(AtomicU32::new(self.0.load(Ordering::Relaxed)))
    }
}

impl Measured {
    fn get_or(&self, measure: impl FnOnce() -> f32) -> f32 {
        let known = f32::from_bits(self.0.load(Ordering::Relaxed));
        if !known.is_nan() {
            return known;
        }
        let measured = measure();
        self.0.store(measured.to_bits(), Ordering::Relaxed);
        measured
    }
}

impl LocalThickness {
    /// The thickness of a mesh with these points, which are spread evenly over it.
    pub fn of(samples: &[SurfaceSample]) -> Self {
        let samples = samples.iter();
        Self {
            samples: samples
                .map(|sample| (sample.position, Measured::default()))
                .collect(),
        }
    }

    /// Root mean square distance of the surface near a point from the axis along which it is longest, in metres: the radius
    /// of a rod. 0 if nothing was sampled. Takes some ten microseconds for a part that nobody has needed.
    pub fn near(&self, point: Vec3) -> f32 {
        let mut nearest = (f32::INFINITY, None);
        for sample in &self.samples {
            let squared = sample.0.distance_squared(point);
            if squared < nearest.0 {
                nearest = (squared, Some(sample));
            }
        }
        let (_, nearest) = nearest;
        nearest.map_or(0.0, |(centre, measured)| {
            measured.get_or(|| self.measure(*centre))
        })
    }

    /// The thickness of the part around a sample.
    fn measure(&self, centre: Vec3) -> f32 {
        let points = self.samples.iter();
        let mut by_distance: Vec<(f32, Vec3)> = points
            .map(|&(point, _)| (point.distance_squared(centre), point))
            .collect();
        let count = by_distance
            .iter()
            .filter(|(squared, _)| *squared <= REACH * REACH)
            .count();
        let count = count.max(MIN_NEIGHBOURS).min(by_distance.len());
        if count < by_distance.len() {
            by_distance.select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0));
        }
        let part: Vec<DVec3> = by_distance[..count]
            .iter()
            .map(|(_, point)| point.as_dvec3())
            .collect();
        thickness(&part)
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.samples.as_slice())
    }
}

/// Root mean square distance of points from the axis through their middle along which they spread most.
fn thickness(points: &[DVec3]) -> f32 {
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let axes = principal_axes(points);
    let mut variances = DVec3::ZERO;
    for &point in points {
        let local = axes.transpose() * (point - middle);
        variances += local * local / points.len() as f64;
    }
    (variances.element_sum() - variances.max_element())
        .max(0.0)
        .sqrt() as f32
}

/// The principal axes of points, right-handed: eigenvectors of their covariance by Jacobi rotations (G. H. Golub, C.
/// F. Van Loan: Matrix Computations, 8.5).
pub(crate) fn principal_axes(points: &[DVec3]) -> DMat3 {
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut covariance = DMat3::ZERO;
    for &point in points {
        let offset = point - mean;
        covariance += DMat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
    }
    let mut axes = DMat3::IDENTITY;
    // Convergence is quadratic: five sweeps reach machine precision.
    for _ in 0..5 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off_diagonal = covariance.col(q)[p];
            if off_diagonal == 0.0 {
                continue;
            }
            let angle = 0.5 * (2.0 * off_diagonal).atan2(covariance.col(q)[q] - covariance.col(p)[p]);
            let (sin, cos) = angle.sin_cos();
            let mut columns = [DVec3::X, DVec3::Y, DVec3::Z];
            (columns[p][p], columns[p][q]) = (cos, -sin);
            (columns[q][p], columns[q][q]) = (sin, cos);
            let rotation = DMat3::from_cols(columns[0], columns[1], columns[2]);
            covariance = rotation.transpose() * covariance * rotation;
            axes *= rotation;
        }
    }
    axes
}
