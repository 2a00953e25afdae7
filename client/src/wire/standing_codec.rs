//! Standing grasps and what became of them.

use grasp_proto::v1;

use super::{
    Malformed,
    hand_codec::{digit_from_wire, hand_at_object_from_wire, hand_at_object_to_wire},
};
use crate::standing::{
    Fall, FallReason, HandWay, NoGraspReason, StandingGrasp, StandingReport, StandingStatus,
};

pub(super) fn standing_to_wire(standing: &StandingGrasp) -> v1::StandingGrasp {
    v1::StandingGrasp {
        hand: Some(hand_at_object_to_wire(&standing.hand)),
        present: standing.present.as_ref().map(hand_at_object_to_wire),
        better_by: standing.better_by,
        committed: standing.committed,
    }
}

pub(super) fn report_from_wire(report: v1::StandingReport) -> Result<StandingReport, Malformed> {
    let mut moved_digits = Vec::with_capacity(report.moved_digits.len());
    for &value in &report.moved_digits {
        let digit = digit_from_wire("moved_digits", value)?;
        moved_digits.push(digit.ok_or_else(|| Malformed::unknown_value("moved_digits", value))?);
    }
    Ok(StandingReport {
        status: match v1::StandingStatus::try_from(report.status) {
            Ok(v1::StandingStatus::Kept) => StandingStatus::Kept,
            Ok(v1::StandingStatus::Adjusted) => StandingStatus::Adjusted,
            Ok(v1::StandingStatus::Replanned) => StandingStatus::Replanned,
            Ok(v1::StandingStatus::None) => StandingStatus::None,
            Ok(v1::StandingStatus::Aborted) => StandingStatus::Aborted,
            Ok(v1::StandingStatus::Unspecified) | Err(_) => {
                return Err(Malformed::unknown_value("status", report.status));
            }
        },
        fall: report.fall.map(fall_from_wire),
        no_grasp: no_grasp_from_wire(report.no_grasp),
        moved_digits,
        way: report.way.map(way_from_wire),
        withdrawal: report
            .withdrawal
            .map(hand_at_object_from_wire)
            .transpose()
            .map_err(|malformed| malformed.within("withdrawal"))?,
    })
}

/// None if there is a grasp.
pub(super) fn no_grasp_from_wire(value: i32) -> Option<NoGraspReason> {
    match v1::NoGraspReason::try_from(value) {
        Ok(v1::NoGraspReason::Unspecified) => None,
        Ok(v1::NoGraspReason::GiverInTheWay) => Some(NoGraspReason::GiverInTheWay),
        Ok(v1::NoGraspReason::CannotBeHeld) => Some(NoGraspReason::CannotBeHeld),
        Ok(v1::NoGraspReason::OutOfReach) => Some(NoGraspReason::OutOfReach),
        Ok(v1::NoGraspReason::NotFoundInTime) => Some(NoGraspReason::NotFoundInTime),
        Ok(v1::NoGraspReason::WrongFrame) => Some(NoGraspReason::WrongFrame),
        Err(_) => Some(NoGraspReason::Unrecognised),
    }
}

pub(super) fn way_from_wire(way: v1::HandWay) -> HandWay {
    HandWay {
        distance: way.distance,
        angle: way.angle,
        fingertips: way.fingertips,
        free: way.free,
    }
}

