//! Converts grasps and reports to messages in the client's frame and convention.

mod grasp;
mod verdicts;

use std::time::Duration;

use glam::Vec3;
use grasp_proto::{v1, wire_duration};
use grasp_synthesis::{
    base::{pose::Pose, rejection::Rejection},
    known::atlas::Atlas,
    model::hand::{Digit, Handedness},
    search::{
        GraspSource, SearchEnd, SearchOutcome, SearchReport,
        current::{CurrentGraspStatus, CurrentGraspVerdict, FailedCheck, HandWay},
        settings::SearchSettings,
    },
};

use self::{
    grasp::{kept_grasp, wire_hand, wire_wrist},
    verdicts::{wire_failed_check, wire_limit},
};
pub(crate) use self::{
    grasp::{wire_grasp, wire_joint},
    verdicts::{settle_margins, wire_check, wire_rejection, wire_verdict},
};
use crate::{
    convention::Convention,
    error::ServiceError,
    rigs::RigHand,
    wire::{wire_digit, wire_handedness},
};

#[derive(Clone, Copy, Debug)]
pub(crate) struct ClientFrame {
    pub convention: Convention,
    /// The object in the client's frame, in `OpenXR` axes.
    pub client_from_object: Pose,
    /// True if grasps are packed as well.
    pub packs: bool,
}

impl ClientFrame {
    fn point(self, at: Vec3) -> v1::Vector3 {
        let in_client = self.client_from_object.transform_point(at);
        self.convention.point_from_openxr(in_client).into()
    }
}

#[derive(Debug)]
pub(crate) struct Circumstances<'a> {
    pub search_time: Duration,
    pub budget: Duration,
    pub origin: v1::GraspOrigin,
    /// Names of the preferred grips that were tried and not answered, and why.
    pub passed_over: &'a [(&'a str, FailedCheck)],
    pub warnings: Vec<String>,
    /// True if the client knows the grasp, and wants only the changes.
    pub is_known: bool,
}

pub(crate) fn find_response(
    outcome: &SearchOutcome,
    (hand, other_hand): (&RigHand, Option<&RigHand>),
    frame: ClientFrame,
    circumstances: Circumstances<'_>,
) -> Result<v1::FindGraspResponse, ServiceError> {
    let wire_outcome = match outcome.end {
        SearchEnd::Found => v1::Outcome::Found,
        SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted => v1::Outcome::BudgetExhausted,
        SearchEnd::Aborted => v1::Outcome::Aborted,
        SearchEnd::Stopped => return Err(ServiceError::Cancelled),
    };
    let first = outcome.grasp.as_ref();
    let other = first.and_then(|grasp| grasp.other_hand.as_deref());
    let hands = [first.zip(Some(hand)), other.zip(other_hand)];
    let message = if circumstances.is_known {
        kept_grasp
    } else {
        wire_grasp
    };
    let passed_over = circumstances.passed_over.iter();
    let passed_over = passed_over.map(|(name, failed)| v1::Verdict {
        subject: (*name).to_owned(),
        ..wire_failed_check(failed, frame.convention)
    });
    Ok(v1::FindGraspResponse {
        outcome: wire_outcome.into(),
        grasps: hands
            .into_iter()
            .flatten()
            .map(|(grasp, hand)| message(grasp, hand, frame))
            .collect(),
        current: None,
        report: Some(v1::SearchReport {
            search_time: Some(wire_duration(circumstances.search_time)),
            budget: Some(wire_duration(circumstances.budget)),
            warnings: circumstances.warnings,
            passed_over: passed_over.collect(),
            ..report(&outcome.report, hand, frame)
        }),
        origin: Some(circumstances.origin),
    })
}

