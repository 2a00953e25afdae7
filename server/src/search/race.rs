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
    base::{clock::Clock, stopwatch::StepTimes},
    known::recent_grips::RecentGrips,
    model::{grasp::Grasp, hand::rig::Rig, holdout::Holdout, strategy::Choice},
    search::{
        NearestMiss, SearchEnd, SearchOutcome, SearchReport, find_grasp_in, prepare, settings::SearchSettings,
    },
};
use rayon::ThreadPool;

/// Time that a slice should take: short beside a second's budget, so that searches share the workers evenly; long
/// beside the 50 µs that starting and joining the workers costs.
const SLICE: Duration = Duration::from_millis(10);

/// Attempts a worker in the first slice: about a millisecond of the fastest strategy.
const FIRST_ATTEMPTS_PER_WORKER: u64 = 64;

/// Attempts a worker in any slice at most.
const MOST_ATTEMPTS_PER_WORKER: u64 = 8192;

/// Runs a search to its end. Where it finds nothing by its deadline, and `patience` ends later, it goes on until then, for the
/// first valid grasp.
pub(super) fn race(
    pool: &ThreadPool,
    holdout: &Holdout,
    rig: &Rig,
    settings: &SearchSettings,
    patience: Duration,
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
        let is_enough = best.is_some() && slice.choice == Choice::FirstValid;
        let is_stopped = outcome.end == SearchEnd::Stopped || stop.load(Ordering::Relaxed);
        let is_late = outcome.end == SearchEnd::DeadlinePassed || has_passed(slice.deadline, clock);
        let goes_on = best.is_none() && slice.deadline < Some(patience);
        if is_late && goes_on && !is_stopped && left > 0 {
            slice.choice = Choice::FirstValid;
            slice.deadline = Some(patience);
            // A search that waited for its workers may not have come to them.
            slice.atlas.clone_from(&settings.atlas);
            slice.recent.clone_from(&settings.recent);
        } else if is_enough || is_stopped || is_late || left == 0 {
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

fn has_passed(deadline: Option<Duration>, clock: &dyn Clock) -> bool {
    deadline.is_some_and(|deadline| clock.now() >= deadline)
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
    use std::sync::{Arc, atomic::AtomicU64};

    use glam::Vec3;
    use grasp_assets::{hands::hand, objects::object};
    use grasp_synthesis::{
        base::{pose::Pose, rejection::Rejection},
        known::seed_source::SeedSource,
        model::{
            bend_ratios::BendRatioChoice,
            constraints::Constraints,
            hand::{DigitAngles, HandPose, Handedness},
            strategy::{Strategy, Validity},
        },
    };

    use super::*;

    /// A clock that goes on by a microsecond whenever somebody looks at it.
    #[derive(Debug, Default)]
    struct LookedAt(AtomicU64);

    impl Clock for LookedAt {
        fn now(&self) -> Duration {
            Duration::from_micros(self.0.fetch_add(1, Ordering::Relaxed))
        }
    }

    /// A search by one worker, in looks at the clock.
    fn race_within(choice: Choice, deadline: u64, patience: u64) -> (SearchOutcome, u64) {
        let rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
        let object = &object("remote").expect("it is built in").object;
        let holdout = Holdout::new(Arc::clone(object), None, Vec3::Y).expect("up is a unit vector");
        let settings = SearchSettings {
            seed: 3,
            strategy: Strategy::Guided,
            validity: Validity::Physical,
            bend_ratios: BendRatioChoice::OneRandom,
            friction: object.friction_under(Validity::Physical),
            constraints: Constraints::default(),
            choice,
            atlas: None,
            starts: SeedSource::Nothing,
            recent: RecentGrips::default(),
            known_tried: 0,
            reproducible: false,
            first_attempt: 0,
            max_attempts: 10_000,
            deadline: Some(Duration::from_micros(deadline)),
            workers: 1,
            record_step_times: false,
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .expect("a thread");
        let clock = LookedAt::default();
        let patience = Duration::from_micros(patience);
        let stop = AtomicBool::new(false);
        let outcome = race(&pool, &holdout, rig, &settings, patience, &clock, &stop);
        (outcome, clock.0.into_inner())
    }

    #[test]
    fn patience_is_for_the_first_grasp_alone() {
        let (none, looks) = race_within(Choice::BestWithinBudget, 3, 3);
        assert!(none.grasp.is_none() && none.end == SearchEnd::DeadlinePassed && looks < 20);
        let (late, looks) = race_within(Choice::BestWithinBudget, 3, 1_000_000);
        assert_eq!((late.end, late.report.candidates), (SearchEnd::Found, 1));
        assert!(late.grasp.is_some() && late.report.attempts > 0 && looks < 1_000_000);
        // Where there are grasps in time, the best of them, and no more.
        let (best, looks) = race_within(Choice::BestWithinBudget, 10_000, 1_000_000);
        assert!(best.report.candidates > 1 && (10_000..11_000).contains(&looks));
        assert!(
            best.grasp
                .and_then(|grasp| grasp.score)
                .map(|score| score.total())
                > late
                    .grasp
                    .and_then(|grasp| grasp.score)
                    .map(|score| score.total())
        );
        // Nobody waits longer than they are ready to.
        let (never, looks) = race_within(Choice::BestWithinBudget, 3, 6);
        assert!(never.grasp.is_none() && looks < 20);
    }

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
