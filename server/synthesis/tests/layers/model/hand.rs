//! The hand: kinematics, frames, descriptions of rigs, and the posed skin.

use crate::prelude::*;
use glam::DMat4;
use grasp_synthesis::model::hand::joints::Skin;
use grasp_synthesis::model::hand::kinematics::{farthest_joint, fitted};

fn matrix(pose: Pose) -> DMat4 {
    DMat4::from_rotation_translation(pose.orientation.as_dquat(), pose.position.as_dvec3())
}

/// Equation 4.2 up to each link and the tip: T(p0) R(r0) T(p1) R(r1) …
fn chain(wrist: Pose, digit: &DigitRig, yaw_sign: f64, angles: DigitAngles) -> [DMat4; 4] {
    let along = |link: usize| DMat4::from_translation(DVec3::Y * f64::from(digit.lengths[link]));
    let pitch = |angle: f32| DMat4::from_rotation_x(f64::from(angle));
    let yaw = DMat4::from_rotation_z(yaw_sign * f64::from(angles.base_yaw));
    let one = matrix(wrist) * matrix(digit.wrist_from_base) * yaw * pitch(angles.base_pitch);
    let two = one * along(0) * pitch(angles.second_pitch);
    let three = two * along(1) * pitch(angles.third_pitch);
    [one, two, three, three * along(2)]
}

#[test]
fn frames_match_equation_4_2() {
    let mut random = Random::new(1);
    for hand in all_hands() {
        // Fingers yaw toward the little finger's side, the thumb away from the palm: opposite senses about +z.
        let side = f64::from(thumb_side(hand.rig.handedness));
        for _ in 0..200 {
            let wrist = random.pose();
            let digits = random.angles(&hand.rig);
            let frames = hand_frames(&hand.rig, &hand_pose(wrist, digits));
            for (i, angles) in digits.into_iter().enumerate() {
                let sign = if i == 0 { -side } else { side };
                let expected = chain(wrist, &hand.rig.digits[i], sign, angles);
                for (&link, expected) in frames.digits[i].links.iter().zip(expected) {
                    assert!(matrix(link).abs_diff_eq(expected, 2e-6), "digit {i}: {link:?}");
                }
                let tip = frames.digits[i].tip.as_dvec3();
                assert!(tip.abs_diff_eq(expected[3].w_axis.truncate(), 2e-6));
            }
        }
    }
}

#[test]
fn openxr_axes_follow_the_specification() {
    for hand in all_hands() {
        let rig = &hand.rig;
        let frame = Pose::new(
            Vec3::new(0.3, 1.2, -0.4),
            Quat::from_xyzw(0.2, -0.5, 0.1, 0.8).normalize(),
        );
        let joints = HandJoints::of_pose(rig, &hand_pose(frame, rig.stretched()));
        let to_thumb = (joints.joints[index::FIRST_OF_DIGIT[1]].pose.position
            - joints.joints[index::FIRST_OF_DIGIT[4]].pose.position)
            .normalize_or_zero();
        let palmar = frame.transform_vector(Vec3::Z);
        // By the right-hand rule, +X points to the thumb on the left hand and to the little finger on the right.
        let side = -thumb_side(rig.handedness);
        for digit in 0..5 {
            let first = index::FIRST_OF_DIGIT[digit];
            let tip = index::TIP_OF_DIGIT[digit];
            for joint in first..tip {
                let pose = joints.joints[joint].pose;
                let to_next = (joints.joints[joint + 1].pose.position - pose.position).normalize_or_zero();
                let forward = pose.transform_vector(Vec3::NEG_Z);
                assert!(forward.dot(to_next) > 0.9999, "-Z of joint {joint}");
                if digit > 0 {
                    let up = pose.transform_vector(Vec3::Y);
                    assert!(up.dot(palmar) < -0.95, "+Y of joint {joint} leaves by the back");
                    let across = pose.transform_vector(Vec3::X);
                    assert!(across.dot(to_thumb) * side > 0.9, "+X of joint {joint}");
                }
            }
        }
        let palm = joints.joints[index::PALM].pose;
        assert!((palm.transform_vector(Vec3::NEG_Y)).dot(palmar) > 0.99);
        // H lies one radius off the palm joint, at the rig's palm point.
        assert!(joints.palm_skin().distance(frame.transform_point(rig.palm)) < 1e-5);
    }
}

