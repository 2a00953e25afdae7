//! Checks a grasp that a client wants to be checked.

use grasp_proto::v1::{self, validate_grasp_request::Grasp};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{HandPose, fit::fitted, joints::HandJoints, rig::Rig},
};

use super::{
    digits::AngleBounds,
    posed::{Place, posed_hand},
    tracked::{Lacking, tracked_hand},
};
use crate::validate::{Violations, frames::Frames};

/// A grasp as it was given.
#[derive(Clone, Debug)]
pub(crate) enum GivenGrasp {
    /// A posed hand in the object's frame.
    AtObject(HandPose),
    /// Tracked joints in the client's frame, in `OpenXR` axes.
    Tracked(Box<HandJoints>),
}

impl GivenGrasp {
    /// The hand in the object's frame. A tracked one is posed with the rig.
    pub(crate) fn at_object(&self, rig: &Rig, client_from_object: Pose) -> HandPose {
        match self {
            Self::AtObject(pose) => *pose,
            Self::Tracked(joints) => {
                let pose = fitted(rig, joints);
                HandPose {
                    frame_from_wrist: client_from_object.inverse() * pose.frame_from_wrist,
                    ..pose
                }
            }
        }
    }
}

/// A checked grasp.
#[derive(Clone, Debug)]
pub(in crate::validate) struct Given {
    pub grasp: GivenGrasp,
    /// The hand that it is of.
    pub handedness: v1::Handedness,
    /// Its rig, and how many times as large it is. Tracked joints have none of their own.
    pub rig: Option<(String, Option<f32>)>,
    /// What was repaired.
    pub warnings: Vec<String>,
}

/// The grasp; none if it is wrong. Angles need not be within the limits of their rig.
pub(in crate::validate) fn given_grasp(
    sent: Option<Grasp>,
    frames: &Frames<'_>,
    violations: &Violations,
) -> Option<Given> {
    let before = violations.len();
    let given = match sent {
        None => violations
            .field("grasp")
            .reject("is absent; it must be pose or joints"),
        Some(Grasp::Pose(sent)) => {
            let field = violations.field("pose");
            let hand = posed_hand(field, &sent, Place::AtObject, AngleBounds::HalfTurn, frames)?;
            Some(Given {
                grasp: GivenGrasp::AtObject(hand.pose),
                handedness: sent.handedness(),
                rig: Some((sent.rig, sent.scale)),
                warnings: Vec::new(),
            })
        }
        Some(Grasp::Joints(joints)) => {
            let field = violations.field("joints");
            let hand = tracked_hand(field, &joints, frames.convention, Lacking::Nothing)?;
            Some(Given {
                grasp: GivenGrasp::Tracked(Box::new(hand.joints)),
                handedness: joints.handedness(),
                rig: None,
                warnings: hand.warnings,
            })
        }
    };
    given.filter(|_| violations.len() == before)
}
