//! A search, in slices.
//!
//! The workers are shared by all searches, and a search that found nothing yet would hold them until its budget is
//! spent. So it runs slice by slice: after each, its next one queues behind the slices of the other searches. The
//! slices cover consecutive attempts, so that slicing changes nothing about which attempt wins a reproducible search.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use grasp_synthesis::{
    atlas::recent::RecentGrips,
    clock::Clock,
    grasp::Grasp,
    hand::rig::Rig,
    holdout::Holdout,
    search::{
        NearestMiss, SearchEnd, SearchOutcome, SearchReport, SearchSettings, StepTimes, find_grasp_in,
        prepare,
    },
    strategy::Choice,
};
use rayon::ThreadPool;

/// Time that a slice should take: short beside a second's budget, so that searches share the workers evenly; long
/// beside the 50 µs that starting and joining the workers costs.
const SLICE: Duration = Duration::from_millis(10);

/// Attempts a worker in the first slice: about a millisecond of the fastest strategy.
const FIRST_ATTEMPTS_PER_WORKER: u64 = 64;

/// Attempts a worker in any slice at most.
const MOST_ATTEMPTS_PER_WORKER: u64 = 8192;

/// Runs a search to its end.
pub(super) fn race(
    pool: &ThreadPool,
    holdout: &Holdout,
    rig: &Rig,
    settings: &SearchSettings,
    clock: &dyn Clock,
    stop: &AtomicBool,
) -> SearchOutcome {
    let scene = prepare(holdout, rig, settings);
    let workers = settings.workers as u64;
    let mut total = SearchReport::default();
    let mut slice = settings.clone();
    let mut left = settings.max_attempts;
    let mut per_worker = FIRST_ATTEMPTS_PER_WORKER;
    let mut best: Option<(Grasp, f32)> = None;
    loop {
        slice.max_attempts = left.min(per_worker.saturating_mul(workers));
        let start = clock.now();
        let outcome = find_grasp_in(pool, &scene, &slice, clock, stop);
        // Known grips are all tried in the first slice.
        slice.atlas = None;
        slice.recent = RecentGrips::default();
        left -= slice.max_attempts;
        let is_better =
            outcome.grasp.is_some() && best.as_ref().is_none_or(|(_, value)| outcome.value > *value);
        merge(&mut total, outcome.report, is_better);
        if is_better {
            best = outcome.grasp.map(|grasp| (grasp, outcome.value));
        }
        // The first valid grasp ends the search; the best is looked for as long as there is time.
        let is_enough = best.is_some() && settings.choice == Choice::FirstValid;
        let is_over = matches!(outcome.end, SearchEnd::DeadlinePassed | SearchEnd::Stopped)
            || clock_has_passed(settings, clock)
            || stop.load(Ordering::Relaxed);
        if is_enough || is_over || left == 0 {
            if best.is_some() {
                // A miss is of interest only when nothing was hit.
                total.nearest_miss = None;
            }
            let end = match (&best, outcome.end) {
                (_, SearchEnd::Stopped) => SearchEnd::Stopped,
                (Some(_), _) => SearchEnd::Found,
                (None, end) => end,
            };
            return SearchOutcome {
                end,
                value: best.as_ref().map_or(0.0, |(_, value)| *value),
                grasp: best.map(|(grasp, _)| grasp),
                report: total,
            };
        }
        slice.first_attempt += slice.max_attempts;
        per_worker = next_size(per_worker, clock.now().saturating_sub(start));
    }
}

/// Attempts a worker in the next slice, when `size` of them took `elapsed`. At most doubled, so that one lucky slice
/// does not make a long one.
fn next_size(size: u64, elapsed: Duration) -> u64 {
    let fitting = u128::from(size) * SLICE.as_nanos() / elapsed.as_nanos().max(1);
    u64::try_from(fitting)
        .unwrap_or(u64::MAX)
        .clamp(1, (2 * size).min(MOST_ATTEMPTS_PER_WORKER))
}

