//! Hands of which only the mesh is known.

use glam::Vec3;

use crate::{
    base::pose::Pose,
    geometry::{
        inner_balls::{Ball, inner_balls},
        mesh::TriangleMesh,
        mesh_bvh::MeshBvh,
    },
};

/// Balls that stand for the hand where an answer of "certainly too close" suffices: as many as a hand of joints has solids.
const BALLS: usize = 48;

/// Distance of the palm's middle from the wrist in metres: that of an adult.
const WRIST_TO_PALM: f32 = 0.08;

/// Somebody's hand as a mesh, with what else of the body belongs to it.
#[derive(Clone, Debug)]
pub struct HandMesh {
    /// The mesh with search structure. Where it is open, as at the wrist, the winding number decides what is inside.
    pub surface: MeshBvh,
    /// The wrist's `OpenXR` joint frame, if it is known.
    pub wrist: Option<Pose>,
    /// Balls inside its volume, the largest first; `None` if it has no volume.
    pub balls: Vec<Ball>,
}

impl HandMesh {
    /// Prepares a mesh, in a millisecond or two for 5,000 triangles. Mesh and wrist are in the same frame.
    pub fn new(mesh: TriangleMesh, wrist: Option<Pose>) -> Self {
        let surface = MeshBvh::build_quick(mesh);
        Self {
            balls: inner_balls(&surface, BALLS),
            surface,
            wrist,
        }
    }

    /// The middle of the palm, in metres: an adult's in front of the wrist, or the middle of the mesh's box without one.
    pub fn palm(&self) -> Vec3 {
        match self.wrist {
            Some(wrist) => wrist.transform_point(Vec3::NEG_Z * WRIST_TO_PALM),
            None => self.surface.aabb().centre(),
        }
    }
}
