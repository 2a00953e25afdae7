//! What is asked of a search and what it answers.

use std::time::Duration;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    constraints::Constraints,
    grasp_type::GraspType,
    hand::{Digit, DigitAngles, Handedness, JOINT_COUNT, JointPose, Phalanx, PresentingHand, ReceivingHand},
    json,
    key_frame::KeyFrame,
    pose::Pose,
    score::Score,
};

/// The axes, units and joint order that a client's engine uses. Numbers pass through this library unchanged; the
/// server converts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Convention {
    /// Right-handed, +Y up, metres; also Bevy's and `WebXR`'s.
    #[default]
    #[serde(rename = "openxr")]
    OpenXr,
    /// Left-handed, +Y up, +Z forward, metres; joint order of XR Hands (wrist first, then palm).
    Unity,
    /// Left-handed, +Z up, +X forward, centimetres; joint order of `EHandKeypoint`.
    Unreal,
    /// Right-handed, +Y up, metres; joint orientations of `XRHandTracker`.
    Godot,
}

/// What makes a grasp valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Validity {
    /// As the thesis prints it (chapters 4 and 5).
    Thesis,
    /// Hands are solid, and the contacts hold the object by forces within their friction cones and with closure.
    Physical,
}

/// How grasps are searched for: the ladder of the thesis' chapter 5, each step on top of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Strategy {
    /// Naive synthesis (5.2).
    A,
    /// Placement measures relative to the object (5.3).
    B,
    /// Palm-CoM-palm angle (5.3).
    C,
    /// Early stop when the thumb has no contact (5.4).
    D,
    /// One way of choosing the bend ratios (5.4, Figure 5.20).
    E,
    /// First sufficient force distribution (5.6).
    F,
    /// Beyond the thesis: samples where grasps are and orders the checks as it likes.
    Guided,
}

/// Which bend ratios a finger tries: the columns of Figure 5.20.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendRatios {
    /// (a) 0.7, 1 and 1.42 in turn.
    All,
    /// (b) As (a), but the fingers skip 0.7.
    AllFingersWithoutLow,
    /// (c) One of the three at random.
    OneRandom,
    /// (d) As (c), but the fingers skip 0.7.
    OneRandomFingersWithoutLow,
    /// (e) Only 1.
    OnlyOne,
    /// (f) Only 1.42.
    OnlyHigh,
}

/// Which of the valid grasps is the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Choice {
    /// The first that is found.
    FirstValid,
    /// The one of the highest score among all that are found until the budget ends. Where none is named and nothing is found
    /// in the 5 ms that it is then, the first that is found within the server's default budget.
    BestWithinBudget,
}

/// May the grasps that the server found for the object before, its atlas, be tried before others?
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AtlasUse {
    /// Yes, if there is an atlas.
    Allowed,
    /// No: the answer depends on the request alone.
    None,
}

/// A holdout and how to search for a grasp on it.
///
/// As JSON the fields keep their names, `budget` becomes `budget_seconds`, and all but `object` may be left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FindRequest {
    /// The object that is held out: "objects/{object}".
    pub object: String,
    /// The object's frame in the client's frame.
    #[serde(default)]
    pub client_from_object: Pose,
    /// The giver's hand; none: the object floats freely.
    #[serde(default)]
    pub presenting_hand: Option<PresentingHand>,
    /// The hand to pose.
    #[serde(default)]
    pub receiving_hand: ReceivingHand,
    /// Against gravity, in the client's frame, any length but 0; none: the convention's up axis.
    #[serde(default)]
    pub up: Option<Vec3>,
    /// How long to search, more than 0; none: the server's default.
    #[serde(default, rename = "budget_seconds", with = "json::optional_seconds")]
    pub budget: Option<Duration>,
    /// At most this many attempts, more than 0; none: as many as the budget allows.
    #[serde(default)]
    pub max_attempts: Option<u64>,
    /// How to search; none: the server's default.
    #[serde(default)]
    pub strategy: Option<Strategy>,
    /// Which bend ratios to try; none: what the strategy says.
    #[serde(default)]
    pub bend_ratios: Option<BendRatios>,
    /// What counts as valid; none: the server's default.
    #[serde(default)]
    pub validity: Option<Validity>,
    /// Start of every random stream; none: drawn by the server and told in the report.
    #[serde(default, with = "json::optional_seed")]
    pub seed: Option<u64>,
    /// Answer with the valid attempt of the lowest index, the same for any number of workers.
    #[serde(default)]
    pub reproducible: bool,
    /// Replay: run this attempt of the seed and no other, without trying the atlas' own grips. An attempt that fails by
    /// itself goes on beside those: with the atlas of the same stamp, or without one, it does the same again.
    #[serde(default)]
    pub only_attempt: Option<u64>,
    /// Record the time spent in each step.
    #[serde(default)]
    pub record_step_times: bool,
    /// Axes, units and joint order of all poses in this request and its answer.
    #[serde(default)]
    pub convention: Convention,
    /// Static friction coefficient for this request; none: the object's.
    #[serde(default)]
    pub friction: Option<f32>,
    /// What is demanded of the grasp beyond that it is valid.
    #[serde(default)]
    pub constraints: Constraints,
    /// Which of the valid grasps is wanted; none: the first.
    #[serde(default)]
    pub choice: Option<Choice>,
    /// May the object's atlas be used? None: yes.
    #[serde(default)]
    pub atlas: Option<AtlasUse>,
    /// Plan the way to the grasp, [`Grasp::key_frames`], for who animates the hand. That takes half a millisecond to two,
    /// sometimes some milliseconds, once the grasp is found; neither budget nor [`SearchReport::search_time`] count it.
    #[serde(default)]
    pub plan_key_frames: bool,
}

