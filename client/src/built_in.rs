//! The built-in holdouts as requests (feature `built-in`).

use grasp_assets::holdouts::BuiltInHoldout;
use grasp_synthesis::model::hand::joints::openxr_from_thesis_frame;

use crate::{DigitAngles, FindRequest, HandAngles, Handedness, Pose, PresentingHand};

/// A request for a grasp on a built-in holdout, in its world frame, with the server's defaults.
pub fn request_for(holdout: &BuiltInHoldout) -> FindRequest {
    FindRequest {
        client_from_object: client_pose(holdout.world_from_object),
        presenting_hand: Some(PresentingHand::Angles(HandAngles {
            rig: holdout.giver_rig.clone(),
            handedness: client_handedness(holdout.giver_handedness),
            client_from_wrist: client_pose(openxr_from_thesis_frame(holdout.world_from_giver_wrist)),
            digits: holdout.giver_digits.map(|angles| DigitAngles {
                base_yaw: angles.base_yaw,
                base_pitch: angles.base_pitch,
                second_pitch: angles.second_pitch,
                third_pitch: Some(angles.third_pitch),
            }),
            hand_scale: None,
        })),
        ..FindRequest::new(format!("objects/{}", holdout.object))
    }
}

fn client_pose(pose: grasp_synthesis::base::pose::Pose) -> Pose {
    Pose::new(pose.position, pose.orientation)
}

fn client_handedness(handedness: grasp_synthesis::model::hand::Handedness) -> Handedness {
    match handedness {
        grasp_synthesis::model::hand::Handedness::Left => Handedness::Left,
        grasp_synthesis::model::hand::Handedness::Right => Handedness::Right,
    }
}
