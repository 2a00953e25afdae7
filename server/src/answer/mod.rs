//! Converts grasps and reports to messages in the client's frame and convention.

mod grasp;
mod hand;
mod report;
mod verdicts;

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

pub(crate) use self::{
    grasp::wire_grasp,
    hand::wire_joint,
    report::{
        Circumstances, atlas_used, current_report, find_response, wire_atlas, wire_motion, wire_origin,
    },
    verdicts::{settle_margins, wire_check, wire_rejection, wire_verdict},
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

impl ClientFrame {
    /// A point of the object in the client's frame.
    fn point(self, at: Vec3) -> v1::Vector3 {
        let in_client = self.client_from_object.transform_point(at);
        self.convention.point_from_openxr(in_client).into()
    }
}
