//! Oriented bounding boxes. To come; the interface is fixed.

use glam::Vec3;

use super::mesh::TriangleMesh;
use crate::pose::Pose;

/// B of thesis 4.3: a box that fits snugly around an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// The box's frame, with its centre as origin, in the object's frame.
    pub object_from_box: Pose,
    /// Half of its edge lengths along its own axes, in metres.
    pub half_extents: Vec3,
}

impl OrientedBox {
    /// A snug box around a mesh.
    pub fn around(_mesh: &TriangleMesh) -> Self {
        Self {
            object_from_box: Pose::IDENTITY,
            half_extents: Vec3::ONE,
        }
    }

    /// How far a point of the object's frame is outside the box, in metres; 0 inside.
    pub fn distance(&self, point: Vec3) -> f32 {
        let local = self.object_from_box.inverse().transform_point(point);
        (local.abs() - self.half_extents).max(Vec3::ZERO).length()
    }
}
