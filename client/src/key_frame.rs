//! The motion to a grasp.

use serde::{Deserialize, Serialize};

use crate::{
    hand::{DigitAngles, JOINT_COUNT, JointPose},
    pose::Pose,
    rig::PosedModel,
};

/// A stage of the motion to a grasp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KeyFrameKind {
    /// The open hand, drawn back from the object.
    Approach,
    /// The open hand, at the object.
    PreGrasp,
    /// The closed hand: the grasp itself.
    Close,
    /// A stage unknown to this version of the library.
    Unrecognised,
}

/// The receiving hand at one stage of the motion to a grasp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyFrame {
    /// The stage.
    pub kind: KeyFrameKind,
    /// The wrist's joint frame in the client's frame.
    pub client_from_wrist: Pose,
    /// The digits, thumb first; zero for one that the rig does not have.
    pub digits: [DigitAngles; 5],
    /// The joints of `XR_EXT_hand_tracking`, in the convention's order, in the client's frame; [`JointPose::MISSING`] for those of
    /// a digit that the rig does not have.
    pub joints: [JointPose; JOINT_COUNT],
    /// The model of the rig; none if the rig's hand has none.
    #[serde(default)]
    pub model: Option<PosedModel>,
}
