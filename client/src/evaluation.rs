//! Rating how well holdouts let an object be taken.

use std::time::Duration;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{hand::PresentingHand, json, search::FindRequest, standing::NoGraspReason};

/// A request to rate a holdout, or several.
///
/// In JSON, `other_presenting_hands` is optional.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluateRequest {
    /// The holdout. What only matters to searches is ignored, except the budget.
    pub holdout: FindRequest,
    /// Up to 64 further poses of the giver's hand, each in place of the holdout's. They are rated like it, and ranked with it.
    #[serde(default)]
    pub other_presenting_hands: Vec<PresentingHand>,
}

/// What keeps hands from an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InTheWay {
    /// The giver's hand or forearm.
    PresentingHand,
    /// Other hands.
    OtherHands,
    /// Obstacles.
    Obstacles,
    /// The receiver's arm is too short, or would bend too far.
    Reach,
    /// The object would slip, as its weight pulls in this pose.
    Gravity,
    /// The request's constraints.
    Constraints,
    /// Something unknown to this version of the library.
    Unrecognised,
}

/// How many of the known grasps are kept from the object by something.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hindrance {
    /// What it is: the first that a grasp fails by, in the order of the values.
    pub what: InTheWay,
    /// The share of the known grasps, from 0 to 1.
    pub share: f32,
}

/// A side of an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Side {
    /// The direction from which hands come, palm first: a unit vector in the client's frame.
    pub client_direction: Vec3,
    /// The same in the object's frame: one of the six directions of its axes.
    pub object_direction: Vec3,
    /// Number of known grasps from there.
    pub known: u32,
    /// Number of valid ones.
    pub valid: u32,
    /// The best score of the valid ones; 0 without any.
    pub best_score: f32,
}

/// How well a giver's hand lets the object be taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HoldoutRating {
    /// Its place: 0 for the holdout's hand, 1 for the first of [`EvaluateRequest::other_presenting_hands`], and so on.
    pub presenting_hand: u32,
    /// True if a valid grasp is known or was found.
    pub receivable: bool,
    /// Why not, otherwise.
    #[serde(default)]
    pub reason: Option<NoGraspReason>,
    /// Number of known grasps that were checked, of both hands if the request leaves the choice.
    pub known: u32,
    /// How many of them are valid.
    pub valid: u32,
    /// valid / known; 0 without known grasps.
    pub valid_share: f32,
    /// The best score of the valid ones, or of the one that was found; 0 without any.
    pub best_score: f32,
    /// The six sides.
    pub sides: Vec<Side>,
    /// What is in the way of the others; what hinders none is left out.
    pub hindrances: Vec<Hindrance>,
}

/// How well holdouts let an object be taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateAnswer {
    /// The ratings, in the order of the request.
    pub ratings: Vec<HoldoutRating>,
    /// The places of the ratings from the best on.
    pub ranking: Vec<u32>,
    /// The atlases' states, of the receiving hand, and of the other one if the request leaves the choice; empty without atlas.
    pub atlas_stamps: Vec<String>,
    /// Wall-clock time.
    #[serde(rename = "time_seconds", with = "json::seconds")]
    pub time: Duration,
    /// What the server repaired in the request.
    #[serde(default)]
    pub warnings: Vec<String>,
}
