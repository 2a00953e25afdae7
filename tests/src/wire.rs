//! Values of the core as messages.

use grasp_proto::v1;
use grasp_synthesis::base::pose::Pose;

/// A pose as a message.
pub fn wire_pose(pose: Pose) -> v1::Pose {
    let [x, y, z] = pose.position.to_array();
    let position = Some(v1::Vector3 { x, y, z });
    let [x, y, z, w] = pose.orientation.to_array();
    v1::Pose {
        position,
        orientation: Some(v1::Quaternion { x, y, z, w }),
    }
}
