//! Hands.

use glam::Vec3;
use grasp_proto::v1;

use super::{
    Malformed, exactly,
    geometry_codec::{pose_from_wire, pose_to_wire},
};
use crate::hand::{
    Digit, DigitAngles, HandAngles, HandAtObject, HandJoints, HandMesh, Handedness, JointPose, JointSet,
    Phalanx, PresentingHand, ReceivingHand,
};

pub(super) fn handedness_to_wire(handedness: Handedness) -> v1::Handedness {
    match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    }
}

pub(super) fn handedness_from_wire(field: &str, value: i32) -> Result<Handedness, Malformed> {
    match v1::Handedness::try_from(value) {
        Ok(v1::Handedness::Left) => Ok(Handedness::Left),
        Ok(v1::Handedness::Right) => Ok(Handedness::Right),
        Ok(v1::Handedness::Unspecified) | Err(_) => Err(Malformed::unknown_value(field, value)),
    }
}

pub(super) fn digit_to_wire(digit: Digit) -> v1::Digit {
    match digit {
        Digit::Thumb => v1::Digit::Thumb,
        Digit::Index => v1::Digit::Index,
        Digit::Middle => v1::Digit::Middle,
        Digit::Ring => v1::Digit::Ring,
        Digit::Little => v1::Digit::Little,
    }
}

/// None for the palm.
pub(super) fn digit_from_wire(field: &str, value: i32) -> Result<Option<Digit>, Malformed> {
    match v1::Digit::try_from(value) {
        Ok(v1::Digit::Thumb) => Ok(Some(Digit::Thumb)),
        Ok(v1::Digit::Index) => Ok(Some(Digit::Index)),
        Ok(v1::Digit::Middle) => Ok(Some(Digit::Middle)),
        Ok(v1::Digit::Ring) => Ok(Some(Digit::Ring)),
        Ok(v1::Digit::Little) => Ok(Some(Digit::Little)),
        Ok(v1::Digit::Unspecified) => Ok(None),
        Err(_) => Err(Malformed::unknown_value(field, value)),
    }
}

/// None for the palm.
pub(super) fn phalanx_from_wire(field: &str, value: i32) -> Result<Option<Phalanx>, Malformed> {
    match v1::Phalanx::try_from(value) {
        Ok(v1::Phalanx::First) => Ok(Some(Phalanx::First)),
        Ok(v1::Phalanx::Second) => Ok(Some(Phalanx::Second)),
        Ok(v1::Phalanx::Third) => Ok(Some(Phalanx::Third)),
        Ok(v1::Phalanx::Unspecified) => Ok(None),
        Err(_) => Err(Malformed::unknown_value(field, value)),
    }
}

pub(super) fn digit_angles_to_wire(angles: &DigitAngles) -> v1::DigitAngles {
    v1::DigitAngles {
        base_yaw: angles.base_yaw,
        base_pitch: angles.base_pitch,
        second_pitch: angles.second_pitch,
        third_pitch: angles.third_pitch,
    }
}

pub(super) fn digit_angles_from_wire(angles: v1::DigitAngles) -> DigitAngles {
    DigitAngles {
        base_yaw: angles.base_yaw,
        base_pitch: angles.base_pitch,
        second_pitch: angles.second_pitch,
        third_pitch: angles.third_pitch,
    }
}

fn joint_to_wire(joint: &JointPose) -> v1::JointPose {
    if *joint == JointPose::MISSING {
        return v1::JointPose::default();
    }
    v1::JointPose {
        client_from_joint: Some(pose_to_wire(joint.client_from_joint)),
        radius: joint.radius,
    }
}

pub(super) fn joint_from_wire(joint: v1::JointPose) -> JointPose {
    JointPose {
        client_from_joint: pose_from_wire(joint.client_from_joint),
        radius: joint.radius,
    }
}

pub(super) fn presenting_hand_to_wire(hand: &PresentingHand) -> v1::PresentingHand {
    let form = match hand {
        PresentingHand::Angles(angles) => v1::presenting_hand::Form::Angles(hand_angles_to_wire(angles)),
        PresentingHand::Joints(joints) => v1::presenting_hand::Form::Joints(hand_joints_to_wire(joints)),
        PresentingHand::Mesh(HandMesh {
            positions,
            triangles,
            client_from_wrist,
        }) => v1::presenting_hand::Form::Mesh(v1::HandMesh {
            client_coordinates: positions.iter().flat_map(Vec3::to_array).collect(),
            triangles: triangles.as_flattened().to_vec(),
            client_from_wrist: client_from_wrist.map(pose_to_wire),
        }),
    };
    v1::PresentingHand { form: Some(form) }
}

