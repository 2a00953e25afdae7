//! Runs a search in slices, so that concurrent searches share the workers.
//!
//! A search without a grasp would otherwise hold the workers until its budget ends. Each slice queues behind the slices
//! of other searches. Slices cover consecutive attempts: slicing does not change which attempt wins a reproducible
//! search.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use grasp_synthesis::{
    base::clock::Clock,
    known::recent_grips::RecentGrips,
    model::strategy::Choice,
    search::{SearchEnd, SearchOutcome, find_grasp_in, prepare, scene::Task, settings::SearchSettings},
};
use rayon::ThreadPool;

use super::progress::{Found, Progress};

/// Target duration of a slice: short compared to a budget of a second, so that searches share the workers evenly, and
/// long compared to the 50 µs that starting and joining the workers costs.
const SLICE: Duration = Duration::from_millis(10);

/// Attempts per worker in the first slice: about a millisecond of the fastest strategy.
const FIRST_ATTEMPTS_PER_WORKER: u64 = 64;

/// Largest number of attempts per worker in a slice.
const MOST_ATTEMPTS_PER_WORKER: u64 = 8192;

/// Runs a search to its end. If it finds nothing by its deadline and `patience` ends later, it continues until then and
/// takes the first valid grasp. Adds each slice to `progress`, which must be empty.
pub(super) fn search_in_slices(
    pool: &ThreadPool,
    task: Task<'_>,
    settings: &SearchSettings,
    patience: Duration,
    clock: &dyn Clock,
    stop: &AtomicBool,
    progress: &Progress,
) -> SearchOutcome {
    let scene = prepare(task, settings);
    let workers = settings.run.workers as u64;
    let mut slice = settings.clone();
    let mut left = settings.run.max_attempts;
    let mut per_worker = FIRST_ATTEMPTS_PER_WORKER;
    loop {
        slice.run.max_attempts = left.min(per_worker.saturating_mul(workers));
        let start = clock.now();
        let outcome = find_grasp_in(pool, &scene, &slice, clock, stop);
        // The first slice tries all known grips.
        slice.known.atlas = None;
        slice.known.recent = RecentGrips::default();
        left -= slice.run.max_attempts;
        let end = outcome.end;
        let found = progress.add(outcome, &slice.run);
        if let Found::Replaceable { attempts, by } = found {
            left = left.min(attempts);
            slice.run.deadline = [slice.run.deadline, by].into_iter().flatten().min();
        }
        // The first valid grasp ends the search unless the best is wanted.
        let is_enough = found == Found::Settled && slice.query.choice == Choice::FirstValid;
        let is_stopped = end == SearchEnd::Stopped || stop.load(Ordering::Relaxed);
        let is_late = end == SearchEnd::DeadlinePassed || has_passed(slice.run.deadline, clock);
        let goes_on = found == Found::Nothing && slice.run.deadline < Some(patience);
        if is_late && goes_on && !is_stopped && left > 0 {
            slice.query.choice = Choice::FirstValid;
            slice.run.deadline = Some(patience);
            // If the search waited for workers until its deadline, it has not tried known grips yet.
            slice.known.atlas.clone_from(&settings.known.atlas);
            slice.known.recent.clone_from(&settings.known.recent);
        } else if is_enough || is_stopped || is_late || left == 0 {
            return progress.outcome(if is_late { SearchEnd::DeadlinePassed } else { end });
        }
        slice.run.first_attempt += slice.run.max_attempts;
        per_worker = next_size(per_worker, clock.now().saturating_sub(start));
    }
}

/// Attempts per worker in the next slice, after `size` attempts took `elapsed`. Doubles at most, so that one
/// unusually quick slice does not cause a long one.
fn next_size(size: u64, elapsed: Duration) -> u64 {
    let fitting = u128::from(size) * SLICE.as_nanos() / elapsed.as_nanos().max(1);
    u64::try_from(fitting)
        .unwrap_or(u64::MAX)
        .clamp(1, (2 * size).min(MOST_ATTEMPTS_PER_WORKER))
}

fn has_passed(deadline: Option<Duration>, clock: &dyn Clock) -> bool {
    deadline.is_some_and(|deadline| clock.now() >= deadline)
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, atomic::AtomicU64};

    use glam::Vec3;
    use grasp_assets::{hands::hand, objects::object};
    use grasp_synthesis::{
        model::{hand::Handedness, holdout::Holdout},
        search::settings::{Query, Run},
    };

    use super::*;

    /// A clock that advances by a microsecond per reading.
    #[derive(Debug, Default)]
    struct ReadingsClock(AtomicU64);

    impl Clock for ReadingsClock {
        fn now(&self) -> Duration {
            Duration::from_micros(self.0.fetch_add(1, Ordering::Relaxed))
        }
    }

    /// A search by one worker, with the number of times that it read the clock; times in clock readings.
    fn search_within(choice: Choice, deadline: u64, patience: u64) -> (SearchOutcome, u64) {
        let rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
        let object = object("remote").expect("it is built in");
        let holdout = Holdout::new(Arc::clone(&object.object), None, Vec3::Y).expect("up is a unit vector");
        let settings = SearchSettings {
            query: Query {
                choice,
                ..Query::default()
            },
            run: Run {
                seed: 3,
                max_attempts: 10_000,
                deadline: Some(Duration::from_micros(deadline)),
                ..Run::default()
            },
            ..SearchSettings::default()
        };
        let task = Task {
            holdout: &holdout,
            object: &object.prepared,
            rig,
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .expect("a thread");
        let clock = ReadingsClock::default();
        let patience = Duration::from_micros(patience);
        let stop = AtomicBool::new(false);
        let progress = Progress::default();
        let outcome = search_in_slices(&pool, task, &settings, patience, &clock, &stop, &progress);
        assert_eq!(progress.outcome(outcome.end).report, outcome.report);
        (outcome, clock.0.into_inner())
    }

    #[test]
    fn patience_extends_only_a_search_without_a_grasp() {
        let (none, readings) = search_within(Choice::BestWithinBudget, 3, 3);
        assert!(none.grasp.is_none() && none.end == SearchEnd::DeadlinePassed && readings < 20);
        let (late, readings) = search_within(Choice::BestWithinBudget, 3, 1_000_000);
        assert_eq!((late.end, late.report.candidates), (SearchEnd::Found, 1));
        assert!(late.grasp.is_some() && late.report.attempts > 0 && readings < 1_000_000);
        // With grasps by the deadline, the best of them, without an extension.
        let (best, readings) = search_within(Choice::BestWithinBudget, 10_000, 1_000_000);
        assert!(best.report.candidates > 1 && (10_000..11_000).contains(&readings));
        assert!(
            best.grasp
                .and_then(|grasp| grasp.score)
                .map(|score| score.total())
                > late
                    .grasp
                    .and_then(|grasp| grasp.score)
                    .map(|score| score.total())
        );
        // The extension ends with the patience.
        let (never, readings) = search_within(Choice::BestWithinBudget, 3, 6);
        assert!(never.grasp.is_none() && readings < 20);
    }

    #[test]
    fn slices_grow_to_their_time_and_shrink_to_one_attempt() {
        assert_eq!(next_size(64, Duration::from_millis(1)), 128, "at most doubled");
        assert_eq!(next_size(64, Duration::from_millis(20)), 32);
        assert_eq!(next_size(64, Duration::from_secs(100)), 1);
        assert_eq!(next_size(8192, Duration::ZERO), 8192, "the maximum");
    }
}
