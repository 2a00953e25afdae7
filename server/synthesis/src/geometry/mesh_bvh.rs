//! A mesh with its bounding volume hierarchy, and the queries on it. To come; the interface is fixed.

use glam::Vec3;

use super::{Segment, mesh::TriangleMesh};

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

/// A mesh and its hierarchy.
#[derive(Clone, Debug)]
pub struct MeshBvh {
    mesh: TriangleMesh,
}

impl MeshBvh {
    /// Builds the hierarchy for a mesh that is queried many times.
    pub fn build(mesh: TriangleMesh) -> Self {
        Self { mesh }
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.mesh
    }

    /// True if the segment crosses any triangle.
    pub fn is_crossed_by(&self, _segment: Segment) -> bool {
        false
    }

    /// The crossing nearest to the segment's start.
    pub fn first_hit(&self, _segment: Segment) -> Option<SegmentHit> {
        None
    }

    /// The closest point of the surface, if it is at most `max_distance` metres away.
    pub fn closest_point_within(&self, _point: Vec3, _max_distance: f32) -> Option<ClosestPoint> {
        None
    }

    /// True if the mesh's volume contains the point.
    pub fn contains(&self, _point: Vec3) -> bool {
        false
    }
}
