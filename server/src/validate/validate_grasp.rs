//! Checks `ValidateGraspRequest`.

use grasp_proto::v1::{self, validate_grasp_request::Grasp};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{HandPose, joints::HandJoints, kinematics::fitted, rig::Rig},
};

use super::{
    FindQuery, Violations,
    find_grasp::{checked_query, finished},
    frames::Frames,
    hand::{AllowedGaps, AngleBounds, Place, posed_hand, tracked_hand},
    positive_duration, quoted,
    requirements::check_no_experiment,
    stream_grasps::check_one_hand,
};
use crate::{error::ServiceError, rigs::store::RigStore};

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
struct CheckedGrasp {
    grasp: GivenGrasp,
    /// The hand that it is of.
    handedness: v1::Handedness,
    /// Its rig, and how many times as large it is. Tracked joints have none of their own.
    rig: Option<(String, Option<f32>)>,
    /// What was repaired.
    warnings: Vec<String>,
}

/// A valid request.
#[derive(Debug)]
pub(crate) struct ValidateQuery {
    /// The holdout, as for a search for the first valid grasp.
    pub holdout: FindQuery,
    pub grasp: GivenGrasp,
    /// True to search for a valid grasp near it.
    pub find_nearest: bool,
    /// What was repaired in the grasp.
    pub warnings: Vec<String>,
}

/// Checks a request, as [`super::find_query`] does for its object.
pub(crate) fn validate_query(
    request: v1::ValidateGraspRequest,
    (default_rig, rigs): (&str, &RigStore),
    object_exists: impl Fn(&str) -> bool,
) -> Result<ValidateQuery, ServiceError> {
    let v1::ValidateGraspRequest {
        holdout,
        receiver,
        requirements,
        output,
        nearest_budget,
        grasp,
    } = request;
    let violations = Violations::default();
    let v = &violations;
    let frames = Frames::of(holdout.as_ref(), output, rigs);
    let given = given_grasp(grasp, &frames, v);
    let find_nearest = nearest_budget.is_some();
    let budget = nearest_budget.and_then(|sent| positive_duration(v.field("nearest_budget"), sent));
    check_no_experiment(requirements.as_ref(), v);
    check_one_hand(receiver.as_ref(), v);
    let parts = v1::FindGraspRequest {
        holdout,
        receiver: Some(receiver_of(receiver.unwrap_or_default(), given.as_ref(), v)),
        requirements,
        output: output.map(|output| v1::OutputOptions {
            key_frames: false,
            ..output
        }),
        ..Default::default()
    };
    let holdout = checked_query(parts, (default_rig, rigs), object_exists, v);
    let query = holdout.zip(given).map(|(mut holdout, given)| {
        holdout.limits.budget = budget;
        ValidateQuery {
            holdout,
            grasp: given.grasp,
            find_nearest,
            warnings: given.warnings,
        }
    });
    finished(query, violations)
}

/// The receiver whose hand the grasp is of. What the request says about it must not contradict the grasp.
fn receiver_of(sent: v1::Receiver, given: Option<&CheckedGrasp>, v: &Violations) -> v1::Receiver {
    let field = v.field("receiver");
    let Some(given) = given else { return sent };
    let handedness = match v1::Handedness::try_from(sent.handedness) {
        // A value that the contract does not define stays, to be found wrong.
        Err(_) => sent.handedness,
        Ok(named) => {
            if named != v1::Handedness::Unspecified && named != given.handedness {
                field.child("handedness").add(format_args!(
                    "is {}, but the grasp is of {}; leave it out",
                    named.as_str_name(),
                    given.handedness.as_str_name()
                ));
            }
            given.handedness.into()
        }
    };
    let Some((rig, scale)) = &given.rig else {
        return v1::Receiver { handedness, ..sent };
    };
    if !sent.rig.is_empty() && sent.rig != *rig {
        field.child("rig").add(format_args!(
            "is {}, but the grasp is of {}; leave it out",
            quoted(&sent.rig),
            quoted(rig)
        ));
    }
    let size = scale.unwrap_or(1.0);
    if let Some(sent) = sent.scale
        && (sent.is_nan() || (sent - size).abs() >= 0.005)
    {
        field.child("scale").add(format_args!(
            "is {sent}, but the hand of the grasp is {size} times as large as its rig; leave it out"
        ));
    }
    v1::Receiver {
        rig: rig.clone(),
        handedness,
        scale: *scale,
        ..sent
    }
}

/// The grasp; `None` if it is wrong. Angles need not be within the limits of their rig.
fn given_grasp(sent: Option<Grasp>, frames: &Frames<'_>, violations: &Violations) -> Option<CheckedGrasp> {
    let before = violations.len();
    let given = match sent {
        None => violations
            .field("grasp")
            .reject("is absent; it must be pose or joints"),
        Some(Grasp::Pose(sent)) => {
            let field = violations.field("pose");
            let hand = posed_hand(field, &sent, Place::AtObject, AngleBounds::HalfTurn, frames)?;
            Some(CheckedGrasp {
                grasp: GivenGrasp::AtObject(hand.pose),
                handedness: sent.handedness(),
                rig: Some((sent.rig, sent.scale)),
                warnings: Vec::new(),
            })
        }
        Some(Grasp::Joints(joints)) => {
            let field = violations.field("joints");
            let hand = tracked_hand(field, &joints, frames.convention, AllowedGaps::Nothing)?;
            Some(CheckedGrasp {
                grasp: GivenGrasp::Tracked(Box::new(hand.joints)),
                handedness: joints.handedness(),
                rig: None,
                warnings: hand.warnings,
            })
        }
    };
    given.filter(|_| violations.len() == before)
}
