//! Hands: the giver's in requests, and the parts of the receiver's in answers.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::pose::Pose;

/// Number of joints in `XR_EXT_hand_tracking`.
pub const JOINT_COUNT: usize = 26;

/// A left or a right hand.
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

/// Joint angles of one digit, in radians. Positive pitch bends toward the palm. Positive yaw turns a finger toward the
/// little finger's side and lifts the thumb out of the palm's plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DigitAngles {
    /// Yaw of the base joint.
    pub base_yaw: f32,
    /// Pitch of the base joint (a finger's MCP, the thumb's CMC).
    pub base_pitch: f32,
    /// Pitch of the second joint (a finger's PIP, the thumb's MCP).
    pub second_pitch: f32,
    /// Pitch of the third joint (a finger's DIP, the thumb's IP); none: two thirds of `second_pitch`.
    pub third_pitch: Option<f32>,
}

/// One joint of a hand, in the axes of the request's convention.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointPose {
    /// The joint's frame in the client's frame.
    pub client_from_joint: Pose,
    /// Distance from the joint to the skin. Metres, or centimetres in the Unreal convention. 0 in a request: unknown; the
    /// server derives it and warns in [`SearchReport::warnings`](crate::SearchReport::warnings).
    #[serde(default)]
    pub radius: f32,
}

impl JointPose {
    /// A joint of a finger that the hand does not have.
    pub const MISSING: Self = Self {
        client_from_joint: Pose::IDENTITY,
        radius: 0.0,
    };
}

/// Number and order of joint poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum JointSet {
    /// The 26 joints of `XR_EXT_hand_tracking`, in the order of the request's convention.
    #[serde(rename = "openxr_26")]
    OpenXr26,
    /// The 25 joints of `WebXR` Hand Input: wrist first, no palm.
    #[serde(rename = "webxr_25")]
    WebXr25,
}

/// A hand as joint angles of a rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandAngles {
    /// Name of the rig: "thesis", "adult", or that of a created one, "rigs/{rig}".
    pub rig: String,
    /// Left or right.
    pub handedness: Handedness,
    /// The wrist's `OpenXR` joint frame in the client's frame: -Z toward the fingertips, +Y out of the back of the hand.
    #[serde(default)]
    pub client_from_wrist: Pose,
    /// The digits, thumb first. Each angle must be within the rig's limits.
    pub digits: [DigitAngles; 5],
    /// How many times as large as the rig the hand is, from 0.5 to 2; none: 1.
    #[serde(default)]
    pub hand_scale: Option<f32>,
}

/// A hand of a rig at an object, in the object's frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandAtObject {
    /// Name of the rig: "thesis", "adult", or that of a created one, "rigs/{rig}".
    pub rig: String,
    /// Left or right.
    pub handedness: Handedness,
    /// How many times as large as the rig the hand is, from 0.5 to 2, rounded to hundredths; none: 1.
    #[serde(default)]
    pub hand_scale: Option<f32>,
    /// The wrist's joint frame in the object's frame, as [`Grasp::object_from_wrist`](crate::Grasp::object_from_wrist).
    #[serde(default)]
    pub object_from_wrist: Pose,
    /// The digits, thumb first, as [`Grasp::digits`](crate::Grasp::digits).
    pub digits: [DigitAngles; 5],
}

/// A hand as joint poses tracked by a headset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandJoints {
    /// Left or right.
    pub handedness: Handedness,
    /// Number and order of the joints.
    pub joint_set: JointSet,
    /// The joints, as many as the set has.
    pub joints: Vec<JointPose>,
}

/// A hand as the mesh that a client draws. It may be open, as at the wrist: what it surrounds is inside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandMesh {
    /// The vertices in the client's frame, up to 6,000 of all hands of a request together.
    pub positions: Vec<Vec3>,
    /// The vertices of each triangle, counted from 0; up to 6,000 triangles of all hands of a request together.
    pub triangles: Vec<[u32; 3]>,
    /// The wrist's `OpenXR` joint frame in the client's frame; none: unknown, so that nothing is expected of where the receiver
    /// stands.
    #[serde(default)]
    pub client_from_wrist: Option<Pose>,
}

/// The giver's hand, or another one to keep clear of. In JSON: `{"angles": {…}}`, `{"joints": {…}}` or `{"mesh": {…}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PresentingHand {
    /// Joint angles of a rig.
    Angles(HandAngles),
    /// Tracked joint poses with radii.
    Joints(HandJoints),
    /// A mesh.
    Mesh(HandMesh),
}

/// The hand to pose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReceivingHand {
    /// Name of the rig: "thesis", "adult", or that of a created one, "rigs/{rig}"; none: the server's default.
    pub rig: Option<String>,
    /// Left or right; none: the better of both, as [`Grasp::handedness`](crate::Grasp::handedness) says. Then the right one under
    /// [`Validity::Thesis`](crate::Validity::Thesis).
    pub handedness: Option<Handedness>,
    /// How many times as large as the rig the hand is, from 0.5 to 2, rounded to hundredths; none: 1.
    pub hand_scale: Option<f32>,
}