impl FindRequest {
    /// Asks for a grasp of an object that floats at the client's origin, with the server's defaults.
    pub fn new(object: impl Into<String>) -> Self {
        Self {
            object: object.into(),
            client_from_object: Pose::IDENTITY,
            presenting_hand: None,
            receiving_hand: ReceivingHand::default(),
            up: None,
            budget: None,
            max_attempts: None,
            strategy: None,
            bend_ratios: None,
            validity: None,
            seed: None,
            reproducible: false,
            only_attempt: None,
            record_step_times: false,
            convention: Convention::default(),
            friction: None,
            constraints: Constraints::default(),
            choice: None,
            atlas: None,
            plan_key_frames: false,
        }
    }
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// A valid grasp was found.
    Found,
    /// The budget or the number of attempts was spent first.
    BudgetExhausted,
}

/// Where the receiving hand touches the object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The point on the surface, in the client's frame.
    pub client_position: Vec3,
    /// The surface's outward unit normal there, in the client's frame; at an edge or a corner, under PHYSICAL validity,
    /// that of the directions between its faces' normals which points to the bone.
    pub client_normal: Vec3,
    /// The same point in the object's frame.
    pub object_position: Vec3,
    /// The same normal in the object's frame.
    pub object_normal: Vec3,
    /// The digit that touches; none for the palm.
    pub digit: Option<Digit>,
    /// The link of the digit that touches; none for the palm.
    pub phalanx: Option<Phalanx>,
    /// Index of the triangle in the object's mesh.
    pub triangle: u32,
    /// The force that the hand applies on the object here, in newtons, in the client's frame.
    pub client_force: Vec3,
    /// The same force in the object's frame, in newtons.
    pub object_force: Vec3,
    /// The torsion that the soft fingertip applies here about the surface's inward normal, in newton metres; 0 under
    /// [`Validity::Thesis`].
    pub torsion: f32,
}

/// By how much a grasp passes the checks of [`Validity::Physical`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhysicalMargins {
    /// The wrench that the forces leave unbalanced, torque over half the diagonal of the object's box, as a share of the
    /// weight.
    pub residual: f32,
    /// Ferrari-Canny epsilon of the contacts as soft fingers, torque over the same length.
    pub epsilon: f32,
    /// How deep the hand sinks into the object at its deepest, in metres.
    pub penetration: f32,
    /// Smallest distance between the receiving hand or forearm and the giver's, in metres; none without a giver.
    pub giver_clearance: Option<f32>,
}

/// A pose of the receiving hand that takes the object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grasp {
    /// Name of the rig.
    pub rig: String,
    /// Which hand.
    pub handedness: Handedness,
    /// The wrist's joint frame in the client's frame.
    pub client_from_wrist: Pose,
    /// The wrist's joint frame in the object's frame.
    pub object_from_wrist: Pose,
    /// The digits, thumb first.
    pub digits: [DigitAngles; 5],
    /// The joints of `XR_EXT_hand_tracking` in the convention's order, in the client's frame.
    pub joints: [JointPose; JOINT_COUNT],
    /// Where the hand touches the object, thumb first.
    pub contacts: Vec<Contact>,
    /// Comfort E of Eq. 4.6: squared distance of the digits' force shares from the comfortable ones; 0 is best.
    pub comfort: f32,
    /// Angle in radians between the sum of the contact wrenches and the wrench that opposes gravity (Eq. 4.5).
    pub wrench_angle: f32,
    /// Under [`Validity::Physical`]: by how much the checks are passed.
    pub margins: Option<PhysicalMargins>,
    /// What it is in the GRASP taxonomy; none if it is like none of its types, or like one that is not known here.
    #[serde(rename = "type")]
    pub grasp_type: Option<GraspType>,
    /// How sure the type is, from 0 to 1.
    pub type_confidence: f32,
    /// How good the grasp is; none if the server did not rate it.
    #[serde(default)]
    pub score: Option<Score>,
    /// The way to the grasp, in order, if [`FindRequest::plan_key_frames`] asks for it; empty under [`Validity::Thesis`],
    /// and if there is no straight way in that is free and along which the constraints let the hand approach.
    #[serde(default)]
    pub key_frames: Vec<KeyFrame>,
}

