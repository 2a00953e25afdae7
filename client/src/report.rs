//! What a search reports.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::{
    hand::Handedness,
    json,
    pose::Pose,
    query::{Strategy, Validity},
    standing::Fall,
};

/// Why an attempt failed. The names are those of Table 5.2, except `UnmetConstraint`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rejection {
    /// No digit has a contact.
    NoContacts,
    /// The thumb has no contact.
    NoThumb,
    /// The thumb has no contact, and the fingers were not tried.
    NoThumbEarlyStop,
    /// No finger has a contact.
    NoFingers,
    /// The palm or the forearm collides with the object, another hand or an obstacle.
    PalmCollision,
    /// A finger collides with the object, another hand or an obstacle.
    FingerCollision,
    /// A contact lies on a forbidden surface.
    UnwantedContact,
    /// No force distribution opposes gravity.
    NotImmobilizing,
    /// The wrist, the contacts or the grasp violate the request's constraints, the receiver's arm does not reach the wrist, or
    /// two hands do not suit one body.
    UnmetConstraint,
    /// A kind unknown to this version of the library.
    Unrecognised,
}

/// Number of rejections of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectionCount {
    /// The kind.
    pub rejection: Rejection,
    /// Number of attempts that it ended.
    pub count: u64,
}

/// A step of Algorithm 1 of the thesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Step 1: place the wrist.
    WristPlacement,
    /// Step 2: close the fingers.
    FingerPosing,
    /// Step 3: check for collisions.
    CollisionValidation,
    /// Step 4: check the contacts.
    ContactValidation,
    /// Step 5: check that the hand holds the object.
    ImmobilityValidation,
    /// A step unknown to this version of the library.
    Unrecognised,
}

/// Time spent in one step, summed over all workers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepTime {
    /// The step.
    pub step: Step,
    /// The time.
    #[serde(rename = "time_seconds", with = "json::seconds")]
    pub time: Duration,
}

/// The failed attempt that came closest to a valid grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NearestMiss {
    /// Why it failed.
    pub rejection: Rejection,
    /// Index of the attempt; replay it with [`FindRequest::only_attempt`](crate::FindRequest::only_attempt).
    pub attempt: u64,
    /// Smallest wrench angle reached, in radians; for [`Rejection::NotImmobilizing`].
    pub wrench_angle: Option<f32>,
    /// The wrist's joint frame in the client's frame.
    pub client_from_wrist: Pose,
    /// The hand of the attempt; none from servers that do not say.
    #[serde(default)]
    pub handedness: Option<Handedness>,
}

/// Origin of a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GraspSource {
    /// This request's search.
    Search,
    /// The object's atlas.
    Atlas,
    /// A preferred grip of the object.
    Preferred,
    /// The request's standing grasp, as it is or with fingers moved out of the way.
    Standing,
    /// A grip that the search of an earlier call found, because the object's atlas had none for its holdout.
    Learned,
}

/// What can keep one hand from holding an object, whatever its pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitKind {
    /// The object's mass in kilograms, against the largest that all contacts of a hand carry.
    Mass,
    /// The weight's torque about the nearest place that may be held, in newton metres, against the largest that all
    /// contacts of a hand resist there.
    Torque,
    /// The distance in metres between the closest two places that can be pressed against each other, against what the hand
    /// closes around.
    Width,
    /// The share of the surface's area that is forbidden, from 0 to 1: the rest has no two places that one hand can press
    /// against each other.
    Forbidden,
    /// The room in metres that the giver leaves above the freest place that may be held, against the room that the
    /// thinnest finger needs.
    Giver,
    /// The distance in metres from the receiver's shoulder to the nearest place that may be held, against what arm and
    /// hand reach.
    Reach,
    /// The share of the grips that would hold the object which obstacles are in the way of; a longer search may still find another.
    Obstacle,
    /// A kind unknown to this version of the library.
    Unrecognised,
}

/// A condition that every valid grasp meets and that a holdout does not allow.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limit {
    /// What it is.
    pub kind: LimitKind,
    /// The holdout's figure, in the unit of the kind.
    pub value: f32,
    /// The bound that the figure exceeds (falls short of, for [`LimitKind::Giver`]), in the same unit; none for
    /// [`LimitKind::Forbidden`] and [`LimitKind::Obstacle`], and where known grips are all that a limit is judged by.
    pub bound: Option<f32>,
    /// Both in words, to complete "limited by".
    pub description: String,
}

/// A preferred grip that was not answered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassedOverGrip {
    /// Its name.
    pub name: String,
    /// The first check that it fails, with its fingers on the object.
    pub fall: Fall,
}

/// Report of a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchReport {
    /// Attempts run, counted as in the thesis: wrist placements that were accepted.
    pub attempts: u64,
    /// Wrist placements pruned by the placement measures.
    pub pruned_placements: u64,
    /// Rejections by kind; kinds that did not occur are left out.
    pub rejections: Vec<RejectionCount>,
    /// Time per step, if [`FindRequest::record_step_times`](crate::FindRequest::record_step_times) is set.
    pub step_times: Vec<StepTime>,
    /// Seed of the search; a string in JSON.
    #[serde(with = "json::seed")]
    pub seed: u64,
    /// Index of the attempt that found the grasp; none for known grasps and without a grasp.
    pub attempt: Option<u64>,
    /// Wall-clock time of the search.
    #[serde(rename = "search_time_seconds", with = "json::seconds")]
    pub search_time: Duration,
    /// Budget in force, after the server's maximum and the call's deadline.
    #[serde(rename = "budget_seconds", with = "json::seconds")]
    pub budget: Duration,
    /// Number of workers.
    pub workers: u32,
    /// The failed attempt that came closest; none if a grasp was found or nothing was attempted.
    pub nearest_miss: Option<NearestMiss>,
    /// Strategy used; none if unknown to this version of the library.
    pub strategy: Option<Strategy>,
    /// Checks used; none if unknown to this version of the library.
    pub validity: Option<Validity>,
    /// Number of valid grasps ranked; 0 with [`Choice::FirstValid`](crate::Choice::FirstValid).
    #[serde(default)]
    pub candidates: u64,
    /// Origin of the grasp; none without one, or if unknown to this version of the library.
    #[serde(default)]
    pub source: Option<GraspSource>,
    /// Number of atlas entries available to the hand of the grasp or, without one, of the nearest miss.
    #[serde(default)]
    pub atlas_entries: u32,
    /// Identifies the state of that hand's atlas, in hexadecimal; none if none was used.
    #[serde(default)]
    pub atlas_stamp: Option<String>,
    /// If the search chose between both hands: the stamp of the other hand's atlas; none if none was used.
    #[serde(default)]
    pub other_atlas_stamp: Option<String>,
    /// Identifies the grips of that hand that were learned from the searches of earlier calls, in hexadecimal; none if there were none.
    #[serde(default)]
    pub learned_stamp: Option<String>,
    /// If the search chose between both hands: the same of the other hand.
    #[serde(default)]
    pub other_learned_stamp: Option<String>,
    /// Name of the object's preferred grip that the grasp is; none if it is none.
    #[serde(default)]
    pub preferred_grip: Option<String>,
    /// The object's preferred grips that were tried and not answered.
    #[serde(default)]
    pub passed_over: Vec<PassedOverGrip>,
    /// What the server repaired in the request, such as radii of the giver's joints that were 0.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Why one hand cannot hold the object, if no grasp was found under [`Validity::Physical`]: more time would not help.
    /// Empty if a longer search may find a grasp, as far as these checks show.
    #[serde(default)]
    pub limits: Vec<Limit>,
}
