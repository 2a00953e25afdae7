//! Runs searches in slices, so that concurrent searches share the workers.
//!
//! A search without a grasp would otherwise hold the workers until its budget ends. Each slice queues behind the slices
//! of other searches. Slices cover consecutive attempts: slicing does not change which attempt wins a reproducible
//! search.

use std::{sync::Arc, time::Duration};

use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    model::strategy::Choice,
    search::{
        SearchEnd, SearchOutcome, find_grasp_in, prepare,
        scene::{Scene, Task},
        settings::SearchSettings,
    },
};
use rayon::ThreadPool;

use super::progress::{Ended, Found, HandPlace, Progress};

/// Target duration of a slice: short compared to a budget of a second, so that searches share the workers evenly, and
/// long compared to the 50 µs that starting and joining the workers costs.
const SLICE: Duration = Duration::from_millis(10);

/// Attempts per worker in the first slice: about a millisecond of the fastest strategy.
const FIRST_ATTEMPTS_PER_WORKER: u64 = 64;

/// Largest number of attempts per worker in a slice.
const MAX_ATTEMPTS_PER_WORKER: u64 = 8192;

/// Where slices run, and what they watch and add to.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    /// The workers.
    pub pool: &'a ThreadPool,
    /// The search's clock.
    pub clock: &'a dyn Clock,
    /// Whether the search is to stop.
    pub stop: Stop<'a>,
    /// The sum of the slices.
    pub progress: &'a Progress,
}

impl Site<'_> {
    /// True at and after a deadline.
    pub(super) fn has_passed(&self, deadline: Option<Duration>) -> bool {
        deadline.is_some_and(|deadline| self.clock.now() >= deadline)
    }
}

/// One hand's search, slice by slice.
#[derive(Debug)]
pub(super) struct Slices<'a> {
    hand: HandPlace,
    scene: Scene<'a>,
    /// Settings of the next slice. The first slice tries all known grips.
    pub(super) next: SearchSettings,
    /// Attempts left.
    pub(super) left: u64,
}

impl<'a> Slices<'a> {
    /// The search for a task, before its first slice.
    pub(super) fn new(hand: HandPlace, task: Task<'a>, settings: &SearchSettings) -> Self {
        Self {
            hand,
            scene: prepare(task, settings),
            next: settings.clone(),
            left: settings.run.max_attempts,
        }
    }

    /// Runs a slice of up to `attempts`; 0 tries known grips only.
    pub(super) fn run(&mut self, site: Site<'_>, attempts: u64) -> SearchOutcome {
        self.next.run.max_attempts = self.left.min(attempts);
        let outcome = find_grasp_in(site.pool, &self.scene, &self.next, site.clock, site.stop);
        self.next.known.atlas = None;
        self.next.known.learned = None;
        self.next.known.preferred = Arc::default();
        self.left -= self.next.run.max_attempts;
        outcome
    }

    /// Adds the outcome of the slice that just ran, and moves on to the next attempts.
    pub(super) fn add(&mut self, site: Site<'_>, outcome: SearchOutcome) -> Found {
        let found = site.progress.add(outcome, &self.next, self.hand);
        self.advance();
        found
    }

    /// Moves on to the attempts after the slice that just ran.
    pub(super) fn advance(&mut self) {
        self.next.run.first_attempt += self.next.run.max_attempts;
    }

    /// Restores the known grips, to be tried again.
    pub(super) fn restore_known(&mut self, settings: &SearchSettings) {
        self.next.known.atlas.clone_from(&settings.known.atlas);
        self.next.known.learned.clone_from(&settings.known.learned);
        self.next.known.preferred.clone_from(&settings.known.preferred);
    }
}

/// The number of attempts in each slice, from the time that the one before took.
#[derive(Clone, Copy, Debug)]
pub(super) struct SliceSize {
    per_worker: u64,
    workers: u64,
}

impl SliceSize {
    /// The size of a search's first slice.
    pub(super) fn first(settings: &SearchSettings) -> Self {
        Self::of(FIRST_ATTEMPTS_PER_WORKER, settings)
    }

    /// A size in attempts per worker.
    pub(super) fn of(per_worker: u64, settings: &SearchSettings) -> Self {
        Self {
            per_worker,
            workers: settings.run.workers as u64,
        }
    }

    /// The number of attempts of all workers.
    pub(super) fn attempts(self) -> u64 {
        self.per_worker.saturating_mul(self.workers)
    }

    /// The size of the next slice, after one of this size took `elapsed`. Doubles at most, so that one unusually quick slice
    /// does not cause a long one.
    pub(super) fn next(self, elapsed: Duration) -> Self {
        let fitting = u128::from(self.per_worker) * SLICE.as_nanos() / elapsed.as_nanos().max(1);
        let most = (2 * self.per_worker).min(MAX_ATTEMPTS_PER_WORKER);
        Self {
            per_worker: u64::try_from(fitting).unwrap_or(u64::MAX).clamp(1, most),
            ..self
        }
    }
}

/// Runs the search of a single hand to its end. If it finds nothing by its deadline and `patience` ends later, it continues
/// until then and takes the first valid grasp. Adds each slice to the site's progress, which must be empty.
pub(super) fn search_in_slices(
    site: Site<'_>,
    task: Task<'_>,
    settings: &SearchSettings,
    patience: Duration,
) -> Ended {
    let mut slices = Slices::new(0, task, settings);
    let mut size = SliceSize::first(settings);
    loop {
        let start = site.clock.now();
        let outcome = slices.run(site, size.attempts());
        let end = outcome.end;
        let found = slices.add(site, outcome);
        let next = &mut slices.next;
        if let Found::Replaceable { attempts, by } = found {
            slices.left = slices.left.min(attempts);
            next.run.deadline = [next.run.deadline, by].into_iter().flatten().min();
        }
        // The first valid grasp ends the search unless the best is wanted.
        let is_enough = found == Found::Settled && next.query.choice == Choice::FirstValid;
        let is_stopped = end == SearchEnd::Stopped || site.stop.is_over();
        let is_late = end == SearchEnd::DeadlinePassed || site.has_passed(next.run.deadline);
        let goes_on = found == Found::Nothing && next.run.deadline < Some(patience);
        if is_late && goes_on && !is_stopped && slices.left > 0 {
            next.query.choice = Choice::FirstValid;
            next.run.deadline = Some(patience);
            // If the search waited for workers until its deadline, it has not tried known grips yet.
            slices.restore_known(settings);
        } else if is_enough || is_stopped || is_late || slices.left == 0 {
            return site
                .progress
                .outcome(if is_late { SearchEnd::DeadlinePassed } else { end });
        }
        size = size.next(site.clock.now().saturating_sub(start));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    };

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
                refinement: Duration::ZERO,
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
        let progress = Progress::default();
        let site = Site {
            pool: &pool,
            clock: &clock,
            stop: Stop::NEVER,
            progress: &progress,
        };
        let Ended { hand, outcome } = search_in_slices(site, task, &settings, patience);
        assert_eq!(hand, 0);
        assert_eq!(progress.outcome(outcome.end).outcome.report, outcome.report);
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
        let next = |per_worker, elapsed| {
            let size = SliceSize::of(per_worker, &SearchSettings::default());
            size.next(elapsed).attempts()
        };
        assert_eq!(next(64, Duration::from_millis(1)), 128, "at most doubled");
        assert_eq!(next(64, Duration::from_millis(20)), 32);
        assert_eq!(next(64, Duration::from_secs(100)), 1);
        assert_eq!(next(8192, Duration::ZERO), 8192, "the maximum");
    }
}
