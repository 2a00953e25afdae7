//! Segments, meshes, bounding boxes and the queries that the synthesis needs.

pub mod aabb;
pub mod capsule_gap;
mod closest;
mod containment;
mod crossing;
mod distance_field;
pub mod mesh;
pub mod mesh_bvh;
pub mod oriented_box;
pub mod tapered_capsule;
pub mod topology;
mod waiting;
mod wide_bvh;

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A line segment, in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// A.
    pub start: Vec3,
    /// B.
    pub end: Vec3,
}

impl Segment {
    /// The segment AB.
    pub const fn new(start: Vec3, end: Vec3) -> Self {
        Self { start, end }
    }
}