/// Volume within a skin in cubic metres.
fn volume(skin: &Skin, positions: Vec<Vec3>) -> f64 {
    let mesh = TriangleMesh::without_degenerates(positions, &skin.triangles);
    mesh.expect("a skin is a mesh").signed_volume()
}

#[test]
fn a_skin_moves_and_scales_with_its_joints() {
    let turn = Quat::from_xyzw(0.3, 0.1, -0.6, 0.7).normalize();
    let moved = Pose::new(Vec3::new(0.4, -1.0, 2.0), turn);
    for hand in all_hands() {
        for (a_from_b, scale, rounding) in [
            (Pose::IDENTITY, 1.0, 1e-6),
            (moved, 1.0, 5e-6),
            (Pose::IDENTITY, 0.8, 1e-5),
            (Pose::IDENTITY, 1.25, 1e-5),
        ] {
            let mut joints = hand.skin.bind.clone();
            for joint in &mut joints.joints {
                joint.pose.position *= scale;
                joint.radius *= scale;
            }
            let posed = hand.skin.posed(&joints.transformed(a_from_b));
            for (found, bind) in posed.iter().zip(&hand.skin.positions) {
                let expected = a_from_b.transform_point(scale * *bind);
                assert!(found.distance(expected) < rounding, "{found} {expected}");
            }
        }
    }
}

#[test]
fn a_skin_stretches_to_another_rigs_hand() {
    // On the joints of the thesis's larger hand, the adult's skin has that hand's volume.
    let (small, large) = (
        built_in_hand("adult", Handedness::Right),
        built_in_hand("thesis", Handedness::Right),
    );
    let on_large = volume(&small.skin, small.skin.posed(&large.skin.bind));
    let ratio = on_large / volume(&large.skin, large.skin.positions.clone());
    assert!((ratio - 1.0).abs() < 0.02, "the volumes' ratio is {ratio}");
}

fn any_pose(rig: &Rig, random: &mut Random) -> HandPose {
    hand_pose(random.pose(), random.angles(rig))
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
            let fitted = fit.digits[digit.index()];
            assert_eq!(fitted, rig.digit(digit).limits.clamped(fitted));
            let best = squares(&fit, digit);
            for _ in 0..300 {
                let mut other = fit;
                let angles = &mut other.digits[digit.index()];
                let scale = if random.index(2) == 0 { 0.02 } else { 0.5 };
                *angles = rig
                    .digit(digit)
                    .limits
                    .clamped(random.near_angles(*angles, scale));
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

#[test]
fn left_hands_mirror_right_hands() {
    let mut random = Random::new(3);
    let flip = |v: Vec3| v * Vec3::new(-1.0, 1.0, 1.0);
    for name in ["thesis", "adult"] {
        let (left, right) = (
            built_in_hand(name, Handedness::Left),
            built_in_hand(name, Handedness::Right),
        );
        for _ in 0..100 {
            let digits = random.angles(&right.rig);
            let wrist = random.pose();
            let of_right = HandJoints::of_pose(&right.rig, &hand_pose(wrist, digits));
            let of_left = HandJoints::of_pose(&left.rig, &hand_pose(wrist.mirrored_x(), digits));
            for (l, r) in of_left.joints.iter().zip(&of_right.joints) {
                assert!(l.pose.position.distance(flip(r.pose.position)) < 1e-5);
                // Mirroring takes each axis to its image; in a right-handed frame, x then points the other way.
                for (axis, sign) in [(Vec3::X, -1.0), (Vec3::Y, 1.0), (Vec3::Z, 1.0)] {
                    let image = flip(r.pose.transform_vector(axis)) * sign;
                    assert!(l.pose.transform_vector(axis).distance(image) < 1e-4);
                }
                assert_eq!(l.radius, r.radius);
            }
            let (skin_of_left, skin_of_right) = (left.skin.posed(&of_left), right.skin.posed(&of_right));
            for (l, r) in skin_of_left.iter().zip(&skin_of_right) {
                assert!(l.distance(flip(*r)) < 2e-5, "{l} is not the image of {r}");
            }
        }
        for (l, r) in left.rig.palm_segments.iter().zip(&right.rig.palm_segments) {
            assert!(l.start.distance(flip(r.start)) < 1e-6 && l.end.distance(flip(r.end)) < 1e-6);
        }
    }
}
