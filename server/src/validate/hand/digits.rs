//! Checks the joint angles of a hand.

use grasp_proto::v1;
use grasp_synthesis::model::hand::{
    Digit, DigitAngles,
    rig::{AngleRange, DigitLimits, Rig},
};

use crate::validate::Field;

/// How far an angle may be outside its limits, in radians, to be clamped: room for clients that clamp in degrees.
const ANGLE_SLACK: f32 = 1e-3;

/// Largest joint angle, in radians: beyond half a turn, it is a mistake of units.
const MAX_ANGLE: f32 = std::f32::consts::PI;

/// The digits' fields, thumb first.
const NAMES: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];

/// What the joint angles of a hand must be within.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::validate) enum AngleBounds {
    /// The limits of the rig. Of one that is not known: half a turn.
    Rig,
    /// Half a turn.
    HalfTurn,
}

/// The digits of the hand at `field`, thumb first. Those that the rig has are required, and others ignored: they are as if
/// stretched. With a rig that is not known, none is required.
pub(in crate::validate) fn checked_digits(
    field: Field<'_>,
    sent: &v1::HandPose,
    rig: Option<&Rig>,
    bounds: AngleBounds,
) -> [DigitAngles; 5] {
    let mut digits = [DigitAngles::default(); 5];
    for (digit, sent) in Digit::ALL.into_iter().zip(sent.digits()) {
        if rig.is_some_and(|rig| !rig.has(digit)) {
            continue;
        }
        let field = field.child(NAMES[digit.index()]);
        let limits = rig.map(|rig| &rig.digit(digit).limits);
        match sent {
            Some(sent) => digits[digit.index()] = digit_angles(field, sent, limits, bounds),
            None if rig.is_some() => field.add("is required; {} is the stretched digit"),
            None => {}
        }
    }
    digits
}

fn digit_angles(
    field: Field<'_>,
    sent: &v1::DigitAngles,
    limits: Option<&DigitLimits>,
    bounds: AngleBounds,
) -> DigitAngles {
    let allowed = limits.filter(|_| bounds == AngleBounds::Rig);
    let checked = |name, angle: f32, range: Option<AngleRange>| match range {
        Some(range) if range.contains(angle, ANGLE_SLACK) => angle.clamp(range.min, range.max),
        Some(range) => {
            field.child(name).add(format_args!(
                "is {angle} rad; the rig allows {} to {}",
                range.min, range.max
            ));
            range.min
        }
        None if angle.abs() <= MAX_ANGLE => angle,
        // NaN comes here, too: the comparison is false for it.
        None => {
            field.child(name).add(format_args!(
                "is {angle} rad; it must be within half a turn, {MAX_ANGLE} rad"
            ));
            0.0
        }
    };
    let coupled = DigitAngles::coupled(
        checked("base_yaw", sent.base_yaw, allowed.map(|limits| limits.base_yaw)),
        checked(
            "base_pitch",
            sent.base_pitch,
            allowed.map(|limits| limits.base_pitch),
        ),
        checked(
            "second_pitch",
            sent.second_pitch,
            allowed.map(|limits| limits.second_pitch),
        ),
    );
    let third_pitch = match sent.third_pitch {
        Some(angle) => checked("third_pitch", angle, allowed.map(|limits| limits.third_pitch)),
        None => limits.map_or(coupled.third_pitch, |limits| limits.clamped(coupled).third_pitch),
    };
    DigitAngles {
        third_pitch,
        ..coupled
    }
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands;
    use grasp_synthesis::model::hand::Handedness;

    use super::*;
    use crate::validate::testing::read_at;

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
        let read = |angles: &v1::DigitAngles, bounds| {
            read_at("hand", |field| digit_angles(field, angles, Some(limits), bounds))
        };
        let (within, blamed) = read(&angles, AngleBounds::Rig);
        assert!(blamed.is_empty());
        assert_eq!(within.second_pitch, limit);
        let coupled = (limit * 2.0 / 3.0).min(limits.third_pitch.max);
        assert!((within.third_pitch - coupled).abs() < 1e-6);
        let over = v1::DigitAngles {
            second_pitch: limit + 2.0 * ANGLE_SLACK,
            ..angles
        };
        assert_eq!(read(&over, AngleBounds::Rig).1, ["hand.second_pitch"]);
        // Where they are only to be read, they stay as they are.
        let (unbounded, blamed) = read(&over, AngleBounds::HalfTurn);
        assert!(blamed.is_empty());
        assert_eq!(unbounded.second_pitch, over.second_pitch);
    }

    #[test]
    fn requires_the_digits_of_a_known_rig() {
        let hand = hands::hand("adult", Handedness::Right).expect("the rig is built in");
        let sent = v1::HandPose {
            index: Some(v1::DigitAngles::default()),
            ring: Some(v1::DigitAngles {
                base_yaw: f32::NAN,
                ..Default::default()
            }),
            ..Default::default()
        };
        for (rig, expected) in [
            (
                Some(&*hand.rig),
                &["hand.thumb", "hand.middle", "hand.ring.base_yaw", "hand.little"][..],
            ),
            (None, &["hand.ring.base_yaw"][..]),
        ] {
            let (_, blamed) = read_at("hand", |field| {
                checked_digits(field, &sent, rig, AngleBounds::Rig)
            });
            assert_eq!(blamed, expected);
        }
    }
}