fn clock_has_passed(settings: &SearchSettings, clock: &dyn Clock) -> bool {
    settings.deadline.is_some_and(|deadline| clock.now() >= deadline)
}

/// Adds what a slice did; its grasp `is_better` than those before.
fn merge(total: &mut SearchReport, slice: SearchReport, is_better: bool) {
    total.attempts += slice.attempts;
    total.pruned_placements += slice.pruned_placements;
    for (sum, count) in total.rejections.iter_mut().zip(slice.rejections) {
        *sum += count;
    }
    if let Some(times) = slice.step_times {
        let sum = total.step_times.get_or_insert_with(StepTimes::default);
        sum.wrist_placement += times.wrist_placement;
        sum.finger_posing += times.finger_posing;
        sum.collision_validation += times.collision_validation;
        sum.contact_validation += times.contact_validation;
        sum.immobility_validation += times.immobility_validation;
    }
    if is_better {
        total.attempt = slice.attempt;
        total.source = slice.source;
    }
    total.candidates += slice.candidates;
    total.known_grips = total.known_grips.max(slice.known_grips);
    total.nearest_miss = match (total.nearest_miss.take(), slice.nearest_miss) {
        (Some(a), Some(b)) => Some(if closeness(&b) > closeness(&a) { b } else { a }),
        (a, b) => a.or(b),
    };
}

/// Larger for a miss that came closer: further through the checks of Algorithm 1, then the smaller wrench angle.
fn closeness(miss: &NearestMiss) -> (usize, f32) {
    (
        miss.rejection.index(),
        -miss.wrench_angle.unwrap_or(f32::INFINITY),
    )
}

#[cfg(test)]
mod tests {
    use grasp_synthesis::{
        hand::{DigitAngles, HandPose},
        pose::Pose,
        rejection::Rejection,
    };

    use super::*;

    fn miss(rejection: Rejection, wrench_angle: Option<f32>, attempt: u64) -> NearestMiss {
        NearestMiss {
            rejection,
            attempt,
            wrench_angle,
            pose: HandPose {
                frame_from_wrist: Pose::IDENTITY,
                digits: [DigitAngles::default(); 5],
            },
        }
    }

    #[test]
    fn slices_grow_to_their_time_and_shrink_to_one_attempt() {
        assert_eq!(next_size(64, Duration::from_millis(1)), 128, "doubled at most");
        assert_eq!(next_size(64, Duration::from_millis(20)), 32);
        assert_eq!(next_size(64, Duration::from_secs(100)), 1);
        assert_eq!(next_size(8192, Duration::ZERO), 8192, "the maximum");
    }

    #[test]
    fn reports_add_up_and_the_closest_miss_stays() {
        let slice = |nearest_miss| SearchReport {
            attempts: 5,
            pruned_placements: 7,
            rejections: [1, 0, 0, 0, 0, 0, 0, 4, 0],
            step_times: Some(StepTimes {
                finger_posing: Duration::from_micros(3),
                ..StepTimes::default()
            }),
            attempt: None,
            nearest_miss,
            ..SearchReport::default()
        };
        let mut total = SearchReport::default();
        merge(
            &mut total,
            slice(Some(miss(Rejection::NotImmobilizing, Some(0.4), 3))),
            false,
        );
        merge(
            &mut total,
            slice(Some(miss(Rejection::PalmCollision, None, 8))),
            false,
        );
        merge(
            &mut total,
            slice(Some(miss(Rejection::NotImmobilizing, Some(0.2), 12))),
            false,
        );
        merge(&mut total, slice(None), false);
        assert_eq!((total.attempts, total.pruned_placements), (20, 28));
        assert_eq!(total.rejections, [4, 0, 0, 0, 0, 0, 0, 16, 0]);
        assert_eq!(total.step_times.unwrap().finger_posing, Duration::from_micros(12));
        assert_eq!(total.nearest_miss.unwrap().attempt, 12);
    }
}
