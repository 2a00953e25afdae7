//! A coarse grid of distances to a mesh, which proves that a capsule is clear without visiting triangles.

use std::{ops::Range, thread};

use glam::{UVec3, Vec3};

use super::{aabb::Aabb, closest::GivenUp, tapered_capsule::TaperedCapsule};
use crate::base::stop::{Stop, Stopped};

/// Target number of grid nodes. More tighten the bounds (half the spacing takes eight times as many) at about 0.2 µs
/// of preparation and 4 bytes per node.
const TARGET_NODES: f32 = 32_768.0;

/// Largest number of grid nodes. Objects that are very long and thin for their grid need more than the target, because no axis has
/// fewer than two.
const MAX_NODES: f32 = 4.0 * TARGET_NODES;

/// How far the grid extends beyond the mesh's box, in metres: about the length of a phalanx. Farther out, the box
/// itself gives as good a bound.
const MARGIN: f32 = 0.04;

/// By how much the spacing grows until the nodes are few enough.
const COARSER: f32 = 1.25;

/// Nodes between two checks whether to stop: few, because one of a crumpled surface takes up to a millisecond.
const NODES_PER_CHECK: usize = 4;

/// Steps of the search for the closest triangle that each node adds to what the nodes may take, and what each half begins with.
/// Ordinary objects take a tenth; thousands of needles through one place would take all of their triangles for each node.
const STEPS_PER_NODE: usize = 128;
const SPARE_STEPS: usize = 1 << 17;

/// Number of spheres along the axis that cover a capsule. More tighten the bound and take longer.
const SPHERES: usize = 3;

/// What is near a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    /// The distance to the surface, in metres, or an upper bound of it.
    pub(super) distance: f32,
    /// The triangle that is closest to the node or to a neighbour.
    pub(super) triangle: Option<u32>,
}

/// Where the nodes of a field are, in metres.
struct Grid {
    origin: Vec3,
    spacing: f32,
    counts: UVec3,
    diagonal: f32,
}

/// The distances of the nodes of some layers of a grid.
struct Layers {
    distances: Vec<f32>,
    is_cut_short: bool,
}

impl Grid {
    /// Samples some layers along z.
    fn sample(
        &self,
        layers: Range<u32>,
        stop: Stop<'_>,
        nearest: &impl Fn(Vec3, Nearest, &mut dyn FnMut() -> bool) -> Result<Nearest, GivenUp>,
    ) -> Result<Layers, Stopped> {
        let &Self {
            origin,
            spacing,
            counts,
            diagonal,
        } = self;
        let mut distances = Vec::with_capacity((counts.x * counts.y) as usize * layers.len());
        let mut steps_left = SPARE_STEPS;
        let mut is_cut_short = false;
        let mut at_row_start = None;
        for z in layers {
            for y in 0..counts.y {
                // Distances of neighbouring nodes differ by at most the spacing, which bounds the next search.
                let mut least = 0.0_f32;
                let mut near = Nearest {
                    distance: diagonal,
                    triangle: at_row_start,
                };
                for x in 0..counts.x {
                    stop.check_every(NODES_PER_CHECK, x as usize)?;
                    let node = origin + UVec3::new(x, y, z).as_vec3() * spacing;
                    steps_left += STEPS_PER_NODE;
                    let mut may_go_on = || {
                        steps_left = steps_left.saturating_sub(1);
                        steps_left > 0
                    };
                    if let Ok(found) = nearest(node, near, &mut may_go_on) {
                        least = found.distance;
                        near = found;
                    } else {
                        is_cut_short = true;
                        // Where so much overlaps, what is known of the neighbour has to do.
                        least = (least - spacing * 1.001).max(0.0);
                    }
                    near.distance = (near.distance + spacing) * 1.001;
                    if x == 0 {
                        at_row_start = near.triangle;
                    }
                    distances.push(least);
                }
            }
        }
        Ok(Layers {
            distances,
            is_cut_short,
        })
    }
}

