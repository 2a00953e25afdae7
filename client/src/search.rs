//! Requests for grasps and their answers.

use std::time::Duration;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    constraints::Constraints,
    grasp_type::GraspType,
    hand::{Digit, DigitAngles, Handedness, JOINT_COUNT, JointPose, Phalanx, PresentingHand, ReceivingHand},
    json,
    key_frame::KeyFrame,
    obstacle::Obstacle,
    pose::Pose,
    query::{AtlasUse, BendRatios, Choice, Convention, Hands, Strategy, Validity},
    receiver::{Arm, Receiver, ReceiverStance},
    report::SearchReport,
    rig::PosedModel,
    score::Score,
    standing::{StandingGrasp, StandingReport},
};

/// A holdout (an object, its pose, the giver's hand and what else is near), and how to search for a grasp.
///
/// In JSON, fields keep their names, except that `budget` is `budget_seconds` and `improvement` is `improvement_seconds`; all
/// but `object` are optional.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FindRequest {
    /// Name of the object held out: "objects/{object}".
    pub object: String,
    /// The object's frame in the client's frame.
    #[serde(default)]
    pub client_from_object: Pose,
    /// The giver's hand; none: nobody holds the object.
    #[serde(default)]
    pub presenting_hand: Option<PresentingHand>,
    /// The hand to pose.
    #[serde(default)]
    pub receiving_hand: ReceivingHand,
    /// Direction opposite to gravity, in the client's frame; any length but 0; none: the convention's up axis.
    #[serde(default)]
    pub up: Option<Vec3>,
    /// Time limit of the search; more than 0; none: the server's default.
    #[serde(default, rename = "budget_seconds", with = "json::optional_seconds")]
    pub budget: Option<Duration>,
    /// Largest number of attempts, of both hands together if the search chooses between them; more than 0; none: limited by the
    /// budget only.
    #[serde(default)]
    pub max_attempts: Option<u64>,
    /// Search strategy; none: the server's default.
    #[serde(default)]
    pub strategy: Option<Strategy>,
    /// Bend ratios to try; none: the strategy's own.
    #[serde(default)]
    pub bend_ratios: Option<BendRatios>,
    /// Checks to pass; none: the server's default.
    #[serde(default)]
    pub validity: Option<Validity>,
    /// Seed of all random streams; none: drawn by the server. Reported in either case.
    #[serde(default, with = "json::optional_seed")]
    pub seed: Option<u64>,
    /// Decide by the indices of the valid attempts: the answer does not depend on the number of workers.
    #[serde(default)]
    pub reproducible: bool,
    /// Replay: run only this attempt of the seed, without trying known grasps first. Requires [`ReceivingHand::handedness`] under
    /// [`Validity::Physical`]. An attempt that fails continues near grasps of the atlas: it repeats exactly with an atlas of the
    /// same stamp, or again without one.
    #[serde(default)]
    pub only_attempt: Option<u64>,
    /// Report the time spent in each step.
    #[serde(default)]
    pub record_step_times: bool,
    /// Axes, units and joint order of all poses in this request and its answer.
    #[serde(default)]
    pub convention: Convention,
    /// Coefficient of static friction for this request; none: the object's.
    #[serde(default)]
    pub friction: Option<f32>,
    /// Requirements on the grasp beyond validity.
    #[serde(default)]
    pub constraints: Constraints,
    /// Which valid grasp to return; none: the first.
    #[serde(default)]
    pub choice: Option<Choice>,
    /// Whether known grasps may be tried first; none: yes.
    #[serde(default)]
    pub atlas: Option<AtlasUse>,
    /// Plan the hand's motion to the grasp for animation: [`Grasp::key_frames`]. Takes 0.5 to 2 ms after the search,
    /// sometimes longer; counts neither toward the budget nor toward [`SearchReport::search_time`].
    #[serde(default)]
    pub plan_key_frames: bool,
    /// Up to 3 further hands to keep clear of: the giver's other hand, or the receiver's if it is already at the object. Score
    /// terms about the giver refer to `presenting_hand`. Only under [`Validity::Physical`].
    #[serde(default)]
    pub other_hands: Vec<PresentingHand>,
    /// Up to 64 obstacles to keep clear of. Only under [`Validity::Physical`].
    #[serde(default)]
    pub obstacles: Vec<Obstacle>,
    /// How many hands take the object; none: one.
    #[serde(default)]
    pub hands: Option<Hands>,
    /// The receiver's body; none: `receiver_stance` says where the receiver is expected. Only under [`Validity::Physical`] and
    /// [`Hands::One`].
    #[serde(default)]
    pub receiver: Option<Receiver>,
    /// Where a receiver without a body is expected to stand; none: facing the giver.
    #[serde(default)]
    pub receiver_stance: Option<ReceiverStance>,
    /// How much longer [`Choice::FirstValid`] searches after a valid grasp that a person would not choose; 0 switches it off; at
    /// most 1 s and the budget; none: the server's default.
    #[serde(default, rename = "improvement_seconds", with = "json::optional_seconds")]
    pub improvement: Option<Duration>,
    /// How many times as large as it was created the object is held out, from 0.25 to 4; none: 1. The first call for a size takes
    /// longer.
    #[serde(default)]
    pub object_scale: Option<f32>,
    /// The object's mass in this request, in kilograms; none: its own, times the cube of `object_scale`.
    #[serde(default)]
    pub object_mass_kg: Option<f32>,
    /// The grasp that the character holds on to, mostly [`Grasp::standing`] of the answer before: kept while it is valid, and
    /// otherwise followed by one near it; [`FindAnswer::standing`] says which. Requires [`Validity::Physical`],
    /// [`Strategy::Guided`] and [`Hands::One`]; cannot be combined with `only_attempt`.
    #[serde(default)]
    pub standing: Option<StandingGrasp>,
}

