//! Obstacles: solids that the receiving hand keeps clear of.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// All points within a radius of a segment. With two radii: the convex hull of the balls around its ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capsule {
    /// One end of the segment, in the client's frame.
    pub client_start: Vec3,
    /// The other end; may be the same point, for a ball.
    pub client_end: Vec3,
    /// Radius around `client_start`, and around `client_end` unless `end_radius` is set; more than 0, at most 1 km. Metres,
    /// or centimetres in the Unreal convention.
    pub radius: f32,
    /// Radius around `client_end`, with the same limits and unit; none: `radius`.
    #[serde(default)]
    pub end_radius: Option<f32>,
}

/// A solid box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidBox {
    /// The box's frame, with its origin at the centre and its axes along the edges, in the client's frame.
    #[serde(default)]
    pub client_from_box: Pose,
    /// Half the edge lengths along the axes of the box's frame; each more than 0, at most 1 km. Metres, or centimetres in the
    /// Unreal convention.
    pub half_extents: Vec3,
}

/// Something solid that the receiving hand and forearm do not touch, such as a table. It may touch the object or contain it.
/// In JSON: `{"capsule": {…}}` or `{"box": {…}}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Obstacle {
    /// A capsule.
    Capsule(Capsule),
    /// A box.
    Box(SolidBox),
}

impl Obstacle {
    /// A capsule of one radius around the segment between two points.
    pub const fn capsule(client_start: Vec3, client_end: Vec3, radius: f32) -> Self {
        Self::Capsule(Capsule {
            client_start,
            client_end,
            radius,
            end_radius: None,
        })
    }

    /// A box by its frame and half its edge lengths. A floor is a wide box whose upper face is the ground.
    pub const fn solid_box(client_from_box: Pose, half_extents: Vec3) -> Self {
        Self::Box(SolidBox {
            client_from_box,
            half_extents,
        })
    }
}
