//! Converts rigs to messages.

use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        Digit, HandPose,
        joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, thesis_from_openxr_frame},
        rig::{DigitLimits, Rig},
    },
};

use crate::{
    answer::wire_joint,
    convention::Convention,
    rigs::{RigHand, StoredRig},
    wire::{wire_digit, wire_handedness},
};

/// The message that describes a rig.
pub(super) fn rig_message(rig: &StoredRig) -> v1::HandRig {
    v1::HandRig {
        name: rig.name(),
        built_in: rig.built_in,
        hands: rig
            .hands
            .iter()
            .zip(rig.mirrored)
            .map(|(hand, mirrored)| wire_hand(hand, mirrored))
            .collect(),
        warnings: rig.warnings.clone(),
    }
}

fn wire_hand(hand: &RigHand, mirrored: bool) -> v1::RigHand {
    let rig: &Rig = &hand.hand.rig;
    let stretched = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(Pose::IDENTITY),
        digits: rig.stretched(),
    };
    let stretched = HandJoints::of_pose(rig, &stretched);
    let handedness = wire_handedness(rig.handedness).into();
    let joints = hand.binding.iter().flat_map(|binding| binding.joints());
    v1::RigHand {
        handedness,
        stretched_joints: (0..JOINT_COUNT)
            .map(|joint| wire_joint(&stretched, joint, Convention::OpenXr))
            .collect(),
        limits: Digit::ALL
            .into_iter()
            .filter(|&digit| rig.has(digit))
            .map(|digit| wire_limits(digit, &rig.digit(digit).limits))
            .collect(),
        mirrored,
        nodes: joints
            .map(|(node, joint)| v1::RigNode {
                node: node.to_owned(),
                joint: joint.map_or("", |joint| JOINT_NAMES[joint]).to_owned(),
                handedness,
            })
            .collect(),
    }
}

fn wire_limits(digit: Digit, limits: &DigitLimits) -> v1::DigitLimits {
    let ranges = [
        limits.base_yaw,
        limits.base_pitch,
        limits.second_pitch,
        limits.third_pitch,
    ];
    v1::DigitLimits {
        digit: wire_digit(digit).into(),
        min: Some(v1::DigitAngles::new(ranges.map(|range| range.min))),
        max: Some(v1::DigitAngles::new(ranges.map(|range| range.max))),
    }
}
