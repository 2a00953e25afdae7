//! Requirements on a grasp beyond validity.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{grasp_type::GraspType, hand::Digit};

/// Requirements on a grasp beyond validity. All that are set must be met; the default has none.
///
/// In JSON, fields keep their names and all are optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Constraints {
    /// Range of the receiver's arm; none: unlimited.
    pub receiver_reach: Option<Reach>,
    /// Directions of approach; none: all.
    pub approach: Option<ApproachCone>,
    /// The only types allowed, as in [`Grasp::grasp_type`](crate::Grasp::grasp_type); empty: all types, and grasps that
    /// match none. To exclude those, list all types.
    pub allowed_grasp_types: Vec<GraspType>,
    /// Types not allowed; may contain no allowed type, and not all types. Does not exclude grasps that match no type.
    pub excluded_grasp_types: Vec<GraspType>,
    /// Digits that must all touch the object.
    pub must_touch: Vec<Digit>,
    /// Digits that must not touch the object.
    pub must_not_touch: Vec<Digit>,
    /// Largest comfort E (Eq. 4.6); at least 0, where 0 is best; none: unlimited.
    pub max_comfort_e: Option<f32>,
}

/// The range of the receiver's arm: the wrist must lie within a sphere around the shoulder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reach {
    /// The receiver's shoulder, in the client's frame.
    pub client_shoulder: Vec3,
    /// Largest distance from shoulder to wrist; more than 0; in the convention's unit of length.
    pub reach: f32,
}

/// The directions from which the hand may approach.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApproachCone {
    /// The axis of the cone: the direction in which the hand moves toward the object, in the client's frame; any length
    /// but 0. A hand's direction of approach lies halfway between its stretched fingers and its palm's normal.
    pub client_direction: Vec3,
    /// Largest angle between the axis and the hand's direction of approach, in radians; more than 0, at most π.
    pub half_angle: f32,
}
