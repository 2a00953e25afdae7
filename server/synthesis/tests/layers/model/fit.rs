//! Rigs posed like tracked joints.

use grasp_synthesis::model::hand::fit::{farthest_joint, fitted};

use crate::prelude::*;

fn any_pose(rig: &Rig, random: &mut Random) -> HandPose {
    hand_pose(
        Pose::new(
            random.direction() * 0.5,
            Quat::from_axis_angle(random.direction(), random.between(0.0, 3.0)),
        ),
        random.angles(rig),
    )
}

#[test]
fn a_rig_posed_like_its_own_joints_is_where_they_are() {
    let mut random = Random::new(4);
    for hand in all_hands() {
        for _ in 0..50 {
            let pose = any_pose(&hand.rig, &mut random);
            let joints = HandJoints::of_pose(&hand.rig, &pose);
            let fit = fitted(&hand.rig, &joints);
            let farthest = farthest_joint(&hand.rig, &fit, &joints);
            assert!(
                farthest < 2e-4,
                "{} {:?}: {farthest} m",
                hand.rig.name,
                hand.rig.handedness
            );
            for (digit, limits) in fit.digits.iter().zip(hand.rig.digits.map(|digit| digit.limits)) {
                assert_eq!(*digit, limits.clamped(*digit));
            }
        }
    }
}

#[test]
fn no_angles_within_limits_come_nearer_than_the_fit() {
    let mut random = Random::new(6);
    let rig = right();
    for _ in 0..30 {
        let pose = any_pose(rig, &mut random);
        let mut joints = HandJoints::of_pose(rig, &pose);
        // Joints that no pose of the rig has: another size, and noise.
        for joint in &mut joints.joints {
            joint.pose.position = pose.frame_from_wrist.position
                + (joint.pose.position - pose.frame_from_wrist.position) * 1.07
                + random.direction() * 0.004;
        }
        joints.joints[index::WRIST].pose.position = pose.frame_from_wrist.position;
        let fit = fitted(rig, &joints);
        let squares = |pose: &HandPose, digit: Digit| {
            let posed = HandJoints::of_pose(rig, pose);
            let tip = index::TIP_OF_DIGIT[digit.index()];
            let square = |joint: usize| {
                let apart = posed.joints[joint].pose.position - joints.joints[joint].pose.position;
                apart.length_squared()
            };
            (tip - 2..=tip).map(square).sum::<f32>()
        };
        for digit in Digit::ALL {
            let best = squares(&fit, digit);
            for _ in 0..300 {
                let mut other = fit;
                let angles = &mut other.digits[digit.index()];
                let scale = if random.index(2) == 0 { 0.02 } else { 0.5 };
                angles.base_yaw += random.between(-scale, scale);
                angles.base_pitch += random.between(-scale, scale);
                angles.second_pitch += random.between(-scale, scale);
                angles.third_pitch += random.between(-scale, scale);
                *angles = rig.digit(digit).limits.clamped(*angles);
                let squares = squares(&other, digit);
                assert!(squares > best - 1e-7, "{digit:?}: {squares} < {best}");
            }
        }
    }
}

#[test]
fn fingers_that_the_rig_lacks_do_not_count() {
    let mut random = Random::new(9);
    let whole = right();
    let three = adult_with(&[Digit::Index, Digit::Middle], whole.handedness);
    let pose = any_pose(whole, &mut random);
    let joints = HandJoints::of_pose(whole, &pose);
    let fit = fitted(&three, &joints);
    assert!(farthest_joint(&three, &fit, &joints) < 2e-4);
    assert_eq!(
        fit.digits[Digit::Little.index()],
        three.stretched()[Digit::Little.index()]
    );
}
