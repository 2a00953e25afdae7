//! Hands for tests.

use glam::{Quat, Vec3};
use grasp_assets::hands;
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT},
    },
};

use crate::{answer::wire_pose, convention::Convention};

/// A bent hand in a client's frame, as `OpenXR` joints.
pub(crate) fn joints_of_a_rig(handedness: Handedness) -> HandJoints {
    let hand = hands::hand("adult", handedness).expect("the rig is built in");
    let mut digits = hand.rig.stretched();
    for digit in &mut digits[1..] {
        *digit = DigitAngles::coupled(0.05, 0.4, 0.6);
    }
    let pose = HandPose {
        frame_from_wrist: Pose::new(Vec3::new(0.4, 1.1, -0.3), Quat::from_rotation_y(0.7)),
        digits,
    };
    HandJoints::of_pose(&hand.rig, &pose)
}

/// The joints as a client with the convention sends them.
pub(crate) fn sent(joints: &HandJoints, convention: Convention, set: v1::JointSet) -> v1::HandJoints {
    let places = match set {
        v1::JointSet::Webxr25 => 1..JOINT_COUNT,
        _ => 0..JOINT_COUNT,
    };
    let handedness = match joints.handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    };
    let joint_of = |place| match set {
        v1::JointSet::Webxr25 => place,
        _ => convention.joint_at(place),
    };
    v1::HandJoints {
        handedness: handedness.into(),
        joint_set: set.into(),
        joints: places
            .map(|place| joints.joints[joint_of(place)])
            .map(|joint| v1::JointPose {
                client_from_joint: Some(wire_pose(convention.joint_from_openxr(joint.pose))),
                radius: convention.length_from_openxr(joint.radius),
            })
            .collect(),
    }
}
