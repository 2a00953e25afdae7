//! Checking a grasp of the client's own.

use std::time::Duration;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    hand::{Digit, HandAngles, HandAtObject, HandJoints},
    json,
    search::{FindRequest, Grasp},
    standing::HandWay,
};

/// A grasp to check. In JSON: `{"hand": {…}}`, `{"angles": {…}}` or `{"joints": {…}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GraspToValidate {
    /// A hand of a rig in the object's frame, as an answer or an artist's tool gives it.
    Hand(HandAtObject),
    /// A hand of a rig in the client's frame.
    Angles(HandAngles),
    /// Tracked joints. The rig of [`FindRequest::receiving_hand`] is posed like them, as closely as its limits allow.
    Joints(HandJoints),
}

impl GraspToValidate {
    /// A grasp of an answer, of a rig at its own size.
    pub fn of_grasp(grasp: &Grasp) -> Self {
        Self::Hand(HandAtObject {
            rig: grasp.rig.clone(),
            handedness: grasp.handedness,
            hand_scale: None,
            object_from_wrist: grasp.object_from_wrist,
            digits: grasp.digits,
        })
    }
}

/// A request to check a grasp.
///
/// In JSON, `find_nearest` is optional.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValidateRequest {
    /// The holdout, and what is required of a grasp. What only matters to searches is ignored.
    pub holdout: FindRequest,
    /// The grasp.
    pub grasp: GraspToValidate,
    /// Also search for a valid grasp near it, within the holdout's budget, if it is not valid.
    #[serde(default)]
    pub find_nearest: bool,
}

/// A check that a valid grasp passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// Each angle is within the rig's limits. Figure: the largest excess, in radians.
    JointLimits,
    /// No part of the hand is deeper in the object than flesh yields. Figure: the largest depth, in metres.
    Penetration,
    /// The hand and forearm are clear of the givers' hands. Figure: the least distance, in metres.
    GiverClearance,
    /// The hand and forearm are clear of the obstacles. Figure: the least distance, in metres.
    ObstacleClearance,
    /// No part of the hand goes through another. Figure: the least distance, in metres.
    SelfCollision,
    /// Digits or palm touch the object. Figure: the number of contacts.
    Contacts,
    /// The hand keeps off forbidden surfaces. Figure: the least distance, in metres.
    Forbidden,
    /// The contacts hold the object against pushes from all sides. Figure: epsilon.
    Closure,
    /// The contacts carry the weight. Figure: the unbalanced share of the weight.
    Balance,
    /// The receiver's arm reaches the wrist. Figure: how much farther it would have to reach, in metres.
    Reach,
    /// The request's constraints are met.
    Constraints,
    /// It is not near a banned grip of the object.
    Banned,
    /// A check unknown to this version of the library.
    Unrecognised,
}

/// The result of one check.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The check.
    pub check: Check,
    /// True if the grasp passes it.
    pub passed: bool,
    /// The figure; its unit depends on the check. None if there is nothing to measure.
    pub figure: Option<f32>,
    /// The bound: the least or the largest figure that passes.
    pub bound: Option<f32>,
    /// Where the figure is measured, in the client's frame; none for checks of the whole hand.
    pub client_position: Option<Vec3>,
    /// The digit that the figure is of; none for palm and forearm.
    pub digit: Option<Digit>,
    /// The other part of the hand, or the place of the hand or obstacle in the request, such as `other_hands[0]`; none if the figure
    /// is measured against the object.
    pub other: Option<String>,
    /// All of it in words.
    pub description: String,
}

/// What is right and wrong with a grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidateAnswer {
    /// True if every check is passed.
    pub valid: bool,
    /// The verdicts, one per check.
    pub verdicts: Vec<Verdict>,
    /// The grasp as the server sees it. Its score is none unless it is valid.
    pub grasp: Grasp,
    /// How far the rig's joints are from the tracked ones at most; none unless the grasp was given by joints. Metres, or
    /// centimetres in the Unreal convention.
    #[serde(default)]
    pub farthest_joint: Option<f32>,
    /// The nearest valid grasp that was found, if [`ValidateRequest::find_nearest`] is set and the grasp is not valid.
    #[serde(default)]
    pub nearest: Option<Grasp>,
    /// The way to it.
    #[serde(default)]
    pub way_to_nearest: Option<HandWay>,
    /// What the server repaired in the request.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Wall-clock time of the checks, without the search.
    #[serde(rename = "check_time_seconds", with = "json::seconds")]
    pub check_time: Duration,
}
