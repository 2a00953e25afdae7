//! A mesh with its bounding volume hierarchy (BVH), and the queries on it. A coarse grid of distances proves that a capsule is clear
//! without visiting triangles.

use std::{ops::Range, sync::Arc, thread};

use glam::{UVec3, Vec3};

use super::{
    Segment,
    boxes::Aabb,
    capsule_gap::{self, CapsuleGap},
    closest, crossing,
    mesh::TriangleMesh,
    tapered_capsule::TaperedCapsule,
    topology::Containment,
    wide_bvh::WideBvh,
};
use crate::base::stop::{Stop, Stopped, unstopped};

/// Edges of holes above which a surface is crowded: a containment test then takes half a millisecond.
const CROWDED_RIM: usize = 8192;

/// Factor on the distance to one triangle, within which that triangle is found in spite of rounding.
const NEARLY: f32 = 1.0 + 64.0 * f32::EPSILON;

/// A point of a mesh that a query found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshPoint {
    /// The point.
    pub position: Vec3,
    /// Distance from the query's point or from its segment's start, in metres.
    pub distance: f32,
    /// The triangle it lies on.
    pub triangle: u32,
}

/// A mesh and its hierarchy. Queries work in the mesh's frame and in metres, do not allocate for trees of usual
/// depth, and return `false` or `None` if a coordinate is not finite.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    mesh: Arc<TriangleMesh>,
    bvh: WideBvh,
    aabb: Aabb,
    containment: Containment,
    /// Only for meshes that are queried many times.
    distance_field: Option<DistanceField>,
}

impl MeshBvh {
    /// Builds the hierarchy for a mesh that is queried many times: a few milliseconds for 2,000 triangles.
    pub fn build(mesh: impl Into<Arc<TriangleMesh>>) -> Self {
        unstopped(|stop| Self::build_until(mesh, stop))
    }

    /// As [`Self::build`], unless it is stopped.
    pub(crate) fn build_until(mesh: impl Into<Arc<TriangleMesh>>, stop: Stop<'_>) -> Result<Self, Stopped> {
        Self::with_quality(mesh.into(), true, stop)
    }

    /// Builds the hierarchy for a mesh that serves one request: less than a millisecond for 5,000 triangles. Queries
    /// give the same answers but take longer.
    pub fn build_quick(mesh: impl Into<Arc<TriangleMesh>>) -> Self {
        unstopped(|stop| Self::with_quality(mesh.into(), false, stop))
    }

    fn with_quality(mesh: Arc<TriangleMesh>, is_thorough: bool, stop: Stop<'_>) -> Result<Self, Stopped> {
        let aabb = mesh.aabb();
        let bvh = WideBvh::build(&mesh, is_thorough, stop)?;
        let distance_field = is_thorough.then(|| DistanceField::new(&bvh, &mesh, aabb, stop));
        Ok(Self {
            distance_field: distance_field.transpose()?,
            bvh,
            containment: Containment::of(&mesh, &aabb, stop)?,
            aabb,
            mesh,
        })
    }

    /// The mesh.
    pub fn mesh(&self) -> &Arc<TriangleMesh> {
        &self.mesh
    }

    /// The box around the mesh.
    pub fn aabb(&self) -> Aabb {
        self.aabb
    }

    /// True if the segment crosses any triangle, endpoints included. A segment in a triangle's plane does not cross
    /// that triangle, and a segment of zero length crosses nothing.
    #[inline]
    pub fn is_crossed_by(&self, segment: Segment) -> bool {
        self.aabb.may_intersect(segment) && crossing::crosses_any(&self.bvh, &self.mesh, segment)
    }

    /// The crossing nearest to the segment's start, by the rules of [`MeshBvh::is_crossed_by`]. Where triangles meet,
    /// the lowest index wins.
    pub fn first_hit(&self, segment: Segment) -> Option<MeshPoint> {
        if !self.aabb.may_intersect(segment) {
            return None;
        }
        let (triangle, crossing) = crossing::first(&self.bvh, &self.mesh, segment)?;
        let start = segment.start.as_dvec3();
        let offset = (segment.end.as_dvec3() - start) * crossing.t;
        Some(MeshPoint {
            position: (start + offset).as_vec3(),
            distance: offset.length() as f32,
            triangle,
        })
    }

