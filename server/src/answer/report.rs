//! Converts what a search did, and what became of a current grasp, to messages.

use std::time::Duration;

use grasp_proto::{v1, wire_duration};
use grasp_synthesis::{
    base::rejection::Rejection,
    known::atlas::Atlas,
    model::hand::{Digit, Handedness},
    search::{
        GraspSource, NearestMiss, SearchEnd, SearchOutcome, SearchReport,
        current::{CurrentGraspStatus, CurrentGraspVerdict, FailedCheck, HandWay},
        settings::SearchSettings,
    },
};

use super::{
    ClientFrame,
    grasp::{kept_grasp, wire_grasp},
    hand::{wire_hand, wire_wrist},
    verdicts::{wire_check, wire_failed_check, wire_limit, wire_rejection},
};
use crate::{
    convention::Convention,
    error::ServiceError,
    rigs::RigHand,
    wire::{wire_digit, wire_handedness},
};

/// What a response contains in addition to the outcome of the search.
#[derive(Debug)]
pub(crate) struct Circumstances<'a> {
    /// Wall time of the search.
    pub search_time: Duration,
    /// Budget in force.
    pub budget: Duration,
    /// Where the grasp came from.
    pub origin: v1::GraspOrigin,
    /// Names of the preferred grips that were tried and not answered, and why.
    pub passed_over: &'a [(&'a str, FailedCheck)],
    /// What was repaired in the request.
    pub warnings: Vec<String>,
    /// True if the client knows the grasp, and wants only what changed.
    pub is_known: bool,
}

/// The response to a `FindGrasp` request.
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
            passed_over: circumstances
                .passed_over
                .iter()
                .map(|(name, failed)| v1::Verdict {
                    subject: (*name).to_owned(),
                    ..wire_failed_check(failed, frame.convention)
                })
                .collect(),
            ..report(&outcome.report, hand, frame)
        }),
        origin: Some(circumstances.origin),
    })
}

/// What the search itself reports.
fn report(report: &SearchReport, hand: &RigHand, frame: ClientFrame) -> v1::SearchReport {
    v1::SearchReport {
        attempts: report.attempts,
        rejections: Rejection::ALL
            .into_iter()
            .zip(report.rejections)
            .filter(|&(_, count)| count > 0)
            .map(|(rejection, count)| v1::CheckCount {
                check: wire_rejection(rejection).into(),
                count,
            })
            .collect(),
        nearest_miss: report
            .nearest_miss
            .as_ref()
            .map(|miss| nearest_miss(miss, hand, frame)),
        limits: report
            .limits
            .iter()
            .map(|limit| wire_limit(limit, frame.convention))
            .collect(),
        thesis: Some(v1::ThesisReport {
            pruned_placements: report.pruned_placements,
            step_times: report
                .step_times
                .map_or_else(Vec::new, |times| times.map(wire_duration).into()),
        })
        .filter(|thesis| *thesis != v1::ThesisReport::default()),
        ..v1::SearchReport::default()
    }
}

fn nearest_miss(miss: &NearestMiss, hand: &RigHand, frame: ClientFrame) -> v1::NearestMiss {
    v1::NearestMiss {
        verdict: Some(v1::Verdict {
            check: wire_rejection(miss.rejection).into(),
            value: miss.wrench_angle,
            ..v1::Verdict::default()
        }),
        attempt: miss.attempt,
        hand: Some(wire_wrist(&miss.pose, hand, frame)),
    }
}

/// Where a grasp came from, without the name of a known grip and the atlases.
pub(crate) fn wire_origin(source: Option<GraspSource>, seed: u64) -> v1::GraspOrigin {
    let wire_source = match source {
        None => v1::GraspSource::Unspecified,
        Some(GraspSource::Attempt(_)) => v1::GraspSource::Search,
        Some(GraspSource::Atlas(_)) => v1::GraspSource::Atlas,
        Some(GraspSource::Learned(_)) => v1::GraspSource::Learned,
        Some(GraspSource::Current) => v1::GraspSource::Current,
        Some(GraspSource::Preferred(_)) => v1::GraspSource::KnownGrip,
    };
    v1::GraspOrigin {
        source: wire_source.into(),
        seed,
        attempt: match source {
            Some(GraspSource::Attempt(attempt)) => Some(attempt),
            _ => None,
        },
        ..v1::GraspOrigin::default()
    }
}

/// The atlas that a search with a hand uses, with what was learned beside it; `None` if it knows nothing.
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

/// The known grips of an object and a hand; whether they become more is not said.
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
    let (entry_count, stamp) = atlas.map_or_else(Default::default, |atlas| {
        counted(atlas.entries().len(), atlas.stamp())
    });
    let (learned_count, learned_stamp) = learned.map_or_else(Default::default, |learned| {
        counted(learned.entries().len(), learned.stamp())
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

/// The number of some grips and their stamp, which is empty without any.
fn counted(count: usize, stamp: u64) -> (u32, String) {
    let stamp = if count == 0 {
        String::new()
    } else {
        format!("{stamp:016x}")
    };
    (u32::try_from(count).unwrap_or(u32::MAX), stamp)
}

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
