//! Checks a hand given as joint angles of a rig.

use std::sync::Arc;

use grasp_proto::v1;
use grasp_synthesis::model::hand::{
    DigitAngles, HandPose, Handedness,
    joints::{HandJoints, thesis_from_openxr_frame},
    rig::{AngleRange, DigitLimits},
};

use super::{JointedHand, hand_scale, required_handedness, rig_named};
use crate::{
    convention::Convention,
    rigs::store::RigStore,
    validate::{Field, Violations, pose},
};

/// How far a joint angle may be outside its limits, in radians, before it is rejected rather than clamped: room for the
/// rounding of clients that clamp in degrees.
const ANGLE_SLACK: f32 = 1e-3;

/// The hand in the client's frame; none if it is wrong.
pub(super) fn angled_hand(
    field: Field<'_>,
    angles: &v1::HandAngles,
    convention: Convention,
    rigs: &RigStore,
    violations: &mut Violations,
) -> Option<JointedHand> {
    let handedness = required_handedness(field.child("handedness"), angles.handedness, violations);
    // Both hands have the same limits, which are checked even if the handedness is missing.
    let rig = rig_named(field.child("rig"), &angles.rig, rigs, violations);
    let scale = hand_scale(field.child("hand_scale"), angles.hand_scale, violations);
    let client_from_wrist = pose(
        field.child("client_from_wrist"),
        angles.client_from_wrist,
        convention.metres_per_unit(),
        violations,
    );
    let digits_field = field.child("digits");
    let Some(rig) = rig else {
        check_count(digits_field, &angles.digits, violations);
        return None;
    };
    let hand = &rig.hand(handedness.unwrap_or(Handedness::Right)).hand;
    let limits = hand.rig.digits.map(|digit| digit.limits);
    let digits = checked_digits(digits_field, &angles.digits, &limits, violations);
    handedness?;
    let pose = HandPose {
        frame_from_wrist: thesis_from_openxr_frame(convention.joint_to_openxr(client_from_wrist)),
        digits,
    };
    Some(JointedHand {
        joints: HandJoints::of_pose(&hand.rig.scaled(scale), &pose),
        skin: Arc::clone(&hand.skin),
        field: "presenting_hand.angles",
        warnings: Vec::new(),
    })
}

/// Five digits within limits, thumb first.
pub(in crate::validate) fn checked_digits(
    field: Field<'_>,
    sent: &[v1::DigitAngles],
    limits: &[DigitLimits; 5],
    violations: &mut Violations,
) -> [DigitAngles; 5] {
    check_count(field, sent, violations);
    let mut digits = [DigitAngles::default(); 5];
    for (place, (digit, sent)) in digits.iter_mut().zip(sent).enumerate() {
        *digit = digit_angles(field.at(place), sent, &limits[place], violations);
    }
    digits
}

pub(super) fn check_count(field: Field<'_>, sent: &[v1::DigitAngles], violations: &mut Violations) {
    if sent.len() != 5 {
        violations.add(
            field,
            format_args!("has {} digits; it must have 5, thumb first", sent.len()),
        );
    }
}

fn digit_angles(
    field: Field<'_>,
    sent: &v1::DigitAngles,
    limits: &DigitLimits,
    violations: &mut Violations,
) -> DigitAngles {
    let mut checked = |name, angle: f32, range: AngleRange| {
        if !range.contains(angle, ANGLE_SLACK) {
            violations.add(
                field.child(name),
                format_args!("is {angle} rad; the rig allows {} to {}", range.min, range.max),
            );
            return range.min;
        }
        angle.clamp(range.min, range.max)
    };
    let base_yaw = checked("base_yaw", sent.base_yaw, limits.base_yaw);
    let base_pitch = checked("base_pitch", sent.base_pitch, limits.base_pitch);
    let second_pitch = checked("second_pitch", sent.second_pitch, limits.second_pitch);
    let third_pitch = match sent.third_pitch {
        Some(angle) => checked("third_pitch", angle, limits.third_pitch),
        None => (DigitAngles::THIRD_PITCH_SHARE * second_pitch)
            .clamp(limits.third_pitch.min, limits.third_pitch.max),
    };
    DigitAngles {
        base_yaw,
        base_pitch,
        second_pitch,
        third_pitch,
    }
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands;

    use super::*;

    const FIELD: Field<'static> = Field::root("presenting_hand");

    #[test]
    fn clamps_angles_within_the_slack_and_couples_absent_ones() {
        let hand = hands::hand("thesis", Handedness::Right).expect("the rig is built in");
        let limits = &hand.rig.digits[1].limits;
        let limit = limits.second_pitch.max;
        let angles = v1::DigitAngles {
            base_yaw: 0.0,
            base_pitch: 0.1,
            second_pitch: limit + 0.5 * ANGLE_SLACK,
            third_pitch: None,
        };
        let mut violations = Violations::default();
        let read = digit_angles(FIELD, &angles, limits, &mut violations);
        assert!(violations.is_empty());
        assert_eq!(read.second_pitch, limit);
        let coupled = (limit * 2.0 / 3.0).min(limits.third_pitch.max);
        assert!((read.third_pitch - coupled).abs() < 1e-6);
        let over = v1::DigitAngles {
            second_pitch: limit + 2.0 * ANGLE_SLACK,
            ..angles
        };
        digit_angles(FIELD, &over, limits, &mut violations);
        assert_eq!(violations.len(), 1);
    }
}
