//! The built-in holdouts as requests (feature `built-in`).

use grasp_assets::holdouts::BuiltInHoldout;
use grasp_proto::v1;
use grasp_synthesis::model::hand::{Handedness, joints::openxr_from_thesis_frame};

/// A request for a grasp on a built-in holdout, in its world frame, with the server's defaults.
pub fn request_for(holdout: &BuiltInHoldout) -> v1::FindGraspRequest {
    let handedness = match holdout.giver_handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    };
    let digits = holdout.giver_digits.map(|angles| v1::DigitAngles {
        base_yaw: angles.base_yaw,
        base_pitch: angles.base_pitch,
        second_pitch: angles.second_pitch,
        third_pitch: Some(angles.third_pitch),
    });
    let wrist = openxr_from_thesis_frame(holdout.world_from_giver_wrist);
    let giver = v1::HandPose::new(format!("rigs/{}", holdout.giver_rig), handedness)
        .with_client_from_wrist(wire_pose(wrist))
        .with_digits(digits.map(Some));
    v1::FindGraspRequest::new(format!("objects/{}", holdout.object))
        .with_client_from_object(wire_pose(holdout.world_from_object))
        .with_presenting_hand(giver)
}

fn wire_pose(pose: grasp_synthesis::base::pose::Pose) -> v1::Pose {
    v1::Pose::new(pose.position, pose.orientation)
}