impl FindRequest {
    /// A request for an object at the client's origin that nobody holds, with the server's defaults.
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
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            hands: None,
            receiver: None,
            receiver_stance: None,
            improvement: None,
            object_scale: None,
            object_mass_kg: None,
            standing: None,
        }
    }

    /// The same request with another hand to keep clear of. The first one is the presenting hand.
    #[must_use]
    pub fn with_hand(mut self, hand: PresentingHand) -> Self {
        if self.presenting_hand.is_none() {
            self.presenting_hand = Some(hand);
        } else {
            self.other_hands.push(hand);
        }
        self
    }

    /// The same request with another obstacle.
    #[must_use]
    pub fn with_obstacle(mut self, obstacle: Obstacle) -> Self {
        self.obstacles.push(obstacle);
        self
    }
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// A valid grasp was found.
    Found,
    /// The budget or the attempts ran out first.
    BudgetExhausted,
    /// Nothing was searched for: the request's standing grasp is committed and not valid.
    Aborted,
}

/// A contact between the receiving hand and the object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Point on the surface, in the client's frame.
    pub client_position: Vec3,
    /// Outward unit normal of the surface, in the client's frame. At an edge or a corner, under [`Validity::Physical`]: the
    /// direction between the normals of the adjacent faces that points at the bone.
    pub client_normal: Vec3,
    /// The same point in the object's frame.
    pub object_position: Vec3,
    /// The same normal in the object's frame.
    pub object_normal: Vec3,
    /// The digit; none for the palm.
    pub digit: Option<Digit>,
    /// The digit's link; none for the palm.
    pub phalanx: Option<Phalanx>,
    /// Index of the triangle in the object's mesh.
    pub triangle: u32,
    /// Force that the hand applies to the object, in newtons, in the client's frame.
    pub client_force: Vec3,
    /// The same force in the object's frame.
    pub object_force: Vec3,
    /// Torsional moment of the soft fingertip about the surface's inward normal, in newton metres; 0 under
    /// [`Validity::Thesis`].
    pub torsion: f32,
}

