//! Runs searches in slices, so that concurrent searches share the workers, and sums their results.
//!
//! A search without a grasp would otherwise hold the workers until its budget ends. Each slice queues behind the slices
//! of other searches. Slices cover consecutive attempts: slicing does not change which attempt wins a reproducible
//! search.

use std::{sync::Arc, time::Duration};

use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    model::{grasp::Grasp, strategy::Choice},
    search::{
        GraspSource, Replaceable, SearchEnd, SearchOutcome, SearchReport, find_grasp,
        scene::{Scene, Task},
        settings::SearchSettings,
    },
};
use rayon::ThreadPool;

use crate::{
    executor::Workers,
    sync::{Mutex, locked},
};

/// Target duration of a slice: short compared to a budget, and long compared to the 50 µs that starting the workers costs.
const SLICE: Duration = Duration::from_millis(10);

/// Attempts per worker in the first slice: about a millisecond of the fastest strategy.
pub(super) const FIRST_ATTEMPTS_PER_WORKER: u64 = 64;

const MAX_ATTEMPTS_PER_WORKER: u64 = 8192;

/// The hand of a part of a search: the place in its list of hands.
pub(super) type HandPlace = usize;

/// The outcome of a search with one hand, or of the better of both.
#[derive(Clone, Debug)]
pub(super) struct Ended {
    /// The hand of the grasp or, without one, of the nearest miss.
    pub hand: HandPlace,
    pub outcome: SearchOutcome,
}

/// The sum of a search's finished slices. The searching thread adds to it; others may read it at any time.
#[derive(Debug, Default)]
pub(super) struct Progress(Mutex<Sum>);

#[derive(Clone, Debug, Default)]
struct Sum {
    /// With the source of the best grasp.
    report: SearchReport,
    grasp: Option<Grasp>,
    value: f32,
    hand: HandPlace,
    /// Until when a best grasp that is not natural may be replaced.
    replaceable_until: Option<Replaceable>,
    /// The hand of the nearest miss.
    missing_hand: HandPlace,
    /// The first attempt that has not run.
    next: u64,
    /// True if the answer must not depend on the time left.
    is_reproducible: bool,
    /// Whether the search is for the best grasp.
    compares_all: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    Nothing,
    /// A grasp that one of the next attempts may replace.
    Replaceable {
        attempts: u64,
        by: Option<Duration>,
    },
    /// A grasp that no later attempt replaces, unless the search is for the best.
    Settled,
}

impl Sum {
    /// Number of attempts left that may replace the best grasp.
    fn replacing_attempts(&self) -> u64 {
        match self.replaceable_until {
            None => 0,
            Some(Replaceable::UntilAttempt(last)) => last.saturating_add(1).saturating_sub(self.next),
            Some(Replaceable::UntilTime(_)) => u64::MAX,
        }
    }

    /// True if a slice's grasp is preferred to the best so far: a preferred grip to all others; a natural grasp to others; unless
    /// the search is for the best, a grip of one hand's atlas to a learned one of the other; then the lower attempt, if the search
    /// is reproducible and both have one; then the better one.
    fn prefers(&self, slice: &SearchOutcome) -> bool {
        if self.grasp.is_none() {
            return true;
        }
        let are_chosen = [&self.replaceable_until, &slice.replaceable_until].map(Option::is_none);
        match (are_chosen, self.report.source, slice.report.source) {
            (_, Some(best), Some(new)) if best.is_preferred() != new.is_preferred() => new.is_preferred(),
            ([false, true], ..) => true,
            ([true, false], ..) => false,
            (_, Some(best), Some(new)) if !self.compares_all && best.is_learned() != new.is_learned() => {
                best.is_learned()
            }
            ([true, true], Some(GraspSource::Attempt(best)), Some(GraspSource::Attempt(new)))
                if self.is_reproducible =>
            {
                new < best
            }
            _ => slice.value > self.value,
        }
    }
}