/// Distances from the nodes of a grid to a surface.
#[derive(Clone, Debug)]
pub(super) struct DistanceField {
    origin: Vec3,
    spacing: f32,
    inverse_spacing: f32,
    counts: UVec3,
    /// The box around the surface, which gives the better bound beyond the grid.
    aabb: Aabb,
    distances: Vec<f32>,
    /// Whether some of the distances are only lower bounds, because finding them would have taken too long.
    is_cut_short: bool,
}

impl DistanceField {
    /// Samples the field of a surface inside `aabb`, in two threads if there is one to spare. `nearest(point, near, may_go_on)` returns what is closest to the point, or
    /// `near` if nothing is within its distance, which it may look at first; it gives up once `may_go_on` returns false, which it
    /// asks at each step.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn new(
        aabb: &Aabb,
        stop: Stop<'_>,
        nearest: impl Fn(Vec3, Nearest, &mut dyn FnMut() -> bool) -> Result<Nearest, GivenUp> + Sync,
    ) -> Result<Self, Stopped> {
        let size = aabb.max - aabb.min + 2.0 * MARGIN;
        let mut spacing = (size.element_product() / TARGET_NODES).cbrt();
        let counts_at = |spacing: f32| (size / spacing).ceil() + 1.0;
        while counts_at(spacing).element_product() > MAX_NODES {
            spacing *= COARSER;
        }
        let counts = counts_at(spacing).as_uvec3();
        let grid = Grid {
            origin: aabb.min - MARGIN,
            spacing,
            counts,
            diagonal: size.length(),
        };
        let middle = counts.z / 2;
        let sample_low = || grid.sample(0..middle, stop, &nearest);
        let sample_high = || grid.sample(middle..counts.z, stop, &nearest);
        let (low, high) = thread::scope(|scope| {
            let parallel = thread::Builder::new().spawn_scoped(scope, sample_high);
            let low = sample_low();
            let high = parallel.ok().and_then(|thread| thread.join().ok());
            (low, high.unwrap_or_else(sample_high))
        });
        let (low, high) = (low?, high?);
        Ok(Self {
            origin: grid.origin,
            spacing,
            inverse_spacing: spacing.recip(),
            counts,
            aabb: *aabb,
            distances: [low.distances, high.distances].concat(),
            is_cut_short: low.is_cut_short || high.is_cut_short,
        })
    }

    /// A lower bound of the distance from a point to the surface, in metres.
    #[inline]
    fn distance_lower_bound(&self, point: Vec3) -> f32 {
        let last = (self.counts - 1).as_vec3();
        let grid_position = ((point - self.origin) * self.inverse_spacing).clamp(Vec3::ZERO, last);
        let node = (grid_position + 0.5).as_uvec3().min(self.counts - 1);
        let index = (node.z * self.counts.y + node.y) * self.counts.x + node.x;
        let from_node = point.distance(self.origin + node.as_vec3() * self.spacing);
        (self.distances[index as usize] - from_node).max(self.aabb.distance(point))
    }

    /// A lower bound of the gap between the surface and a capsule's skin, in metres. A negative bound says nothing.
    #[inline]
    pub(super) fn gap_lower_bound(&self, capsule: &TaperedCapsule) -> f32 {
        // Each sphere bounds the part of the capsule nearest to its centre on the axis.
        let half_part = 0.5 / SPHERES as f32;
        let overhang = half_part * (capsule.length() + (capsule.end_radius - capsule.start_radius).abs());
        let mut bound = f32::INFINITY;
        for sphere in 0..SPHERES {
            let along = (2 * sphere + 1) as f32 * half_part;
            bound = bound.min(self.distance_lower_bound(capsule.at(along)) - capsule.radius_at(along));
        }
        bound - overhang
    }

    /// True if the surface is so crowded that finding all distances would have taken too long.
    pub(super) fn is_cut_short(&self) -> bool {
        self.is_cut_short
    }

    /// Memory of the samples, in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.distances.as_slice())
    }
}
