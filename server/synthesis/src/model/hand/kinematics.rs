//! Forward kinematics of the digit chains (thesis 4.4, Eq. 4.2 and 4.3, Table 4.2).
//!
//! The thesis prints pitch about z and yaw about x, although +y runs along the phalanx and +z is forward. Here pitch
//! is
//! about x and yaw about z, which agrees with the order of angles in its Table 4.2.

use glam::{Quat, Vec3};

use super::{
    DigitAngles, HandPose,
    rig::{DigitRig, Rig},
};
use crate::base::pose::Pose;

/// The frames of one posed digit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DigitFrames {
    /// The frames of the three links: origin at the joint, +y along the link, +z toward the pad.
    pub links: [Pose; 3],
    /// The fingertip, in metres.
    pub tip: Vec3,
}

/// The frames of all digits of a posed hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandFrames {
    /// The wrist frame.
    pub wrist: Pose,
    /// The digits, thumb first.
    pub digits: [DigitFrames; 5],
}

/// The local rotation of a digit's base joint: yaw ψ1 about z, then pitch θ1 about the turned x axis. Angles in
/// radians.
pub(crate) fn base_rotation(digit: &DigitRig, base_yaw: f32, base_pitch: f32) -> Quat {
    Quat::from_rotation_z(digit.yaw_sign * base_yaw) * Quat::from_rotation_x(base_pitch)
}

/// The frames of a digit, in the target frame of `frame_from_wrist`.
pub fn digit_frames(digit: &DigitRig, frame_from_wrist: Pose, angles: DigitAngles) -> DigitFrames {
    let base = frame_from_wrist
        * digit.wrist_from_base
        * Pose::from_orientation(base_rotation(digit, angles.base_yaw, angles.base_pitch));
    let next = |parent: Pose, length: f32, pitch: f32| {
        parent * Pose::new(Vec3::new(0.0, length, 0.0), Quat::from_rotation_x(pitch))
    };
    let second = next(base, digit.lengths[0], angles.second_pitch);
    let third = next(second, digit.lengths[1], angles.third_pitch);
    let tip = third.transform_point(Vec3::new(0.0, digit.lengths[2], 0.0));
    DigitFrames {
        links: [base, second, third],
        tip,
    }
}

/// The plane in which a digit of fixed yaw bends. It gives joint positions in a third of the time of
/// [`digit_frames`].
#[derive(Clone, Copy, Debug)]
pub struct DigitPlane {
    /// The base joint, in metres.
    base: Vec3,
    /// The direction of the stretched digit, and the one its pad faces, toward which every pitch turns.
    along: Vec3,
    pad: Vec3,
    /// Lengths of the links, in metres.
    lengths: [f32; 3],
}

impl DigitPlane {
    /// The plane of a digit with a yaw of ψ1 radians, in the target frame of `frame_from_wrist`.
    pub fn new(digit: &DigitRig, frame_from_wrist: Pose, base_yaw: f32) -> Self {
        let frame_from_base = frame_from_wrist * digit.wrist_from_base;
        let (sin, cos) = (digit.yaw_sign * base_yaw).sin_cos();
        Self {
            base: frame_from_base.position,
            along: frame_from_base.transform_vector(Vec3::new(-sin, cos, 0.0)),
            pad: frame_from_base.transform_vector(Vec3::Z),
            lengths: digit.lengths,
        }
    }

    /// The three joints and the tip for the pitches of `angles`, in metres; its yaw is ignored.
    pub fn joints(&self, angles: &DigitAngles) -> [Vec3; 4] {
        let mut joints = [self.base; 4];
        let mut pitch = 0.0;
        let pitches = [angles.base_pitch, angles.second_pitch, angles.third_pitch];
        for (link, bend) in pitches.into_iter().enumerate() {
            pitch += bend;
            let (sin, cos) = pitch.sin_cos();
            joints[link + 1] = joints[link] + (self.along * cos + self.pad * sin) * self.lengths[link];
        }
        joints
    }

    /// The direction that the first link's pad faces at a pitch of θ1 radians.
    pub(crate) fn first_pad(&self, base_pitch: f32) -> Vec3 {
        let (sin, cos) = base_pitch.sin_cos();
        self.pad * cos - self.along * sin
    }
}

/// The frames of all digits of a posed rig.
pub fn hand_frames(rig: &Rig, pose: &HandPose) -> HandFrames {
    HandFrames {
        wrist: pose.frame_from_wrist,
        digits: std::array::from_fn(|i| digit_frames(&rig.digits[i], pose.frame_from_wrist, pose.digits[i])),
    }
}