    /// True if queries take about as long as a scan of all triangles, because thousands overlap in one place or holes have
    /// thousands of edges. A quick hierarchy is judged by its holes alone.
    pub fn is_crowded(&self) -> bool {
        let field = self.distance_field.as_ref();
        let overlaps = field.is_some_and(|field| field.is_cut_short);
        overlaps || self.rim_edges() > CROWDED_RIM
    }

    /// Number of edges of holes, in proportion to which [`Self::contains`] takes time.
    pub fn rim_edges(&self) -> usize {
        self.containment.caps.len()
    }

    /// Upper bound of the packs of up to four triangles that a search along a segment visits.
    pub(crate) fn packs_along(&self, segment: Segment) -> usize {
        if self.aabb.may_intersect(segment) {
            crossing::packs_along(&self.bvh, segment)
        } else {
            0
        }
    }

    /// The closest point of the surface, if it is at most `max_distance` metres away. If several triangles are
    /// equally close within rounding, any of them may be returned.
    pub fn closest_point_within(&self, point: Vec3, max_distance: f32) -> Option<MeshPoint> {
        if closest::is_beyond(&self.aabb, point, max_distance) {
            return None;
        }
        let closest = closest::closest(&self.bvh, &self.mesh, point, max_distance, || true);
        let (triangle, position, distance) = closest.ok()??;
        Some(MeshPoint {
            position,
            distance,
            triangle,
        })
    }

    /// Calls `visit` with every triangle within `distance` metres of a point.
    pub(crate) fn each_within(&self, point: Vec3, distance: f32, visit: impl FnMut(u32)) {
        closest::each_within(&self.bvh, point, distance, visit);
    }

    /// Where the surface comes closest to a capsule's skin or penetrates it deepest, to a hundredth of a millimetre;
    /// `None` if the gap exceeds `within` metres. Only the surface counts: a capsule deep inside the mesh's volume has
    /// a positive gap.
    pub fn closest_to_capsule(&self, capsule: &TaperedCapsule, within: f32) -> Option<CapsuleGap> {
        if self.gap_lower_bound(capsule) > within {
            return None;
        }
        capsule_gap::closest(&self.bvh, &self.mesh, capsule, within)
    }

    /// Memory use in bytes, without the mesh.
    pub fn bytes(&self) -> usize {
        self.bvh.bytes() + self.containment.bytes() + self.distance_field_bytes()
    }

    /// Memory of the distance field, in bytes; 0 without one.
    pub fn distance_field_bytes(&self) -> usize {
        let field = self.distance_field.as_ref();
        field.map_or(0, |field| size_of_val(field.distances.as_slice()))
    }

    /// A lower bound of the gap between the surface and a capsule's skin, in metres, read from the distance field
    /// alone: some millimetres below the true gap. A negative bound says nothing.
    #[inline]
    pub fn gap_lower_bound(&self, capsule: &TaperedCapsule) -> f32 {
        self.distance_field
            .as_ref()
            .map_or(f32::NEG_INFINITY, |field| field.gap_lower_bound(capsule))
    }

    /// True if the surface comes closer than `distance` metres to a capsule's skin; for a negative distance, if it
    /// penetrates the skin deeper than that.
    pub fn comes_within(&self, capsule: &TaperedCapsule, distance: f32) -> bool {
        self.gap_lower_bound(capsule) < distance && capsule_gap::is_within(&self.bvh, capsule, distance)
    }

    /// True if the mesh's volume contains the point, by a generalised winding number above one half in magnitude,
    /// which handles overlapping parts, cavities and small holes. Points on the surface may be either.
    pub fn contains(&self, point: Vec3) -> bool {
        self.aabb.contains(point) && self.containment.contains(&self.bvh, &self.mesh, point)
    }

    /// True if a triangle belongs to a sheet, which has no inside and may be pressed from both sides.
    pub(crate) fn is_sheet(&self, triangle: u32) -> bool {
        self.containment.is_sheet(triangle as usize)
    }
}

/// Target number of grid nodes.
const TARGET_NODES: f32 = 32_768.0;

/// Largest number of grid nodes.
const MAX_NODES: f32 = 4.0 * TARGET_NODES;

/// How far the grid extends beyond the mesh's box, in metres: about the length of a phalanx.
const MARGIN: f32 = 0.04;

/// Factor by which the spacing grows until the nodes are few enough.
const COARSER: f32 = 1.25;

/// Nodes between two polls of the stop signal: few, because one of a crumpled surface takes up to a millisecond.
const NODES_PER_CHECK: usize = 4;

