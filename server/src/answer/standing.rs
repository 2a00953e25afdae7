//! Converts what became of a standing grasp to a message.

use grasp_proto::v1;
use grasp_synthesis::{
    model::hand::{Digit, HandPose, joints::openxr_from_thesis_frame},
    search::standing::{Fall, FallReason, HandWay, NoGraspReason, StandingStatus, StandingVerdict},
};

use super::{ClientFrame, wire_digit, wire_digits, wire_handedness, wire_pose};
use crate::{convention::Convention, rigs::RigHand};

/// The report on a standing grasp. `hand` is that of the verdict's withdrawal.
pub(crate) fn standing_report(
    verdict: &StandingVerdict,
    hand: &RigHand,
    frame: ClientFrame,
) -> v1::StandingReport {
    let moved = Digit::ALL.into_iter().zip(verdict.moved);
    v1::StandingReport {
        status: match verdict.status {
            StandingStatus::Kept => v1::StandingStatus::Kept,
            StandingStatus::Adjusted => v1::StandingStatus::Adjusted,
            StandingStatus::Replanned => v1::StandingStatus::Replanned,
            StandingStatus::None => v1::StandingStatus::None,
            StandingStatus::Aborted => v1::StandingStatus::Aborted,
        }
        .into(),
        fall: verdict.fall.as_ref().map(wire_fall),
        no_grasp: match verdict.no_grasp {
            None => v1::NoGraspReason::Unspecified,
            Some(NoGraspReason::GiverInTheWay) => v1::NoGraspReason::GiverInTheWay,
            Some(NoGraspReason::CannotBeHeld) => v1::NoGraspReason::CannotBeHeld,
            Some(NoGraspReason::OutOfReach) => v1::NoGraspReason::OutOfReach,
            Some(NoGraspReason::NotFoundInTime) => v1::NoGraspReason::NotFoundInTime,
        }
        .into(),
        moved_digits: moved
            .filter(|(_, is_moved)| *is_moved)
            .map(|(digit, _)| wire_digit(digit).into())
            .collect(),
        way: verdict.way.as_ref().map(|way| wire_way(way, frame.convention)),
        withdrawal: verdict
            .withdrawal
            .as_ref()
            .map(|pose| hand_at_object(pose, hand, frame.convention)),
    }
}

pub(super) fn wire_fall(fall: &Fall) -> v1::Fall {
    v1::Fall {
        reason: match fall.reason {
            FallReason::Giver => v1::FallReason::Giver,
            FallReason::Obstacle => v1::FallReason::Obstacle,
            FallReason::Penetration => v1::FallReason::Penetration,
            FallReason::SelfCollision => v1::FallReason::SelfCollision,
            FallReason::Forbidden => v1::FallReason::Forbidden,
            FallReason::OutOfReach | FallReason::OutOfConstrainedReach => v1::FallReason::OutOfReach,
            FallReason::Approach
            | FallReason::BannedGrip
            | FallReason::Digits
            | FallReason::GraspType
            | FallReason::Comfort => v1::FallReason::Constraint,
            FallReason::NotClosed | FallReason::Unbalanced => v1::FallReason::NotHeld,
            FallReason::BetterGrasp => v1::FallReason::BetterGrasp,
        }
        .into(),
        figure: fall.figure,
        bound: fall.bound,
        description: fall.to_string(),
    }
}

/// A way to a hand.
pub(crate) fn wire_way(way: &HandWay, convention: Convention) -> v1::HandWay {
    v1::HandWay {
        distance: convention.length_from_openxr(way.distance),
        angle: way.angle,
        fingertips: convention.length_from_openxr(way.fingertips),
        free: way.is_free,
    }
}

fn hand_at_object(pose: &HandPose, hand: &RigHand, convention: Convention) -> v1::HandAtObject {
    let rig = &hand.hand.rig;
    let wrist = openxr_from_thesis_frame(pose.frame_from_wrist);
    v1::HandAtObject {
        rig: rig.name.clone(),
        handedness: wire_handedness(rig.handedness).into(),
        hand_scale: (hand.scale != 1.0).then_some(hand.scale),
        object_from_wrist: Some(wire_pose(convention.joint_at_object_from_openxr(wrist))),
        digits: wire_digits(rig, pose),
    }
}
