//! A mesh with its bounding volume hierarchy, and the queries on it.

use glam::Vec3;

use super::{
    Segment,
    aabb::Aabb,
    capsule_gap::{self, CapsuleGap},
    closest,
    containment::Containment,
    crossing,
    distance_field::DistanceField,
    mesh::TriangleMesh,
    tapered_capsule::TaperedCapsule,
    wide_bvh::{BuildQuality, WideBvh},
};

/// A point where a segment crosses a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentHit {
    /// Where.
    pub position: Vec3,
    /// Distance from the segment's start in metres.
    pub distance: f32,
    /// The triangle that is crossed.
    pub triangle: u32,
}

/// The point of a mesh that is closest to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Where.
    pub position: Vec3,
    /// How far, in metres.
    pub distance: f32,
    /// The triangle it lies on.
    pub triangle: u32,
}

/// A mesh and its hierarchy. Queries take metres in the mesh's frame, never allocate for a tree of usual depth, and
/// answer "no" to coordinates that are not finite.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    mesh: TriangleMesh,
    bvh: WideBvh,
    aabb: Aabb,
    containment: Containment,
    /// Of meshes that are queried many times.
    field: Option<DistanceField>,
}

impl MeshBvh {
    /// Builds the hierarchy for a mesh that is queried many times: a few milliseconds for 2,000 triangles.
    pub fn build(mesh: TriangleMesh) -> Self {
        Self::with_quality(mesh, BuildQuality::Thorough)
    }

    /// Builds the hierarchy for a mesh that serves one request: below a millisecond for 5,000 triangles. Answers are
    /// the same, queries take longer.
    pub fn build_quick(mesh: TriangleMesh) -> Self {
        Self::with_quality(mesh, BuildQuality::Quick)
    }

    fn with_quality(mesh: TriangleMesh, quality: BuildQuality) -> Self {
        let aabb = mesh.aabb();
        let bvh = WideBvh::build(&mesh, quality);
        let distance = |point: Vec3, within: f32| {
            closest::closest(&bvh, &mesh, point, within).map_or(within, |(_, _, distance)| distance)
        };
        let field = match quality {
            BuildQuality::Thorough => Some(DistanceField::new(&aabb, distance)),
            BuildQuality::Quick => None,
        };
        Self {
            field,
            bvh,
            containment: Containment::of(&mesh, &aabb),
            aabb,
            mesh,
        }
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// The box around it.
    pub fn aabb(&self) -> Aabb {
        self.aabb
    }

    /// True if the segment crosses any triangle; its endpoints count. A segment that lies in a triangle's plane does
    /// not cross that triangle, and a segment without length crosses nothing.
    #[inline]
    pub fn is_crossed_by(&self, segment: Segment) -> bool {
        self.aabb.may_meet(segment) && crossing::crosses_any(&self.bvh, &self.mesh, segment)
    }

    /// The crossing nearest to the segment's start, by the rules of [`MeshBvh::is_crossed_by`]. Where triangles meet,
    /// the one with the lowest index.
    pub fn first_hit(&self, segment: Segment) -> Option<SegmentHit> {
        if !self.aabb.may_meet(segment) {
            return None;
        }
        let (triangle, crossing) = crossing::first(&self.bvh, &self.mesh, segment)?;
        let start = segment.start.as_dvec3();
        let way = (segment.end.as_dvec3() - start) * crossing.t;
        Some(SegmentHit {
            position: (start + way).as_vec3(),
            distance: way.length() as f32,
            triangle,
        })
    }

    /// The closest point of the surface, if it is at most `max_distance` metres away. Where several triangles are
    /// equally close within rounding, any of them.
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

    /// Where the surface comes closest to a capsule's skin, or goes deepest below it, if that is at most `within` metres
    /// off the skin, to a hundredth of a millimetre. It says nothing of the mesh's volume: a capsule deep in it has a
    /// positive gap.
    pub fn closest_to_capsule(&self, capsule: &TaperedCapsule, within: f32) -> Option<CapsuleGap> {
        if self.least_gap(capsule) > within {
            return None;
        }
        capsule_gap::closest(&self.bvh, &self.mesh, capsule, within)
    }

    /// Bytes that what is known of the distances around the mesh takes.
    pub fn field_bytes(&self) -> usize {
        self.field.as_ref().map_or(0, DistanceField::bytes)
    }

    /// A gap that the surface surely keeps from a capsule's skin, in metres, known without a look at the triangles: some
    /// millimetres less than the true one. Below 0, none is sure.
    #[inline]
    pub fn least_gap(&self, capsule: &TaperedCapsule) -> f32 {
        self.field
            .as_ref()
            .map_or(f32::NEG_INFINITY, |field| field.least_gap(capsule))
    }

    /// True if any of the surface is less than `distance` metres off a capsule's skin; below 0, deeper than that below
    /// it.
    pub fn comes_within(&self, capsule: &TaperedCapsule, distance: f32) -> bool {
        self.least_gap(capsule) < distance && capsule_gap::is_within(&self.bvh, capsule, distance)
    }

    /// True if the mesh's volume contains the point: if its generalised winding number is more than one half, so that
    /// overlapping parts, cavities and small holes count as one would expect. Points on the surface may be either.
    pub fn contains(&self, point: Vec3) -> bool {
        self.aabb.contains(point) && self.containment.contains(&self.bvh, &self.mesh, point)
    }

    /// True if any part of the segment is on the surface or in the volume (Algorithm 6).
    pub fn touches(&self, segment: Segment) -> bool {
        // A segment that crosses nothing is inside or outside as a whole.
        self.is_crossed_by(segment) || self.contains(segment.start)
    }
}
