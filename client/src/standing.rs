//! The grasp that a character holds on to from one request to the next, and what became of it.

use serde::{Deserialize, Serialize};

use crate::{
    hand::{Digit, HandAtObject},
    search::Grasp,
};

/// A grasp to hold on to from one request to the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandingGrasp {
    /// The hand, of the same rig and size as the request's receiving hand.
    pub hand: HandAtObject,
    /// Where the receiver's hand is now, from where distances to other grasps are measured; none: at the standing grasp.
    #[serde(default)]
    pub present: Option<HandAtObject>,
    /// How much higher the score of another grasp must be to replace a valid standing one, from 0 to 1; none: a valid one is kept.
    #[serde(default)]
    pub better_by: Option<f32>,
    /// The hand is closing: the grasp is kept or adjusted, but never replaced.
    #[serde(default)]
    pub committed: bool,
}

impl StandingGrasp {
    /// A grasp to hold on to while it is valid.
    pub fn new(hand: HandAtObject) -> Self {
        Self {
            hand,
            present: None,
            better_by: None,
            committed: false,
        }
    }
}

impl Grasp {
    /// The grasp as one to hold on to in the next request with the same convention. The hand has its rig's own size: set
    /// [`HandAtObject::hand_scale`] if the request's receiving hand has another one.
    pub fn standing(&self) -> StandingGrasp {
        StandingGrasp::new(HandAtObject {
            rig: self.rig.clone(),
            handedness: self.handedness,
            hand_scale: None,
            object_from_wrist: self.object_from_wrist,
            digits: self.digits,
        })
    }
}

/// What became of a standing grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StandingStatus {
    /// It is valid, and the answer.
    Kept,
    /// It is valid with fingers moved out of the way that the grasp can do without.
    Adjusted,
    /// Another grasp is the answer.
    Replanned,
    /// There is no answer.
    None,
    /// A committed grasp is not valid, not even adjusted: the hand should withdraw.
    Aborted,
}

/// Why a grasp is not valid, or was not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FallReason {
    /// Hand or forearm are too close to another person's hand; figure: the distance in metres, negative inside.
    Giver,
    /// Hand or forearm are too close to an obstacle; figure: the distance in metres, negative inside.
    Obstacle,
    /// The hand sinks into the object; figure: the depth in metres.
    Penetration,
    /// The contacts do not hold the object; figure: the share of closure that they have, or of the weight that they leave
    /// unbalanced, as the description says.
    NotHeld,
    /// A forbidden surface is touched; figure: the distance in metres.
    Forbidden,
    /// The receiver's arm does not reach the wrist.
    OutOfReach,
    /// It violates the request's constraints, or is near a banned grip.
    Constraint,
    /// Parts of the hand go through each other; figure: the distance in metres, negative.
    SelfCollision,
    /// Another grasp is better; figure: the difference of the scores.
    BetterGrasp,
    /// A reason unknown to this version of the library.
    Unrecognised,
}

/// Why a grasp fell, with the figure that decided.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fall {
    /// Why.
    pub reason: FallReason,
    /// The figure, in the unit of its reason.
    pub figure: Option<f32>,
    /// The bound that the figure violates, in the same unit.
    pub bound: Option<f32>,
    /// Both in words, to complete "the grasp fell:".
    pub description: String,
}

/// Why there is no grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoGraspReason {
    /// A hand or an obstacle is in the way of most known grasps that would hold, or leaves no room.
    GiverInTheWay,
    /// One hand cannot hold the object.
    CannotBeHeld,
    /// The receiver's arm does not reach the known grasps, or the object.
    OutOfReach,
    /// None was found in time. A longer search may find one.
    NotFoundInTime,
    /// The frame of a track is wrong; the answer's warnings say where.
    WrongFrame,
    /// A reason unknown to this version of the library.
    Unrecognised,
}

/// How far a hand has to go.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandWay {
    /// Distance of the wrists, in metres (centimetres in the Unreal convention).
    pub distance: f32,
    /// Angle between them, in radians.
    pub angle: f32,
    /// Mean distance that the fingertips move in the wrist's frame, in the same unit as `distance`.
    pub fingertips: f32,
    /// True if the straight way is free of hands and obstacles and the hand does not pass through the object.
    pub free: bool,
}

/// What became of a standing grasp, and how far the answer is from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandingReport {
    /// What became of it.
    pub status: StandingStatus,
    /// Why it was not kept as it is, or is kept by [`TrackPolicy::grace`](crate::TrackPolicy::grace) only; none once nothing is in the way
    /// of an aborted one.
    #[serde(default)]
    pub fall: Option<Fall>,
    /// Why there is no grasp, with [`StandingStatus::None`].
    #[serde(default)]
    pub no_grasp: Option<NoGraspReason>,
    /// The digits that were moved, with [`StandingStatus::Adjusted`].
    #[serde(default)]
    pub moved_digits: Vec<Digit>,
    /// The way from the present hand to the answer; none without an answer, and with another handedness.
    #[serde(default)]
    pub way: Option<HandWay>,
    /// Where to withdraw to, with [`StandingStatus::Aborted`]: the open hand drawn back from the object.
    #[serde(default)]
    pub withdrawal: Option<HandAtObject>,
}