impl Progress {
    /// Adds a slice of one hand, which `settings` describe.
    pub(super) fn add(&self, slice: SearchOutcome, settings: &SearchSettings, hand: HandPlace) -> Found {
        let run = &settings.run;
        let mut sum = locked(&self.0);
        sum.next = run.first_attempt.saturating_add(run.max_attempts);
        sum.is_reproducible = run.reproducible;
        sum.compares_all = settings.query.choice == Choice::BestWithinBudget;
        let is_better = slice.grasp.is_some() && sum.prefers(&slice);
        let replaces = sum.replaceable_until.is_some() && slice.replaceable_until.is_none();
        let missed = sum.report.nearest_miss.clone();
        sum.report.merge(slice.report, is_better);
        if sum.report.nearest_miss != missed {
            sum.missing_hand = hand;
        }
        if is_better {
            let is_first = sum.grasp.is_none();
            (sum.grasp, sum.value, sum.hand) = (slice.grasp, slice.value, hand);
            // The first one sets the time, unless a later one needs less.
            if replaces || is_first {
                sum.replaceable_until = slice.replaceable_until;
            }
        }
        if let (Some(until), Some(earlier)) = (&mut sum.replaceable_until, slice.replaceable_until) {
            *until = until.earlier(earlier);
        }
        let by = match sum.replaceable_until {
            Some(Replaceable::UntilTime(by)) => Some(by),
            _ => None,
        };
        match sum.replacing_attempts() {
            _ if sum.grasp.is_none() => Found::Nothing,
            0 => Found::Settled,
            attempts => Found::Replaceable { attempts, by },
        }
    }

    /// The outcome if the search ends here. A search that was not stopped and has a grasp has found one, whatever `end`
    /// says; but not a reproducible one that ran out of time before all attempts that may replace it.
    pub(super) fn outcome(&self, end: SearchEnd) -> Ended {
        let mut sum = locked(&self.0).clone();
        if sum.is_reproducible && end == SearchEnd::DeadlinePassed && sum.replacing_attempts() > 0 {
            sum.grasp = None;
        }
        let is_found = sum.grasp.is_some();
        let mut report = sum.report;
        if sum.is_reproducible {
            // The number of others found by then depends on the slices.
            report.candidates = u64::from(is_found);
        }
        if is_found {
            // The nearest miss is reported only if there is no grasp.
            report.nearest_miss = None;
        } else {
            report.source = None;
        }
        Ended {
            hand: if is_found { sum.hand } else { sum.missing_hand },
            outcome: SearchOutcome {
                end: match end {
                    SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted if is_found => SearchEnd::Found,
                    SearchEnd::Found if !is_found => SearchEnd::DeadlinePassed,
                    end => end,
                },
                value: if is_found { sum.value } else { 0.0 },
                replaceable_until: sum.replaceable_until.filter(|_| is_found),
                grasp: sum.grasp,
                report,
            },
        }
    }
}

/// The workers, clock, stop and progress of a search's slices.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub workers: Workers<'a>,
    pub clock: &'a dyn Clock,
    pub stop: Stop<'a>,
    pub progress: &'a Progress,
}

impl Site<'_> {
    /// True at and after a deadline.
    pub(super) fn has_passed(&self, deadline: Option<Duration>) -> bool {
        deadline.is_some_and(|deadline| self.clock.now() >= deadline)
    }
}

pub(super) struct Slices<'a> {
    site: Site<'a>,
    hand: HandPlace,
    settings: &'a SearchSettings,
    scene: Scene<'a>,
    /// Settings of the next slice. The first slice tries all known grips.
    pub(super) next: SearchSettings,
    pub(super) left: u64,
    pub(super) per_worker: u64,
}

impl<'a> Slices<'a> {
    pub(super) fn new(
        site: Site<'a>,
        hand: HandPlace,
        (task, settings): (Task<'a>, &'a SearchSettings),
    ) -> Self {
        Self {
            site,
            hand,
            settings,
            scene: Scene::new(task, settings),
            next: settings.clone(),
            left: settings.run.max_attempts,
            per_worker: FIRST_ATTEMPTS_PER_WORKER,
        }
    }

    /// Runs a slice that takes about its time, and adds it. The end says whether the search is to stop.
    pub(super) fn step(&mut self) -> (SearchEnd, Found) {
        let site = self.site;
        let start = site.clock.now();
        let outcome = self.run(self.per_worker.saturating_mul(self.next.run.workers as u64));
        let end = outcome.end;
        let found = self.add(outcome);
        self.per_worker = next_size(self.per_worker, site.clock.now().saturating_sub(start));
        if let Found::Replaceable { by: Some(_), .. } = found {
            // Those without a grasp go first: the time for a better one passes meanwhile.
            site.workers.end_turn();
        }
        let is_stopped = site.stop.is_over();
        (if is_stopped { SearchEnd::Stopped } else { end }, found)
    }