/// Why an attempt failed: the names of Table 5.2, and what the request demands beyond them.
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
    /// The palm collides with the object or the presenting hand.
    PalmCollision,
    /// A finger collides with the object or the presenting hand.
    FingerCollision,
    /// A contact lies on a forbidden surface.
    UnwantedContact,
    /// No force distribution opposes gravity.
    NotImmobilizing,
    /// The wrist, the contacts or the grasp are not what the request's constraints ask for.
    UnmetConstraint,
    /// A kind that this version of the library does not know.
    Unrecognised,
}

/// How often a kind of rejection occurred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectionCount {
    /// The kind.
    pub rejection: Rejection,
    /// How many attempts ended so.
    pub count: u64,
}

/// A step of Algorithm 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Step 1.
    WristPlacement,
    /// Step 2.
    FingerPosing,
    /// Step 3.
    CollisionValidation,
    /// Step 4.
    ContactValidation,
    /// Step 5.
    ImmobilityValidation,
    /// A step that this version of the library does not know.
    Unrecognised,
}

/// The time spent in a step, summed over all workers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepTime {
    /// The step.
    pub step: Step,
    /// The time.
    #[serde(rename = "time_seconds", with = "json::seconds")]
    pub time: Duration,
}

/// The failed attempt that came closest to a grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NearestMiss {
    /// Why it failed.
    pub rejection: Rejection,
    /// Its index; replay it with [`FindRequest::only_attempt`].
    pub attempt: u64,
    /// For [`Rejection::NotImmobilizing`]: the smallest wrench angle that was reached, in radians.
    pub wrench_angle: Option<f32>,
    /// The wrist's joint frame in the client's frame.
    pub client_from_wrist: Pose,
}

/// Where a grasp comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GraspSource {
    /// The request's own search.
    Search,
    /// The object's atlas.
    Atlas,
    /// An earlier request: what its search found, or which fingers it spared, also holds what is held out now.
    Recent,
}

/// What a search did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchReport {
    /// Attempts that were run: accepted placements, as the thesis counts.
    pub attempts: u64,
    /// Placements that were drawn and pruned by the placement measures.
    pub pruned_placements: u64,
    /// Every kind of rejection that occurred.
    pub rejections: Vec<RejectionCount>,
    /// Times by step, if they were asked for.
    pub step_times: Vec<StepTime>,
    /// The seed of the search; a string in JSON, since 64 bits do not fit into every reader's numbers.
    #[serde(with = "json::seed")]
    pub seed: u64,
    /// The index of the attempt that gave the grasp.
    pub attempt: Option<u64>,
    /// Wall time of the search.
    #[serde(rename = "search_time_seconds", with = "json::seconds")]
    pub search_time: Duration,
    /// The budget that was in force after the server's maximum and the call's deadline.
    #[serde(rename = "budget_seconds", with = "json::seconds")]
    pub budget: Duration,
    /// Workers that took part.
    pub workers: u32,
    /// The failed attempt that came closest; none when a grasp was found or nothing was attempted.
    pub nearest_miss: Option<NearestMiss>,
    /// The strategy that was used; none if this version of the library does not know it.
    pub strategy: Option<Strategy>,
    /// The notion of valid that was used; none if this version of the library does not know it.
    pub validity: Option<Validity>,
    /// Valid grasps that were ranked; 0 if the first was taken.
    #[serde(default)]
    pub candidates: u64,
    /// Where the grasp comes from; none without one, or if this version of the library does not know it.
    #[serde(default)]
    pub source: Option<GraspSource>,
    /// Entries of the object's atlas that were there to be tried.
    #[serde(default)]
    pub atlas_entries: u32,
    /// Which state of the atlas was used, hexadecimal; none if none was.
    #[serde(default)]
    pub atlas_stamp: Option<String>,
}

/// The answer to a holdout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FindAnswer {
    /// How the search ended.
    pub outcome: Outcome,
    /// The grasp; there is one exactly when the outcome is [`Outcome::Found`].
    pub grasp: Option<Grasp>,
    /// What the search did.
    pub report: SearchReport,
}
