//! Forward kinematics against Equation 4.2, written out with 4×4 matrices in double precision.

use glam::DMat4;

use crate::prelude::*;

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