fn report(report: &SearchReport, hand: &RigHand, frame: ClientFrame) -> v1::SearchReport {
    let rejections = Rejection::ALL.into_iter().zip(report.rejections);
    let rejections = rejections.filter(|&(_, count)| count > 0);
    let limits = report.limits.iter();
    let thesis = v1::ThesisReport {
        pruned_placements: report.pruned_placements,
        step_times: report
            .step_times
            .map_or_else(Vec::new, |times| times.map(wire_duration).into()),
    };
    v1::SearchReport {
        attempts: report.attempts,
        rejections: rejections
            .map(|(rejection, count)| v1::CheckCount {
                check: wire_rejection(rejection).into(),
                count,
            })
            .collect(),
        nearest_miss: report.nearest_miss.as_ref().map(|miss| v1::NearestMiss {
            verdict: Some(v1::Verdict {
                check: wire_rejection(miss.rejection).into(),
                value: miss.wrench_angle,
                ..v1::Verdict::default()
            }),
            attempt: miss.attempt,
            hand: Some(wire_wrist(&miss.pose, hand, frame)),
        }),
        limits: limits.map(|limit| wire_limit(limit, frame.convention)).collect(),
        thesis: Some(thesis).filter(|thesis| *thesis != v1::ThesisReport::default()),
        ..v1::SearchReport::default()
    }
}

/// Where a grasp came from, without the name of a known grip and the atlases.
pub(crate) fn wire_origin(source: Option<GraspSource>, seed: u64) -> v1::GraspOrigin {
    let (wire_source, attempt) = match source {
        None => (v1::GraspSource::Unspecified, None),
        Some(GraspSource::Attempt(attempt)) => (v1::GraspSource::Search, Some(attempt)),
        Some(GraspSource::Atlas(_)) => (v1::GraspSource::Atlas, None),
        Some(GraspSource::Learned(_)) => (v1::GraspSource::Learned, None),
        Some(GraspSource::Current) => (v1::GraspSource::Current, None),
        Some(GraspSource::Preferred(_)) => (v1::GraspSource::KnownGrip, None),
    };
    v1::GraspOrigin {
        source: wire_source.into(),
        seed,
        attempt,
        ..v1::GraspOrigin::default()
    }
}

/// The atlas that a search with a hand uses, with the learned one beside it; `None` if it knows nothing.
pub(crate) fn atlas_used(
    object_id: &str,
    handedness: Handedness,
    settings: &SearchSettings,
) -> Option<v1::Atlas> {
    let atlas = settings.known.seeds.atlas();
    let atlas = atlas.filter(|atlas| !atlas.entries().is_empty());
    let learned = settings.learned();
    (atlas.is_some() || learned.is_some())
        .then(|| wire_atlas(object_id, handedness, atlas.map(|atlas| &**atlas), learned))
}

/// The known grips of an object and a hand, without the atlas's growth.
pub(crate) fn wire_atlas(
    object_id: &str,
    handedness: Handedness,
    atlas: Option<&Atlas>,
    learned: Option<&Atlas>,
) -> v1::Atlas {
    let side = match handedness {
        Handedness::Left => "left",
        Handedness::Right => "right",
    };
    let [(entry_count, stamp), (learned_count, learned_stamp)] = [atlas, learned].map(|atlas| match atlas {
        Some(atlas) if !atlas.entries().is_empty() => {
            let count = u32::try_from(atlas.entries().len()).unwrap_or(u32::MAX);
            (count, format!("{:016x}", atlas.stamp()))
        }
        _ => (0, String::new()),
    });
    v1::Atlas {
        name: format!("objects/{object_id}/atlases/{side}"),
        handedness: wire_handedness(handedness).into(),
        entry_count,
        stamp,
        learned_count,
        learned_stamp,
        growth: v1::AtlasGrowth::Unspecified.into(),
    }
}

/// The report on a current grasp. `hand` is that of the verdict's withdrawal.
pub(crate) fn current_report(
    verdict: &CurrentGraspVerdict,
    hand: &RigHand,
    frame: ClientFrame,
) -> v1::CurrentGraspReport {
    let failed = verdict.failed_check.as_ref();
    let moved = Digit::ALL.into_iter().zip(verdict.moved);
    let moved = moved.filter(|(_, is_moved)| *is_moved);
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
        moved_digits: moved.map(|(digit, _)| wire_digit(digit).into()).collect(),
        motion: verdict.way.as_ref().map(|way| wire_motion(way, frame.convention)),
        withdrawal: verdict
            .withdrawal
            .as_ref()
            .map(|pose| wire_hand(pose, hand, frame)),
    }
}

pub(crate) fn wire_motion(way: &HandWay, convention: Convention) -> v1::HandMotion {
    v1::HandMotion {
        distance: convention.length_from_openxr(way.distance),
        angle: way.angle,
        fingertips: convention.length_from_openxr(way.fingertips),
        free: way.is_free,
    }
}
