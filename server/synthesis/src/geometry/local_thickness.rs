//! How thick a mesh is near a point: the lever by which fingers that hold it there keep it from rolling.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec3, Vec3};

use super::{principal_axes::principal_axes, surface_samples::SurfaceSample};

/// Radius of the part of the surface around a sample that counts as near, in metres: the reach of a hand's contacts.
const REACH: f32 = 0.06;

/// Smallest number of samples in a part, so that a large, sparsely sampled face is not taken for a speck.
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
    /// Of a mesh with these points, which are spread evenly over it.
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
