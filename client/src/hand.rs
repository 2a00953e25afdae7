//! Hands: the giver's, as it goes to the server, and the parts of the receiver's, as it comes back.

use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// Number of joints of `XR_EXT_hand_tracking`.
pub const JOINT_COUNT: usize = 26;

/// Which hand of a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Handedness {
    /// The left hand.
    Left,
    /// The right hand.
    Right,
}

/// A digit of the hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Digit {
    /// The thumb.
    Thumb,
    /// The index finger.
    Index,
    /// The middle finger.
    Middle,
    /// The ring finger.
    Ring,
    /// The little finger.
    Little,
}

/// A link of a digit's chain, counted from the wrist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phalanx {
    /// The proximal phalanx of a finger, the metacarpal of the thumb.
    First,
    /// The intermediate phalanx of a finger, the proximal phalanx of the thumb.
    Second,
    /// The distal phalanx.
    Third,
}

/// The joint angles of one digit, in radians. Positive pitch bends toward the palm; positive yaw turns a finger
/// toward the little finger's side and lifts the thumb off the palm's plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DigitAngles {
    /// Sideways rotation of the base joint.
    pub base_yaw: f32,
    /// Bend of the base joint (MCP of a finger, CMC of the thumb).
    pub base_pitch: f32,
    /// Bend of the second joint (PIP of a finger, MCP of the thumb).
    pub second_pitch: f32,
    /// Bend of the third joint (DIP of a finger, IP of the thumb); none: two thirds of `second_pitch`.
    pub third_pitch: Option<f32>,
}

/// One joint of a hand in the axes of the request's convention.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointPose {
    /// The joint's frame in the client's frame.
    pub client_from_joint: Pose,
    /// Distance from the joint to the skin, more than 0: metres, or centimetres in the Unreal convention.
    pub radius: f32,
}

/// The order in which joint poses are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum JointSet {
    /// The 26 joints of `XR_EXT_hand_tracking`, palm first, in the convention's own order.
    #[serde(rename = "openxr_26")]
    OpenXr26,
    /// The 25 joints of the `WebXR` hand input module: wrist first, no palm.
    #[serde(rename = "webxr_25")]
    WebXr25,
}

/// A hand given by the joint angles of a built-in rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandAngles {
    /// Name of the rig: "thesis" or "adult".
    pub rig: String,
    /// Which hand.
    pub handedness: Handedness,
    /// The wrist's `OpenXR` joint frame in the client's frame: -Z to the fingertips, +Y out of the back of the hand.
    #[serde(default)]
    pub client_from_wrist: Pose,
    /// The digits, thumb first; each angle within the rig's limits.
    pub digits: [DigitAngles; 5],
}

/// A hand given by the joint poses that a headset tracks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandJoints {
    /// Which hand.
    pub handedness: Handedness,
    /// The order of the joints.
    pub joint_set: JointSet,
    /// The joints: as many as the set has.
    pub joints: Vec<JointPose>,
}

/// The giver's hand. As JSON: `{"angles": {…}}` or `{"joints": {…}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PresentingHand {
    /// Joint angles of a built-in rig.
    Angles(HandAngles),
    /// Joint poses with radii.
    Joints(HandJoints),
}

/// The hand that is to be posed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReceivingHand {
    /// Name of the rig; none: the server's default.
    pub rig: Option<String>,
    /// Which hand; none: the right one.
    pub handedness: Option<Handedness>,
}
