//! What a request demands of its grasp.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{grasp_type::GraspType, hand::Digit};

/// What is demanded of a grasp beyond that it is valid; the default demands nothing. All that is given must hold.
///
/// As JSON the fields keep their names, and all may be left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Constraints {
    /// Where the receiver's arm gets; none: everywhere.
    pub receiver_reach: Option<Reach>,
    /// From where the hand may come; none: from everywhere.
    pub approach: Option<ApproachCone>,
    /// The only types of grasps that will do, as [`Grasp::grasp_type`](crate::Grasp::grasp_type) tells them; empty: any,
    /// and also grasps that are like no type. To be without those, name all.
    pub allowed_grasp_types: Vec<GraspType>,
    /// Types of grasps that will not do; none of those that are allowed, and not all that there are. Grasps that are like
    /// no type are not excluded by it.
    pub excluded_grasp_types: Vec<GraspType>,
    /// Digits of which each must touch the object.
    pub must_touch: Vec<Digit>,
    /// Digits of which none may touch the object.
    pub must_not_touch: Vec<Digit>,
    /// The largest comfort E (Eq. 4.6) of a grasp, from 0 up, of which 0 is best; none: any.
    pub max_comfort_e: Option<f32>,
}

/// Where the receiver's arm gets: the wrist lies within a sphere around the shoulder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reach {
    /// The receiver's shoulder, in the client's frame.
    pub client_shoulder: Vec3,
    /// The greatest distance from the shoulder to the wrist, more than 0, in the convention's unit of length.
    pub reach: f32,
}

/// The directions from which the hand may come.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApproachCone {
    /// The direction in which the hand moves toward the object, in the client's frame; any length but 0. The hand's own
    /// direction of approach is halfway between its stretched fingers and out of its palm.
    pub client_direction: Vec3,
    /// The largest angle between the two, in radians, more than 0, at most π.
    pub half_angle: f32,
}
