//! Forward kinematics of the digit chains (thesis 4.4, Eq. 4.2 and 4.3, Table 4.2).
//!
//! The thesis prints pitch about z and yaw about x, although +y runs along the phalanx and +z is forward. Here pitch
//! is about x and yaw about z, which agrees with the order of angles in its Table 4.2. [`fitted`] poses a rig like tracked joints.

use glam::{Quat, Vec3};

use super::{
    Digit, DigitAngles, HandPose,
    joints::{HandJoints, index, thesis_from_openxr_frame},
    rig::{AngleRange, DigitRig, Rig},
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

/// The frames of a digit, in the target frame of `frame_from_wrist`.
pub fn digit_frames(digit: &DigitRig, frame_from_wrist: Pose, angles: DigitAngles) -> DigitFrames {
    // Yaw ψ1 about z, then pitch θ1 about the turned x axis.
    let turn =
        Quat::from_rotation_z(digit.yaw_sign * angles.base_yaw) * Quat::from_rotation_x(angles.base_pitch);
    let base = frame_from_wrist * digit.wrist_from_base * Pose::from_orientation(turn);
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

/// The plane in which a digit of fixed yaw bends. It gives joint positions in a third of the time of [`digit_frames`].
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
        for (link, bend) in angles.pitches().into_iter().enumerate() {
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

/// Limit on the rounds over a digit's angles. Tracked poses settle within some tens.
const ROUNDS: usize = 200;

/// A round that turns no angle by more, in radians, is the last.
const SETTLED: f32 = 1e-6;

/// The pose of a rig nearest to tracked joints, in the frame of the joints.
pub fn fitted(rig: &Rig, joints: &HandJoints) -> HandPose {
    let wrist = thesis_from_openxr_frame(joints.joints[index::WRIST].pose);
    let mut digits = rig.stretched();
    for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
        let tip = index::TIP_OF_DIGIT[digit.index()];
        let targets = [tip - 2, tip - 1, tip].map(|joint| joints.joints[joint].pose.position);
        digits[digit.index()] = fitted_digit(rig.digit(digit), wrist, digits[digit.index()], targets);
    }
    HandPose {
        frame_from_wrist: wrist,
        digits,
    }
}

/// The largest distance of a joint of a posed rig from the tracked one, in metres. Joints of missing fingers do not count.
pub fn farthest_joint(rig: &Rig, pose: &HandPose, joints: &HandJoints) -> f32 {
    let posed = HandJoints::of_pose(rig, pose);
    let pairs = posed.joints.iter().zip(&joints.joints).enumerate();
    pairs
        .filter(|&(joint, _)| posed.has(joint))
        .map(|(_, (posed, tracked))| posed.pose.position.distance(tracked.pose.position))
        .fold(0.0, f32::max)
}

/// The angles that bring the ends of the three links nearest to some points.
fn fitted_digit(digit: &DigitRig, wrist: Pose, start: DigitAngles, targets: [Vec3; 3]) -> DigitAngles {
    let limits = digit.limits.to_array();
    let mut angles = start;
    for _ in 0..ROUNDS {
        let before = angles;
        let base = wrist * digit.wrist_from_base;
        // The yaw turns the whole digit about the base's z axis, in the sense of the rig.
        let ends = ends(digit, wrist, &angles);
        let yaw_axis = base.transform_vector(Vec3::Z) * digit.yaw_sign;
        angles.base_yaw += turn(base.position, yaw_axis, ends.into_iter().zip(targets));
        angles.base_yaw = nearest_within(angles.base_yaw, limits[0]);
        for link in 0..3 {
            let frames = digit_frames(digit, wrist, angles);
            let ends = self::ends(digit, wrist, &angles);
            let joint = frames.links[link];
            let axis = joint.transform_vector(Vec3::X);
            let moved = ends.into_iter().zip(targets).skip(link);
            let by = turn(joint.position, axis, moved);
            let mut turned = angles.to_array();
            turned[link + 1] = nearest_within(turned[link + 1] + by, limits[link + 1]);
            angles = DigitAngles::from_array(turned);
        }
        let (new, old) = (angles.to_array(), before.to_array());
        if (0..4).all(|i| (new[i] - old[i]).abs() <= SETTLED) {
            break;
        }
    }
    angles
}

/// Where the three links end.
fn ends(digit: &DigitRig, wrist: Pose, angles: &DigitAngles) -> [Vec3; 3] {
    let [_, ends @ ..] = DigitPlane::new(digit, wrist, angles.base_yaw).joints(angles);
    ends
}

/// The turn about an axis that brings points nearest to their targets: it maximises Σ u·v cos φ + axis·(u × v) sin φ.
fn turn(centre: Vec3, axis: Vec3, points: impl Iterator<Item = (Vec3, Vec3)>) -> f32 {
    let (sin, cos) = points.fold((0.0, 0.0), |(sin, cos), (point, target)| {
        let across = |p: Vec3| (p - centre).reject_from(axis);
        let (u, v) = (across(point), across(target));
        (sin + axis.dot(u.cross(v)), cos + u.dot(v))
    });
    f32::atan2(sin, cos)
}

/// The angle of a range that is nearest on the circle: the sum of squares grows with the angle between them.
fn nearest_within(angle: f32, range: AngleRange) -> f32 {
    use std::f32::consts::TAU;
    let wrapped = angle - TAU * (angle / TAU).round();
    if range.contains(wrapped, 0.0) {
        return wrapped;
    }
    let apart = |bound: f32| {
        let difference = (wrapped - bound).abs() % TAU;
        difference.min(TAU - difference)
    };
    if apart(range.min) <= apart(range.max) {
        range.min
    } else {
        range.max
    }
}