pub(super) fn fall_from_wire(fall: v1::Fall) -> Fall {
    Fall {
        reason: match v1::FallReason::try_from(fall.reason) {
            Ok(v1::FallReason::Giver) => FallReason::Giver,
            Ok(v1::FallReason::Obstacle) => FallReason::Obstacle,
            Ok(v1::FallReason::Penetration) => FallReason::Penetration,
            Ok(v1::FallReason::NotHeld) => FallReason::NotHeld,
            Ok(v1::FallReason::Forbidden) => FallReason::Forbidden,
            Ok(v1::FallReason::OutOfReach) => FallReason::OutOfReach,
            Ok(v1::FallReason::Constraint) => FallReason::Constraint,
            Ok(v1::FallReason::SelfCollision) => FallReason::SelfCollision,
            Ok(v1::FallReason::BetterGrasp) => FallReason::BetterGrasp,
            Ok(v1::FallReason::Unspecified) | Err(_) => FallReason::Unrecognised,
        },
        figure: fall.figure,
        bound: fall.bound,
        description: fall.description,
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::{
        hand::{Digit, DigitAngles, Handedness},
        pose::Pose,
    };

    fn hand(x: f32) -> crate::hand::HandAtObject {
        let mut digits = [DigitAngles::default(); 5];
        digits[3] = DigitAngles {
            base_yaw: 0.1,
            base_pitch: 0.2,
            second_pitch: 0.3,
            third_pitch: Some(0.4),
        };
        crate::hand::HandAtObject {
            rig: "rigs/mine".to_owned(),
            handedness: Handedness::Left,
            hand_scale: Some(1.25),
            object_from_wrist: Pose::new(Vec3::new(x, 0.0, 0.0), Quat::from_xyzw(0.0, 1.0, 0.0, 0.0)),
            digits,
        }
    }

    fn wire_report() -> v1::StandingReport {
        v1::StandingReport {
            status: v1::StandingStatus::Adjusted.into(),
            fall: Some(v1::Fall {
                reason: v1::FallReason::Giver.into(),
                figure: Some(-0.003),
                bound: Some(0.001),
                description: "the hand is 3.0 mm inside another person's hand".to_owned(),
            }),
            no_grasp: v1::NoGraspReason::OutOfReach.into(),
            moved_digits: vec![v1::Digit::Little.into(), v1::Digit::Thumb.into()],
            way: Some(v1::HandWay {
                distance: 1.0,
                angle: 2.0,
                fingertips: 3.0,
                free: true,
            }),
            withdrawal: Some(hand_at_object_to_wire(&hand(4.0))),
        }
    }

    #[test]
    fn sends_every_field_of_a_standing_grasp() {
        let sent = standing_to_wire(&StandingGrasp {
            hand: hand(1.0),
            present: Some(hand(2.0)),
            better_by: Some(0.125),
            committed: true,
        });
        assert_eq!((sent.better_by, sent.committed), (Some(0.125), true));
        assert_eq!(sent.hand.map(hand_at_object_from_wire), Some(Ok(hand(1.0))));
        let present = sent.present.expect("it is sent");
        assert_eq!(
            (present.rig.as_str(), present.handedness(), present.hand_scale),
            ("rigs/mine", v1::Handedness::Left, Some(1.25))
        );
        assert_eq!(present.digits[3].third_pitch, Some(0.4));
        assert_eq!(hand_at_object_from_wire(present), Ok(hand(2.0)));
    }

    #[test]
    fn reads_every_field_of_a_report() {
        let report = report_from_wire(wire_report()).expect("it is well formed");
        let expected = StandingReport {
            status: StandingStatus::Adjusted,
            fall: Some(Fall {
                reason: FallReason::Giver,
                figure: Some(-0.003),
                bound: Some(0.001),
                description: "the hand is 3.0 mm inside another person's hand".to_owned(),
            }),
            no_grasp: Some(NoGraspReason::OutOfReach),
            moved_digits: vec![Digit::Little, Digit::Thumb],
            way: Some(HandWay {
                distance: 1.0,
                angle: 2.0,
                fingertips: 3.0,
                free: true,
            }),
            withdrawal: Some(hand(4.0)),
        };
        assert_eq!(report, expected);
        let json = serde_json::to_string(&expected).unwrap();
        assert!(json.contains(r#""status":"adjusted""#), "{json}");
        assert_eq!(serde_json::from_str::<StandingReport>(&json).unwrap(), expected);
    }

    #[test]
    fn reasons_of_newer_servers_are_unrecognised_but_a_status_is_required() {
        let mut newer = wire_report();
        newer.no_grasp = 99;
        newer.fall.as_mut().unwrap().reason = 99;
        let read = report_from_wire(newer).expect("it is well formed");
        assert_eq!(read.no_grasp, Some(NoGraspReason::Unrecognised));
        assert_eq!(read.fall.unwrap().reason, FallReason::Unrecognised);
        for value in [0, 99] {
            let without = v1::StandingReport {
                status: value,
                ..wire_report()
            };
            assert!(report_from_wire(without).is_err());
        }
        let of_palm = v1::StandingReport {
            moved_digits: vec![0],
            ..wire_report()
        };
        assert!(report_from_wire(of_palm).is_err());
    }
}