/// Budget of search steps for closest triangles: the steps that each node adds, and those that each half starts with.
const STEPS_PER_NODE: usize = 128;
const SPARE_STEPS: usize = 1 << 17;

/// Number of spheres along the axis that cover a capsule. More tighten the bound and take longer.
const SPHERES: usize = 3;

/// Distances from the nodes of a grid to a surface.
#[derive(Clone, Debug)]
struct DistanceField {
    origin: Vec3,
    spacing: f32,
    inverse_spacing: f32,
    counts: UVec3,
    /// The box around the surface, which gives the better bound beyond the grid.
    aabb: Aabb,
    distances: Vec<f32>,
    /// Whether some of the distances are only lower bounds, because the budget was spent.
    is_cut_short: bool,
}

impl DistanceField {
    /// Samples the field of a surface inside `aabb`, in two threads if there is one to spare.
    fn new(bvh: &WideBvh, mesh: &TriangleMesh, aabb: Aabb, stop: Stop<'_>) -> Result<Self, Stopped> {
        let size = aabb.extents() + 2.0 * MARGIN;
        let mut spacing = (size.element_product() / TARGET_NODES).cbrt();
        let counts_at = |spacing: f32| (size / spacing).ceil() + 1.0;
        while counts_at(spacing).element_product() > MAX_NODES {
            spacing *= COARSER;
        }
        let counts = counts_at(spacing).as_uvec3();
        let mut field = Self {
            origin: aabb.min - MARGIN,
            spacing,
            inverse_spacing: spacing.recip(),
            counts,
            aabb,
            distances: Vec::new(),
            is_cut_short: false,
        };
        let middle = counts.z / 2;
        let sample_low = || field.sample(0..middle, bvh, mesh, stop);
        let sample_high = || field.sample(middle..counts.z, bvh, mesh, stop);
        let (low, high) = thread::scope(|scope| {
            let parallel = thread::Builder::new().spawn_scoped(scope, sample_high);
            let low = sample_low();
            let high = parallel.ok().and_then(|thread| thread.join().ok());
            (low, high.unwrap_or_else(sample_high))
        });
        let ((low, low_is_cut), (high, high_is_cut)) = (low?, high?);
        field.distances = [low, high].concat();
        field.is_cut_short = low_is_cut || high_is_cut;
        Ok(field)
    }

    /// The distances of the nodes of some layers along z, and whether finding them was cut short.
    fn sample(
        &self,
        layers: Range<u32>,
        bvh: &WideBvh,
        mesh: &TriangleMesh,
        stop: Stop<'_>,
    ) -> Result<(Vec<f32>, bool), Stopped> {
        let farthest = (self.aabb.extents() + 2.0 * MARGIN).length();
        let mut distances = Vec::with_capacity((self.counts.x * self.counts.y) as usize * layers.len());
        let mut steps_left = SPARE_STEPS;
        let mut is_cut_short = false;
        let mut at_row_start = None;
        for z in layers {
            for y in 0..self.counts.y {
                // Distances of neighbouring nodes differ by at most the spacing, which bounds the next search.
                let (mut least, mut within, mut nearest) = (0.0_f32, farthest, at_row_start);
                for x in 0..self.counts.x {
                    stop.check_every(NODES_PER_CHECK, x as usize)?;
                    let node = self.origin + UVec3::new(x, y, z).as_vec3() * self.spacing;
                    steps_left += STEPS_PER_NODE;
                    let may_go_on = || {
                        steps_left = steps_left.saturating_sub(1);
                        steps_left > 0
                    };
                    // The triangle that is closest to the neighbour is nearly so here, and excludes most others.
                    let reach = nearest.map_or(within, |triangle: u32| {
                        let corners = mesh.corners(triangle as usize);
                        within.min(NEARLY * closest::distance_of_point(corners, node))
                    });
                    if let Ok(found) = closest::closest(bvh, mesh, node, reach, may_go_on) {
                        if let Some((triangle, _, distance)) = found {
                            (within, nearest) = (distance, Some(triangle));
                        }
                        least = within;
                    } else {
                        is_cut_short = true;
                        // The budget is spent: bound the distance by the neighbour's.
                        least = (least - self.spacing * 1.001).max(0.0);
                    }
                    within = (within + self.spacing) * 1.001;
                    if x == 0 {
                        at_row_start = nearest;
                    }
                    distances.push(least);
                }
            }
        }
        Ok((distances, is_cut_short))
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
    fn gap_lower_bound(&self, capsule: &TaperedCapsule) -> f32 {
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
}