    /// Runs a slice of up to `attempts`; 0 tries known grips only.
    pub(super) fn run(&mut self, attempts: u64) -> SearchOutcome {
        let site = self.site;
        self.next.run.max_attempts = self.left.min(attempts);
        let find = |pool: &ThreadPool| find_grasp(pool, &self.scene, &self.next, site.clock, site.stop);
        let left = self.next.run.deadline;
        let left = left.map(|deadline| deadline.saturating_sub(site.clock.now()));
        let outcome = site.workers.in_turn(left, find);
        self.next.known.atlas = None;
        self.next.known.learned = None;
        self.next.known.preferred = Arc::default();
        self.left -= self.next.run.max_attempts;
        outcome
    }

    /// Adds the outcome of the slice that just ran, and moves on to the next attempts.
    pub(super) fn add(&mut self, outcome: SearchOutcome) -> Found {
        let found = self.site.progress.add(outcome, &self.next, self.hand);
        self.advance();
        found
    }

    pub(super) fn advance(&mut self) {
        self.next.run.first_attempt += self.next.run.max_attempts;
    }

    pub(super) fn restore_known(&mut self) {
        self.next.known.clone_from(&self.settings.known);
    }
}

/// Attempts per worker in the slice after one that took `elapsed`; at most doubled, as one slice may be unusually quick.
pub(super) fn next_size(per_worker: u64, elapsed: Duration) -> u64 {
    let fitting = u128::from(per_worker) * SLICE.as_nanos() / elapsed.as_nanos().max(1);
    let most = (2 * per_worker).min(MAX_ATTEMPTS_PER_WORKER);
    u64::try_from(fitting).unwrap_or(u64::MAX).clamp(1, most)
}

/// Runs the search of a single hand to its end. If it finds nothing by its deadline and `patience` ends later, it continues
/// until then and takes the first valid grasp. Adds each slice to the site's progress, which must be empty.
pub(super) fn search_in_slices(
    site: Site<'_>,
    search: (Task<'_>, &SearchSettings),
    patience: Duration,
) -> Ended {
    let mut slices = Slices::new(site, 0, search);
    loop {
        let (end, found) = slices.step();
        let next = &mut slices.next;
        if let Found::Replaceable { attempts, by } = found {
            slices.left = slices.left.min(attempts);
            next.run.deadline = [next.run.deadline, by].into_iter().flatten().min();
        }
        // The first valid grasp ends the search unless the search is for the best.
        let is_enough = found == Found::Settled && next.query.choice == Choice::FirstValid;
        let is_stopped = end == SearchEnd::Stopped;
        let is_late = end == SearchEnd::DeadlinePassed || site.has_passed(next.run.deadline);
        let goes_on = found == Found::Nothing && next.run.deadline < Some(patience);
        if is_late && goes_on && !is_stopped && slices.left > 0 {
            next.query.choice = Choice::FirstValid;
            next.run.deadline = Some(patience);
            // If the search waited for workers until its deadline, it has not tried known grips yet.
            slices.restore_known();
        } else if is_enough || is_stopped || is_late || slices.left == 0 {
            return site
                .progress
                .outcome(if is_late { SearchEnd::DeadlinePassed } else { end });
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
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

    /// A clock that advances by a tenth of a microsecond per reading, however fast the machine is.
    #[derive(Debug, Default)]
    pub(in crate::search) struct ReadingsClock(AtomicU64);

    impl ReadingsClock {
        /// When so many readings have passed.
        pub(in crate::search) fn after(readings: u64) -> Duration {
            Duration::from_nanos(100 * readings)
        }
    }

    impl Clock for ReadingsClock {
        fn now(&self) -> Duration {
            Self::after(self.0.fetch_add(1, Ordering::Relaxed))
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
                deadline: Some(ReadingsClock::after(deadline)),
                ..Run::default()
            },
            ..SearchSettings::default()
        };
        let task = Task {
            holdout: &holdout,
            object: &object.prepared,
            rig,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.expect("a thread");
        let clock = ReadingsClock::default();
        let patience = ReadingsClock::after(patience);
        let progress = Progress::default();
        let site = Site {
            workers: Workers::alone(&pool),
            clock: &clock,
            stop: Stop::NEVER,
            progress: &progress,
        };
        let Ended { hand, outcome } = search_in_slices(site, (task, &settings), patience);
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
        assert!(best.value > late.value);
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
