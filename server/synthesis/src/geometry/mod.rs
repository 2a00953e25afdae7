//! Segments, meshes, bounding volumes, capsules, and the spatial queries on them.

pub mod boxes;
pub mod capsule_gap;
mod closest;
mod crossing;
pub mod handles;
pub mod local_shape;
pub mod mesh;
pub mod mesh_bvh;
pub mod opposed;
pub mod sharp;
pub mod surface_samples;
pub mod tapered_capsule;
pub mod topology;
mod wide_bvh;
pub mod zone;

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A line segment, in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Start point A.
    pub start: Vec3,
    /// End point B.
    pub end: Vec3,
}

impl Segment {
    /// The segment AB.
    pub const fn new(start: Vec3, end: Vec3) -> Self {
        Self { start, end }
    }
}
