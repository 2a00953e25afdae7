//! Converts what became of a current grasp to a message.

use grasp_proto::v1;
use grasp_synthesis::{
    model::hand::Digit,
    search::current::{CurrentGraspStatus, CurrentGraspVerdict, HandWay},
};

use super::{
    ClientFrame,
    hand::wire_hand,
    verdicts::{wire_check, wire_failed_check},
};
use crate::{convention::Convention, rigs::RigHand, wire::wire_digit};

/// The report on a current grasp. `hand` is that of the verdict's withdrawal.
pub(crate) fn current_report(
    verdict: &CurrentGraspVerdict,
    hand: &RigHand,
    frame: ClientFrame,
) -> v1::CurrentGraspReport {
    let failed = verdict.failed_check.as_ref();
    let moved = Digit::ALL.into_iter().zip(verdict.moved);
    v1::CurrentGraspReport {
        status: match verdict.status {
            CurrentGraspStatus::Kept => v1::CurrentGraspStatus::Kept,
            CurrentGraspStatus::Adjusted => v1::CurrentGraspStatus::Adjusted,
            CurrentGraspStatus::Replanned => v1::CurrentGraspStatus::Replanned,
            CurrentGraspStatus::None => v1::CurrentGraspStatus::None,
            CurrentGraspStatus::Aborted => v1::CurrentGraspStatus::Aborted,
        }
        .into(),
        failed_check: failed.map(|failed| wire_failed_check(failed, frame.convention)),
        no_grasp: verdict.no_grasp.map_or(v1::Check::Unspecified, wire_check).into(),
        moved_digits: moved
            .filter(|(_, is_moved)| *is_moved)
            .map(|(digit, _)| wire_digit(digit).into())
            .collect(),
        motion: verdict.way.as_ref().map(|way| wire_motion(way, frame.convention)),
        withdrawal: verdict
            .withdrawal
            .as_ref()
            .map(|pose| wire_hand(pose, hand, frame)),
    }
}

/// The way to a hand.
pub(crate) fn wire_motion(way: &HandWay, convention: Convention) -> v1::HandMotion {
    v1::HandMotion {
        distance: convention.length_from_openxr(way.distance),
        angle: way.angle,
        fingertips: convention.length_from_openxr(way.fingertips),
        free: way.is_free,
    }
}
