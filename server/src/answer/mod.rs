//! Converts grasps and reports to messages in the client's frame and convention.

mod current;
mod grasp;
mod hand;
mod names;
mod report;
mod verdicts;

use grasp_synthesis::base::pose::Pose;

pub(crate) use self::{
    current::{current_report, wire_motion},
    grasp::wire_grasp,
    hand::{wire_joint, wire_pose},
    names::{wire_digit, wire_handedness},
    report::{Circumstances, atlas_used, find_response, wire_atlas, wire_origin},
    verdicts::{settle_margins, wire_in_the_way, wire_rejection, wire_verdict},
};
use crate::convention::Convention;

/// The frame and convention in which a client gets its answer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ClientFrame {
    /// Axes, units and joint order.
    pub convention: Convention,
    /// The object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
}