pub(super) fn hand_angles_to_wire(hand: &HandAngles) -> v1::HandAngles {
    v1::HandAngles {
        rig: hand.rig.clone(),
        handedness: handedness_to_wire(hand.handedness).into(),
        client_from_wrist: Some(pose_to_wire(hand.client_from_wrist)),
        digits: hand.digits.iter().map(digit_angles_to_wire).collect(),
        hand_scale: hand.hand_scale,
    }
}

pub(super) fn hand_at_object_to_wire(hand: &HandAtObject) -> v1::HandAtObject {
    v1::HandAtObject {
        rig: hand.rig.clone(),
        handedness: handedness_to_wire(hand.handedness).into(),
        hand_scale: hand.hand_scale,
        object_from_wrist: Some(pose_to_wire(hand.object_from_wrist)),
        digits: hand.digits.iter().map(digit_angles_to_wire).collect(),
    }
}

pub(super) fn hand_at_object_from_wire(hand: v1::HandAtObject) -> Result<HandAtObject, Malformed> {
    Ok(HandAtObject {
        rig: hand.rig,
        handedness: handedness_from_wire("handedness", hand.handedness)?,
        hand_scale: hand.hand_scale,
        object_from_wrist: pose_from_wire(hand.object_from_wrist),
        digits: exactly("digits", hand.digits)?.map(digit_angles_from_wire),
    })
}

pub(super) fn hand_joints_to_wire(hand: &HandJoints) -> v1::HandJoints {
    v1::HandJoints {
        handedness: handedness_to_wire(hand.handedness).into(),
        joint_set: match hand.joint_set {
            JointSet::OpenXr26 => v1::JointSet::Openxr26,
            JointSet::WebXr25 => v1::JointSet::Webxr25,
        }
        .into(),
        joints: hand.joints.iter().map(joint_to_wire).collect(),
    }
}

pub(super) fn receiving_hand_to_wire(hand: &ReceivingHand) -> v1::ReceivingHand {
    v1::ReceivingHand {
        rig: hand.rig.clone().unwrap_or_default(),
        handedness: hand
            .handedness
            .map_or(v1::Handedness::Unspecified, handedness_to_wire)
            .into(),
        hand_scale: hand.hand_scale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;

    #[test]
    fn converts_both_forms_of_presenting_hand() {
        let mut digits = [DigitAngles::default(); 5];
        digits[4] = DigitAngles {
            base_yaw: 0.1,
            base_pitch: 0.2,
            second_pitch: 0.3,
            third_pitch: Some(0.4),
        };
        let angles = presenting_hand_to_wire(&PresentingHand::Angles(HandAngles {
            rig: "adult".to_owned(),
            handedness: Handedness::Left,
            client_from_wrist: Pose::IDENTITY,
            digits,
            hand_scale: Some(1.25),
        }));
        let Some(v1::presenting_hand::Form::Angles(angles)) = angles.form else {
            panic!("{angles:?}")
        };
        assert_eq!((angles.rig.as_str(), angles.hand_scale), ("adult", Some(1.25)));
        assert_eq!(angles.handedness(), v1::Handedness::Left);
        assert_eq!(angles.digits.len(), 5);
        assert_eq!(angles.digits[0].third_pitch, None);
        assert_eq!(digit_angles_from_wire(angles.digits[4]), digits[4]);

        let joint = JointPose {
            client_from_joint: Pose::new(glam::Vec3::X, glam::Quat::from_xyzw(1.0, 0.0, 0.0, 0.0)),
            radius: 0.01,
        };
        let joints = presenting_hand_to_wire(&PresentingHand::Joints(HandJoints {
            handedness: Handedness::Right,
            joint_set: JointSet::WebXr25,
            joints: vec![joint; 25],
        }));
        let Some(v1::presenting_hand::Form::Joints(joints)) = joints.form else {
            panic!("{joints:?}")
        };
        assert_eq!(joints.joint_set(), v1::JointSet::Webxr25);
        assert_eq!(joints.joints.len(), 25);
        assert_eq!(joint_from_wire(joints.joints[24]), joint);
    }

    #[test]
    fn default_receiving_hand_sends_nothing() {
        let wire = receiving_hand_to_wire(&ReceivingHand::default());
        assert_eq!(wire, v1::ReceivingHand::default());
    }

    #[test]
    fn rejects_unknown_hands_digits_and_links() {
        for value in [0, 3, -1] {
            assert!(handedness_from_wire("handedness", value).is_err(), "{value}");
        }
        for value in [-1, 6] {
            assert!(digit_from_wire("digit", value).is_err(), "{value}");
        }
        for value in [-1, 4] {
            assert!(phalanx_from_wire("phalanx", value).is_err(), "{value}");
        }
        assert_eq!(digit_from_wire("digit", 5), Ok(Some(Digit::Little)));
        assert_eq!(phalanx_from_wire("phalanx", 1), Ok(Some(Phalanx::First)));
        assert_eq!(digit_from_wire("digit", 0), Ok(None));
        assert_eq!(phalanx_from_wire("phalanx", 0), Ok(None));
    }
}
