//! The way to a grasp.

use serde::{Deserialize, Serialize};

use crate::{
    hand::{DigitAngles, JOINT_COUNT, JointPose},
    pose::Pose,
};

/// A stage on the way to a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KeyFrameKind {
    /// The hand is away from the object, on its way.
    Approach,
    /// The hand is around the object, open.
    PreGrasp,
    /// The hand has closed: the grasp itself.
    Close,
    /// A stage that this version of the library does not know.
    Unrecognised,
}

/// The receiving hand at a stage on the way to a grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyFrame {
    /// The stage.
    pub kind: KeyFrameKind,
    /// The wrist's joint frame in the client's frame.
    pub client_from_wrist: Pose,
    /// The digits, thumb first.
    pub digits: [DigitAngles; 5],
    /// The joints of `XR_EXT_hand_tracking` in the convention's order, in the client's frame.
    pub joints: [JointPose; JOINT_COUNT],
}
