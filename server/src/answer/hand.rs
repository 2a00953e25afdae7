//! Converts hands to messages.

use grasp_import::Binding;
use grasp_proto::v1;
use grasp_synthesis::model::hand::{
    Digit, HandPose,
    joints::{HandJoints, JOINT_COUNT, Joint, openxr_from_thesis_frame},
    kinematics::{HandFrames, hand_frames},
    rig::Rig,
};

use super::ClientFrame;
use crate::{
    convention::Convention,
    rigs::{RigHand, resource_name},
    wire::{wire_handedness, wire_pose},
};

/// A hand, whole.
pub(super) fn wire_hand(pose: &HandPose, hand: &RigHand, frame: ClientFrame) -> v1::HandPose {
    let rig: &Rig = &hand.hand.rig;
    let convention = frame.convention;
    let joints = HandJoints::of_pose(rig, pose).transformed(frame.client_from_object);
    let binding = hand.binding.as_deref();
    let hand_without_digits = v1::HandPose {
        joints: (0..JOINT_COUNT)
            .map(|place| wire_joint(&joints, convention.joint_at(place), convention))
            .collect(),
        model: binding
            .map(|binding| wire_model(binding, hand.scale, &hand_frames(rig, pose), frame))
            .unwrap_or_default(),
        ..wire_wrist(pose, hand, frame)
    };
    hand_without_digits.with_digits(wire_digits(rig, pose))
}

/// A hand of which only the wrist's place is of interest.
pub(super) fn wire_wrist(pose: &HandPose, hand: &RigHand, frame: ClientFrame) -> v1::HandPose {
    let rig: &Rig = &hand.hand.rig;
    let convention = frame.convention;
    let object_from_wrist = openxr_from_thesis_frame(pose.frame_from_wrist);
    let client_from_wrist = frame.client_from_object * object_from_wrist;
    v1::HandPose {
        scale: (hand.scale != 1.0).then_some(hand.scale),
        convention: convention.to_wire().into(),
        ..v1::HandPose::new(resource_name(rig), wire_handedness(rig.handedness))
    }
    .with_client_from_wrist(wire_pose(convention.joint_from_openxr(client_from_wrist)))
    .with_object_from_wrist(wire_pose(
        convention.joint_at_object_from_openxr(object_from_wrist),
    ))
}

/// The joint angles of the digits that the rig has, thumb first.
fn wire_digits(rig: &Rig, pose: &HandPose) -> [Option<v1::DigitAngles>; 5] {
    Digit::ALL.map(|digit| {
        let angles = &pose.digits[digit.index()];
        rig.has(digit).then(|| {
            v1::DigitAngles::new([
                angles.base_yaw,
                angles.base_pitch,
                angles.second_pitch,
                angles.third_pitch,
            ])
        })
    })
}

/// A joint of a hand, empty if it is of a missing finger.
pub(crate) fn wire_joint(hand: &HandJoints, joint: usize, convention: Convention) -> v1::JointPose {
    if !hand.has(joint) {
        return v1::JointPose::default();
    }
    let Joint { pose, radius } = hand.joints[joint];
    v1::JointPose::new(
        wire_pose(convention.joint_from_openxr(pose)),
        convention.length_from_openxr(radius),
    )
}

/// The nodes of a model that make its skin follow the rig: the root, then the others.
fn wire_model(binding: &Binding, scale: f32, frames: &HandFrames, frame: ClientFrame) -> Vec<v1::NodePose> {
    let client_from_root = frame.client_from_object * binding.frame_from_root(frames, scale);
    let root = v1::NodePose {
        node: binding.root().to_owned(),
        pose: Some(wire_pose(frame.convention.object_from_openxr(client_from_root))),
    };
    let others = binding.posed(frames, scale).map(|node| v1::NodePose {
        node: node.name.to_owned(),
        pose: Some(v1::Pose {
            position: node.translation.map(Into::into),
            orientation: Some(node.rotation.into()),
        }),
    });
    std::iter::once(root).chain(others).collect()
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};
    use grasp_assets::hands;
    use grasp_synthesis::{base::pose::Pose, model::hand::Handedness};

    use super::*;
    use crate::validate::testing::CONVENTIONS;

    #[test]
    fn both_wrists_tell_where_the_object_is_in_every_convention() {
        let hand = hands::hand("adult", Handedness::Left).expect("the rig is built in");
        let hand = RigHand::without_model(hand);
        let pose = HandPose {
            frame_from_wrist: Pose::new(Vec3::new(0.02, -0.1, 0.07), Quat::from_rotation_x(2.0)),
            digits: hand.hand.rig.stretched(),
        };
        let client_from_object = Pose::new(
            Vec3::new(0.4, 1.1, -0.3),
            Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.3),
        );
        for convention in CONVENTIONS {
            let frame = ClientFrame {
                convention,
                client_from_object,
            };
            let sent = wire_hand(&pose, &hand, frame);
            assert_eq!((sent.rig.as_str(), sent.scale), ("rigs/adult", None));
            assert_eq!(sent.handedness(), v1::Handedness::Left);
            assert_eq!(sent.convention(), convention.to_wire());
            assert!(sent.digits().iter().all(Option::is_some) && sent.model.is_empty());
            let object = sent.client_from_object().expect("it has both wrists");
            let expected = wire_pose(convention.object_from_openxr(client_from_object));
            let unit = convention.length_from_openxr(1.0);
            assert!(
                object.position().distance(expected.position()) < 1e-5 * unit
                    && object.orientation().dot(expected.orientation()).abs() > 1.0 - 1e-5,
                "{convention:?}: {object:?}, {expected:?}"
            );
            // The wrist is one of the joints.
            let wrist = sent.joints[convention.joint_at(1)].pose;
            let wrist = wrist.expect("the wrist has a pose").position();
            let at = sent.client_from_wrist.expect("it has both wrists").position();
            assert!(wrist.distance(at) < 1e-5 * unit, "{convention:?}: {wrist}, {at}");
        }
    }
}
