//! A mesh with its bounding volume hierarchy (BVH), and the queries on it.

use std::sync::Arc;

use glam::Vec3;

use super::{
    Segment,
    aabb::Aabb,
    capsule_gap::{self, CapsuleGap},
    closest,
    containment::Containment,
    crossing,
    distance_field::{DistanceField, Nearest},
    mesh::TriangleMesh,
    tapered_capsule::TaperedCapsule,
    wide_bvh::{BuildQuality, WideBvh},
};
use crate::base::stop::{Stop, Stopped, unstopped};

/// Edges of holes beyond which a surface is crowded: a test for containment takes half a millisecond then.
const CROWDED_RIM: usize = 8192;

/// Factor on the distance to one triangle, within which that triangle is found in spite of rounding.
const NEARLY: f32 = 1.0 + 64.0 * f32::EPSILON;

/// A point where a segment crosses a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentHit {
    /// The crossing point.
    pub position: Vec3,
    /// Distance from the segment's start, in metres.
    pub distance: f32,
    /// The crossed triangle.
    pub triangle: u32,
}

/// The point of a mesh that is closest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// The closest point.
    pub position: Vec3,
    /// Distance from the query point, in metres.
    pub distance: f32,
    /// The triangle it lies on.
    pub triangle: u32,
}

/// A mesh and its hierarchy. Queries work in the mesh's frame and in metres, do not allocate for trees of usual
/// depth, and answer "no" or "none" if a coordinate is not finite.
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
    ///
    /// # Errors
    /// [`Stopped`].
    pub(crate) fn build_until(mesh: impl Into<Arc<TriangleMesh>>, stop: Stop<'_>) -> Result<Self, Stopped> {
        Self::with_quality(mesh.into(), BuildQuality::Thorough, stop)
    }

    /// Builds the hierarchy for a mesh that serves one request: less than a millisecond for 5,000 triangles. Queries
    /// give the same answers but take longer.
    pub fn build_quick(mesh: impl Into<Arc<TriangleMesh>>) -> Self {
        unstopped(|stop| Self::with_quality(mesh.into(), BuildQuality::Quick, stop))
    }

    fn with_quality(mesh: Arc<TriangleMesh>, quality: BuildQuality, stop: Stop<'_>) -> Result<Self, Stopped> {
        let aabb = mesh.aabb();
        let bvh = WideBvh::build(&mesh, quality, stop)?;
        let distance = |point: Vec3, near: Nearest, may_go_on: &mut dyn FnMut() -> bool| {
            // The triangle that is closest to the neighbour is nearly so here, and excludes most others.
            let to_near = |triangle: u32| {
                let corners = mesh.corners(triangle as usize);
                let closest = closest::closest_on_triangle(corners, point.as_dvec3());
                NEARLY * closest.distance(point.as_dvec3()) as f32
            };
            let within = near
                .triangle
                .map_or(near.distance, |triangle| near.distance.min(to_near(triangle)));
            let found = closest::closest_if_cheap(&bvh, &mesh, point, within, may_go_on)?;
            Ok(found.map_or(near, |(triangle, _, distance)| Nearest {
                distance,
                triangle: Some(triangle),
            }))
        };
        let distance_field = match quality {
            BuildQuality::Thorough => Some(DistanceField::new(&aabb, stop, distance)?),
            BuildQuality::Quick => None,
        };
        Ok(Self {
            distance_field,
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
    pub fn first_hit(&self, segment: Segment) -> Option<SegmentHit> {
        if !self.aabb.may_intersect(segment) {
            return None;
        }
        let (triangle, crossing) = crossing::first(&self.bvh, &self.mesh, segment)?;
        let start = segment.start.as_dvec3();
        let offset = (segment.end.as_dvec3() - start) * crossing.t;
        Some(SegmentHit {
            position: (start + offset).as_vec3(),
            distance: offset.length() as f32,
            triangle,
        })
    }

    /// True if each query takes about as long as looking at all triangles: if so many overlap, such as thousands of needles through
    /// one place, or if holes have so many edges. Of a quick hierarchy, only the holes count.
    pub fn is_crowded(&self) -> bool {
        let overlaps = self
            .distance_field
            .as_ref()
            .is_some_and(DistanceField::is_cut_short);
        overlaps || self.rim_edges() > CROWDED_RIM
    }

    /// Number of edges of holes, in proportion to which [`Self::contains`] takes time.
    pub fn rim_edges(&self) -> usize {
        self.containment.rim_edges()
    }

    /// How many packs of up to four triangles a search along a segment has to look at, at most.
    pub(crate) fn packs_along(&self, segment: Segment) -> usize {
        if self.aabb.may_intersect(segment) {
            crossing::packs_along(&self.bvh, segment)
        } else {
            0
        }
    }

    /// The closest point of the surface, if it is at most `max_distance` metres away. If several triangles are
    /// equally close within rounding, any of them may be returned.
    pub fn closest_point_within(&self, point: Vec3, max_distance: f32) -> Option<ClosestPoint> {
        if closest::is_beyond(&self.aabb, point, max_distance) {
            return None;
        }
        let (triangle, position, distance) = closest::closest(&self.bvh, &self.mesh, point, max_distance)?;
        Some(ClosestPoint {
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
    /// none if the gap exceeds `within` metres. Only the surface counts: a capsule deep inside the mesh's volume has
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
        self.distance_field.as_ref().map_or(0, DistanceField::bytes)
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

    /// True if any part of the segment lies on the surface or in the volume (Algorithm 6).
    pub fn touches(&self, segment: Segment) -> bool {
        // A segment that crosses nothing is entirely inside or entirely outside.
        self.is_crossed_by(segment) || self.contains(segment.start)
    }
}
