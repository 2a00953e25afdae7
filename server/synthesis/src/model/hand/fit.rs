//! Poses a rig like tracked joints.
//!
//! The wrist is where it is tracked. Each digit takes the angles within its limits that bring its joints and tip nearest to the
//! tracked ones, in the sense of least squares: one angle after the other, each exactly, since a joint turns what follows it about
//! one axis.

use glam::Vec3;

use super::{
    Digit, DigitAngles, HandPose,
    joints::{HandJoints, index, thesis_from_openxr_frame},
    kinematics::{DigitPlane, digit_frames},
    rig::{AngleRange, DigitRig, Rig},
};
use crate::base::pose::Pose;

/// Rounds over the angles of a digit. The sum of squares falls in each; tracked poses settle within some tens.
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
    let limits = &digit.limits;
    let mut angles = start;
    for _ in 0..ROUNDS {
        let before = angles;
        let base = wrist * digit.wrist_from_base;
        // The yaw turns the whole digit about the base's z axis, in the sense of the rig.
        let ends = ends(digit, wrist, &angles);
        let yaw_axis = base.transform_vector(Vec3::Z) * digit.yaw_sign;
        angles.base_yaw += turn(base.position, yaw_axis, ends.into_iter().zip(targets));
        angles.base_yaw = nearest_within(angles.base_yaw, limits.base_yaw);
        for link in 0..3 {
            let frames = digit_frames(digit, wrist, angles);
            let ends = self::ends(digit, wrist, &angles);
            let joint = frames.links[link];
            let axis = joint.transform_vector(Vec3::X);
            let moved = ends.into_iter().zip(targets).skip(link);
            let by = turn(joint.position, axis, moved);
            let (angle, range) = match link {
                0 => (&mut angles.base_pitch, limits.base_pitch),
                1 => (&mut angles.second_pitch, limits.second_pitch),
                _ => (&mut angles.third_pitch, limits.third_pitch),
            };
            *angle = nearest_within(*angle + by, range);
        }
        let change = [
            angles.base_yaw - before.base_yaw,
            angles.base_pitch - before.base_pitch,
            angles.second_pitch - before.second_pitch,
            angles.third_pitch - before.third_pitch,
        ];
        if change.iter().all(|change| change.abs() <= SETTLED) {
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

/// The turn about an axis through a point that brings points nearest to their targets: with u the part of a point across the axis
/// and v that of its target, it maximises the sum of u·v cos φ + axis·(u × v) sin φ.
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
    use std::f32::consts::{PI, TAU};
    let wrapped = angle - TAU * (angle / TAU).round();
    if range.contains(wrapped, 0.0) {
        return wrapped;
    }
    let apart = |bound: f32| {
        let difference = (wrapped - bound).abs() % TAU;
        if difference > PI {
            TAU - difference
        } else {
            difference
        }
    };
    if apart(range.min) <= apart(range.max) {
        range.min
    } else {
        range.max
    }
}
