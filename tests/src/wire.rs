//! Values of the core as messages.

use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

/// A pose as a message.
pub fn wire_pose(pose: Pose) -> v1::Pose {
    v1::Pose::new(pose.position, pose.orientation)
}