/// Margins by which a grasp passes the checks of [`Validity::Physical`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhysicalMargins {
    /// Unbalanced wrench as a fraction of the weight, with torques divided by half the diagonal of the object's box.
    pub residual: f32,
    /// Ferrari-Canny epsilon of the contacts as soft fingers, with torques divided by the same length.
    pub epsilon: f32,
    /// Deepest penetration of the hand into the object, in metres.
    pub penetration: f32,
    /// Smallest distance of the receiver's hand and forearm from the request's hands, in metres; none without any.
    pub giver_clearance: Option<f32>,
    /// Smallest distance of the receiver's hand and forearm from the obstacles, in metres; none without any.
    #[serde(default)]
    pub obstacle_clearance: Option<f32>,
}

/// A pose of the receiving hand that holds the object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grasp {
    /// Name of the rig.
    pub rig: String,
    /// Left or right.
    pub handedness: Handedness,
    /// The wrist's joint frame in the client's frame.
    pub client_from_wrist: Pose,
    /// The wrist's joint frame in the object's frame.
    pub object_from_wrist: Pose,
    /// The digits, thumb first; zero for one that the rig does not have.
    pub digits: [DigitAngles; 5],
    /// The joints of `XR_EXT_hand_tracking`, in the convention's order, in the client's frame; [`JointPose::MISSING`] for those of
    /// a digit that the rig does not have.
    pub joints: [JointPose; JOINT_COUNT],
    /// Contacts with the object: thumb first, palm last.
    pub contacts: Vec<Contact>,
    /// Comfort E (Eq. 4.6): squared distance of the digits' force shares from the comfortable ones; 0 is best.
    pub comfort: f32,
    /// Angle between the sum of the contact wrenches and the wrench that opposes gravity (Eq. 4.5), in radians.
    pub wrench_angle: f32,
    /// Margins of the physical checks; none under [`Validity::Thesis`].
    pub margins: Option<PhysicalMargins>,
    /// Type in the GRASP taxonomy; none if the grasp matches none, or one unknown to this version of the library.
    #[serde(rename = "type")]
    pub grasp_type: Option<GraspType>,
    /// Confidence of the type, from 0 to 1.
    pub type_confidence: f32,
    /// Quality of the grasp; none if it was not rated.
    #[serde(default)]
    pub score: Option<Score>,
    /// The motion to the grasp, in order, if [`FindRequest::plan_key_frames`] is set; empty under [`Validity::Thesis`], and
    /// if no straight approach is free of collisions and within the constraints.
    #[serde(default)]
    pub key_frames: Vec<KeyFrame>,
    /// True if the object hangs in hooked fingers by its weight. Closure was not required, and the forces are those of the
    /// object at rest, after it has swung until its centre of mass is below the fingers.
    #[serde(default)]
    pub hangs: bool,
    /// The receiver's arm, if [`FindRequest::receiver`] is set, or if a receiver is expected to face the giver and the arm reaches
    /// from there; none under [`Validity::Thesis`].
    #[serde(default)]
    pub arm: Option<Arm>,
    /// The model of the rig; none if the rig's hand has none.
    #[serde(default)]
    pub model: Option<PosedModel>,
}

/// The answer to a holdout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FindAnswer {
    /// How the search ended.
    pub outcome: Outcome,
    /// The grasp; present exactly if the outcome is [`Outcome::Found`].
    pub grasp: Option<Grasp>,
    /// With [`Hands::Both`], the receiver's other hand of the same rig, if a grasp was found. The forces of both hands
    /// together balance the weight; residual, epsilon and wrench angle of either are those of both together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_grasp: Option<Grasp>,
    /// Report of the search.
    pub report: SearchReport,
    /// What became of [`FindRequest::standing`]; present exactly if the request has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standing: Option<StandingReport>,
}
