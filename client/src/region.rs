//! Regions: parts of an object's surface that hands should take, leave, or not touch.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// What hands do with a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RegionKind {
    /// They must not touch it.
    Forbidden,
    /// They touch it only if they find nothing better.
    Avoid,
    /// They take the object there if they can.
    Prefer,
}

/// A part of space in the object's frame, in metres, that marks what of the surface is in it. In JSON, for example:
/// `{"sphere": {"centre": [0, 0, 0], "radius": 0.03}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RegionShape {
    /// All points within a radius of one.
    Sphere {
        /// The centre.
        centre: Vec3,
        /// The radius; more than 0.
        radius: f32,
    },
    /// The inside of a box.
    Box {
        /// The box's frame, with its origin at the centre and its axes along the edges.
        #[serde(default)]
        object_from_box: Pose,
        /// Half the edge lengths along the axes of the box's frame; each more than 0.
        half_extents: Vec3,
    },
    /// One side of a plane.
    HalfSpace {
        /// A point of the plane.
        #[serde(default)]
        point: Vec3,
        /// The direction from the plane into the half-space, of any length but 0.
        normal: Vec3,
    },
    /// All points within a radius of a line through several points.
    Tube {
        /// The points: 2 to 64.
        points: Vec<Vec3>,
        /// The radius; more than 0.
        radius: f32,
    },
}

/// A named part of an object's surface: what groups, triangles and shapes mark together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Distinguishes it from the object's other regions: 1 to 63 characters.
    pub name: String,
    /// What hands do with it.
    pub kind: RegionKind,
    /// How much it counts next to other terms of the score; more than 0, at most 1; none: 1. None for what is forbidden.
    #[serde(default)]
    pub weight: Option<f32>,
    /// Names of parts of the mesh file, as in [`crate::ForbiddenSurfaces`].
    #[serde(default)]
    pub groups: Vec<String>,
    /// Indices of triangles, as in [`crate::ForbiddenSurfaces`].
    #[serde(default)]
    pub triangles: Vec<u32>,
    /// Shapes; with segments of tubes counted each, at most 64 in all regions of an object.
    #[serde(default)]
    pub shapes: Vec<RegionShape>,
}

impl Region {
    /// What some shapes mark of the surface.
    pub fn of_shapes(name: impl Into<String>, kind: RegionKind, shapes: Vec<RegionShape>) -> Self {
        Self {
            name: name.into(),
            kind,
            weight: None,
            groups: Vec::new(),
            triangles: Vec::new(),
            shapes,
        }
    }
}
