//! The check of the joint angles: searches keep the limits as they bend digits, and requests with current grasps are refused.

use super::{Check, Verdict};
use crate::{
    model::hand::{
        Digit, DigitAngles, HandPose, Phalanx,
        rig::{AngleRange, Rig},
    },
    physical::solids::{HandSolids, SolidPart},
};

/// How far an angle may be beyond its limits, in radians: room for the rounding of clients that count in degrees.
const ANGLE_SLACK: f32 = 1e-3;

/// An angle beyond its limits.
struct Excess {
    by: f32,
    digit: Digit,
    phalanx: Phalanx,
    name: &'static str,
    angle: f32,
    range: AngleRange,
}

/// The largest excess of the hand's angles.
pub(super) fn joint_limits(rig: &Rig, pose: &HandPose, solids: &HandSolids) -> Verdict {
    let digits = Digit::ALL.into_iter().filter(|&digit| rig.has(digit));
    let all = digits.flat_map(|digit| excesses(rig, digit, pose.digits[digit.index()]));
    let worst = all.max_by(|a, b| a.by.total_cmp(&b.by));
    let Some(worst) = worst else {
        return Verdict::new(Check::JointLimits, true, "the hand has no digits".to_owned());
    };
    let passed = worst.by <= ANGLE_SLACK;
    let Excess {
        by,
        digit,
        phalanx,
        name,
        angle,
        range: AngleRange { min, max },
    } = worst;
    let part = SolidPart::Phalanx(digit, phalanx);
    Verdict {
        figure: Some(by),
        bound: Some(ANGLE_SLACK),
        part: Some(part),
        at: Some(solids.phalanges[digit.index()][phalanx.index()].start),
        ..Verdict::new(
            Check::JointLimits,
            passed,
            if passed {
                "every angle is within its limits".to_owned()
            } else {
                format!("{name} of the {part} is {angle:.3} rad; its limits are {min:.3} and {max:.3} rad")
            },
        )
    }
}

fn excesses(rig: &Rig, digit: Digit, angles: DigitAngles) -> [Excess; 4] {
    let limits = &rig.digit(digit).limits;
    let excess = |name, phalanx, angle: f32, range: AngleRange| Excess {
        by: (range.min - angle).max(angle - range.max).max(0.0),
        digit,
        phalanx,
        name,
        angle,
        range,
    };
    [
        excess("base_yaw", Phalanx::First, angles.base_yaw, limits.base_yaw),
        excess("base_pitch", Phalanx::First, angles.base_pitch, limits.base_pitch),
        excess(
            "second_pitch",
            Phalanx::Second,
            angles.second_pitch,
            limits.second_pitch,
        ),
        excess(
            "third_pitch",
            Phalanx::Third,
            angles.third_pitch,
            limits.third_pitch,
        ),
    ]
}
