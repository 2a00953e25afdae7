//! Rigs of hands.

use std::collections::BTreeMap;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    hand::{Digit, HandJoints, Handedness, JOINT_COUNT, JointPose},
    pose::Pose,
};

/// A closed range of angles, in radians.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngleRange {
    /// Smallest angle.
    pub min: f32,
    /// Largest angle.
    pub max: f32,
}

/// The limits of a digit's joints; see [`DigitAngles`](crate::DigitAngles).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DigitLimits {
    /// Of the base joint's yaw.
    pub base_yaw: AngleRange,
    /// Of the base joint's pitch.
    pub base_pitch: AngleRange,
    /// Of the second joint's pitch.
    pub second_pitch: AngleRange,
    /// Of the third joint's pitch.
    pub third_pitch: AngleRange,
}

/// A node of a model that is a joint of a hand.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigNode {
    /// The node's name.
    pub node: String,
    /// The joint's name in `WebXR`, such as "index-finger-phalanx-proximal".
    pub joint: String,
    /// The hand; none in a request: [`NewRig::handedness`], or what the node's name says.
    #[serde(default)]
    pub handedness: Option<Handedness>,
}

/// One hand of a rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigHand {
    /// Left or right.
    pub handedness: Handedness,
    /// The digits that the hand has, thumb first.
    pub digits: Vec<Digit>,
    /// The stretched hand: the 26 `OpenXR` joints in the wrist's frame, in `OpenXR` axes and metres; without radius if the hand
    /// does not have the joint's digit.
    pub stretched_joints: [JointPose; JOINT_COUNT],
    /// The limits of the digits, thumb first; none for one that the hand does not have.
    pub limits: [Option<DigitLimits>; 5],
    /// True if the hand is the mirror image of the other one.
    pub mirrored: bool,
    /// The model's node that all other joints are below; empty without a model and for a mirrored hand.
    pub root_node: String,
    /// The nodes below it that are joints.
    pub nodes: Vec<RigNode>,
}

/// A rig: bones, widths and limits of a left and a right hand.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// "rigs/{rig}".
    pub name: String,
    /// True for the rigs that ship with the server.
    pub built_in: bool,
    /// The left hand, then the right hand.
    pub hands: [RigHand; 2],
    /// What was repaired, what was taken from the rig "adult", and what is odd about bones and skin.
    pub warnings: Vec<String>,
}

/// What a new rig is made from.
#[derive(Clone, Debug, PartialEq)]
pub enum RigSource {
    /// The content of a GLB, glTF or VRM file with a skinned hand or a whole character.
    Model(Vec<u8>),
    /// Joints at rest of one or both hands, in metres and `OpenXR` axes; those of missing fingers are [`JointPose::MISSING`].
    Joints(Vec<HandJoints>),
}

/// A rig to create.
#[derive(Clone, Debug, PartialEq)]
pub struct NewRig {
    /// Last part of the name: 1 to 63 of a-z, 0-9 and -, starting with a letter.
    pub id: String,
    /// What it is made from.
    pub source: RigSource,
    /// Nodes of the model whose joints their names do not say, or say wrongly.
    pub joint_map: Vec<RigNode>,
    /// The limits of the digits, thumb first; none: those of the rig "adult".
    pub limits: Option<[DigitLimits; 5]>,
    /// The hand that a model shows if its names do not say.
    pub handedness: Option<Handedness>,
    /// The model of the other hand, if each hand has a file.
    pub other_model: Option<Vec<u8>>,
    /// What measured widths are multiplied by.
    pub width_scale: Option<f32>,
    /// Radii in metres that go before measured ones, by the joint's name in `WebXR` or "palm".
    pub radii: BTreeMap<String, f32>,
}

impl NewRig {
    /// A rig of the hands of a model.
    pub fn of_model(id: impl Into<String>, model: Vec<u8>) -> Self {
        Self {
            id: id.into(),
            source: RigSource::Model(model),
            joint_map: Vec::new(),
            limits: None,
            handedness: None,
            other_model: None,
            width_scale: None,
            radii: BTreeMap::new(),
        }
    }
}

/// A node of a model in its parent, in the axes and units of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodePose {
    /// The node's name.
    pub node: String,
    /// Its rotation, instead of that in the file.
    pub rotation: Quat,
    /// Its translation, instead of that in the file; none: the file's.
    pub translation: Option<Vec3>,
}

/// The pose of the model that a rig was created from: it moves the model's skin to where the rig's hand is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PosedModel {
    /// The root node of the hand.
    pub root_node: String,
    /// Its frame in the client's frame.
    pub client_from_root: Pose,
    /// The factor by which its scale in the file has to be multiplied: the request's `hand_scale`.
    pub scale: f32,
    /// The hand's other nodes; those that are not listed keep what the file has.
    pub nodes: Vec<NodePose>,
}
