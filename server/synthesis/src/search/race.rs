//! The workers of a search and the state that they share.

use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

use super::{
    SearchEnd, SearchOutcome,
    attempt::{Attempt, AttemptEnd},
    known_grips::{KnownGrips, TryResult, grasp_value},
    report::{GraspSource, SearchReport},
    scene::Scene,
    settings::SearchSettings,
    tally::{Record, Tally},
};
use crate::{
    base::{
        clock::Clock, mechanisms::Mechanism, random::AttemptStream, rejection::Rejection,
        stopwatch::Stopwatch,
    },
    model::{grasp::Grasp, strategy::Choice},
    physical::grip::Gripper,
};

/// How long known grips are tried before other workers are woken for fresh attempts. Waking them takes about 50 µs,
/// and nine in ten requests have their answer by then.
const HEAD_START: Duration = Duration::from_micros(300);

/// Attempts after a valid one without a clear type of which one with a clear type is preferred, in addition to as many as
/// the valid one took. On a new object, one in ten is such; more delay the answers that stay unclear, by 0.1 ms each.
const CLEAR_TYPE_ATTEMPTS: u64 = 32;

/// Marks a worker that is not running an attempt.
const IDLE: u64 = u64::MAX;

/// The shared state of the workers of one search.
pub(super) struct Race<'a> {
    scene: &'a Scene<'a>,
    settings: &'a SearchSettings,
    clock: &'a dyn Clock,
    stop: &'a AtomicBool,
    /// One past the last attempt.
    end: u64,
    /// The next attempt to start. Indices are taken in order, so all below it are taken.
    next: AtomicU64,
    /// Attempts above this index need not run: the lowest valid one so far, if the search is reproducible, or the last that
    /// may replace it.
    bound: AtomicU64,
    /// Set to stop all workers: any grasp will do and one was found, or a worker panicked.
    over: AtomicBool,
    /// The lowest attempt that was started but interrupted.
    lowest_interrupted: AtomicU64,
    /// The attempt that each worker is running, or a lower index; [`IDLE`] before it starts and after it
    /// stops.
    running: Vec<AtomicU64>,
    known: Option<&'a KnownGrips<'a>>,
    /// Valid grasps so far.
    candidates: AtomicU64,
    winners: Mutex<Winners>,
    tallies: Mutex<Vec<Tally>>,
}

/// A valid grasp.
struct Winner {
    source: GraspSource,
    grasp: Box<Grasp>,
    value: f32,
}

/// The preferred valid grasps so far.
#[derive(Default)]
struct Winners {
    /// The preferred one.
    clear: Option<Winner>,
    /// The preferred one of those without a clear type, if clear types are preferred.
    unclear: Option<Winner>,
}

/// Stops the other workers if its own worker panics.
struct PanicGuard<'a>(&'a AtomicBool);

impl Drop for PanicGuard<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

impl<'a> Race<'a> {
    pub(super) fn new(
        scene: &'a Scene<'a>,
        settings: &'a SearchSettings,
        known: Option<&'a KnownGrips<'a>>,
        clock: &'a dyn Clock,
        stop: &'a AtomicBool,
    ) -> Self {
        Self {
            scene,
            settings,
            clock,
            stop,
            end: settings
                .run
                .first_attempt
                .saturating_add(settings.run.max_attempts),
            next: AtomicU64::new(settings.run.first_attempt),
            bound: AtomicU64::new(u64::MAX),
            over: AtomicBool::new(false),
            lowest_interrupted: AtomicU64::new(u64::MAX),
            running: (0..settings.run.workers).map(|_| AtomicU64::new(IDLE)).collect(),
            known,
            candidates: AtomicU64::new(0),
            winners: Mutex::default(),
            tallies: Mutex::new(Vec::with_capacity(settings.run.workers)),
        }
    }

    /// Runs attempts until the race is over.
    pub(super) fn run_worker(&self, worker: usize, mut stopwatch: impl Stopwatch) {
        let guard = PanicGuard(&self.over);
        let mut tally = Tally::default();
        let mut attempt = Attempt::default();
        self.try_known_grips(worker);
        while let Some(index) = self.take_attempt(worker) {
            let mut stream = AttemptStream::new(self.settings.run.seed, index);
            let ended = attempt.run(self.scene, &mut stream, &mut stopwatch, &|| {
                self.is_over_for(index)
            });
            let pruned = attempt.pruned_placements();
            let rejection = match ended {
                AttemptEnd::Interrupted => {
                    self.lowest_interrupted.fetch_min(index, Ordering::SeqCst);
                    tally.record_interrupted(pruned);
                    break;
                }
                AttemptEnd::Valid(grasp) => {
                    let value = self.value_of(&grasp);
                    self.record_valid(GraspSource::Attempt(index), grasp, value);
                    None
                }
                AttemptEnd::Rejected {
                    rejection,
                    wrench_angle,
                } => {
                    // An inadmissible wrist is not a near miss.
                    if rejection != Rejection::UnmetConstraint || !attempt.is_unposed() {
                        tally.record_miss(rejection, wrench_angle, index, || attempt.pose(self.scene));
                    }
                    Some(rejection)
                }
            };
            let record = Record {
                attempt: index,
                pruned,
                rejection,
            };
            if self.settings.run.reproducible {
                tally.count_when_settled(record, || self.last_settled());
            } else {
                tally.count(&record);
            }
        }
        self.running[worker].store(IDLE, Ordering::SeqCst);
        tally.record_times(stopwatch.times());
        self.tallies
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(tally);
        drop(guard);
    }

    /// Takes the next attempt, unless there is none left or it need not run.
    fn take_attempt(&self, worker: usize) -> Option<u64> {
        // A taken index must run, or not all attempts below a winner would be settled: so check before taking
        // it.
        let open = self.next.load(Ordering::SeqCst);
        if open >= self.end || self.is_over_for(open) {
            return None;
        }
        // Announce a lower bound of the index before taking it.
        self.running[worker].store(open, Ordering::SeqCst);
        let index = self.next.fetch_add(1, Ordering::SeqCst);
        (index < self.end).then_some(index)
    }

    /// True if an attempt need not run to its end.
    fn is_over_for(&self, index: u64) -> bool {
        self.over.load(Ordering::Relaxed)
            || self.bound.load(Ordering::Relaxed) < index
            || self.stop.load(Ordering::Relaxed)
            || self
                .settings
                .run
                .deadline
                .is_some_and(|deadline| self.clock.now() >= deadline)
    }

    /// Tries known grips before any other worker is woken: for [`HEAD_START`], or all of them if the search is
    /// reproducible. True if the race is over.
    pub(super) fn tries_known_first(&self) -> bool {
        if self.known.is_none() {
            return false;
        }
        match (self.settings.query.choice, self.settings.run.reproducible) {
            (Choice::BestWithinBudget, _) => false,
            (Choice::FirstValid, true) => self.try_known_until(None),
            (Choice::FirstValid, false) => {
                self.settings.run.mechanisms.has(Mechanism::HeadStart)
                    && self.try_known_until(Some(self.clock.now() + HEAD_START))
            }
        }
    }

    /// Tries known grips until one is valid or the clock reaches `until`. True if one is valid.
    pub(super) fn try_known_until(&self, until: Option<Duration>) -> bool {
        let Some(known) = self.known else {
            return false;
        };
        let mut gripper = Gripper::default();
        while !self.is_over_for(0) && until.is_none_or(|until| self.clock.now() < until) {
            match known.try_next(&mut gripper) {
                TryResult::Exhausted => return false,
                TryResult::Rejected => {}
                TryResult::Valid { source, grasp, value } => {
                    self.record_valid(source, grasp, value);
                    return true;
                }
            }
        }
        false
    }

    /// Tries known grips in parallel with the other workers' fresh attempts: on one worker, or on all if the
    /// best grasp is wanted.
    fn try_known_grips(&self, worker: usize) {
        let Some(known) = self.known else { return };
        if worker > 0 && self.settings.query.choice == Choice::FirstValid {
            return;
        }
        let mut gripper = Gripper::default();
        while !self.is_over_for(0) {
            match known.try_next(&mut gripper) {
                TryResult::Exhausted => return,
                TryResult::Rejected => {}
                TryResult::Valid { source, grasp, value } => {
                    self.record_valid(source, grasp, value);
                }
            }
        }
    }

    /// Records a valid grasp. It ends the race, unless the best one, the one with the lowest index or one with a clear type
    /// is wanted.
    fn record_valid(&self, source: GraspSource, grasp: Box<Grasp>, value: f32) {
        self.candidates.fetch_add(1, Ordering::Relaxed);
        let is_reproducible = self.settings.run.reproducible;
        let is_clear = !self.prefers_clear_types() || grasp.classification.is_clear();
        let mut winners = self.winners.lock().unwrap_or_else(PoisonError::into_inner);
        let Winners { clear, unclear } = &mut *winners;
        let rival = match (source, is_clear) {
            (GraspSource::Attempt(_), false) => unclear,
            _ => clear,
        };
        let is_preferred = match (self.settings.query.choice, source) {
            (Choice::BestWithinBudget, _) => rival.as_ref().is_none_or(|best| value > best.value),
            (Choice::FirstValid, GraspSource::Attempt(index)) if is_reproducible || !is_clear => {
                let last = if is_clear { index } else { last_replacing(index) };
                self.bound.fetch_min(last, Ordering::SeqCst);
                // A known grip precedes every attempt.
                rival.as_ref().is_none_or(
                    |lowest| matches!(lowest.source, GraspSource::Attempt(lowest) if index < lowest),
                )
            }
            (Choice::FirstValid, _) => {
                self.over.store(true, Ordering::Relaxed);
                rival.is_none()
            }
        };
        if is_preferred {
            *rival = Some(Winner { source, grasp, value });
        }
    }

    /// True if an attempt with a clear type is preferred to one just before it without. Known grips nearly all have one.
    fn prefers_clear_types(&self) -> bool {
        let query = &self.settings.query;
        query.choice == Choice::FirstValid && query.uses_known_grips()
    }

    /// The quality of a fresh grasp; 0 unless the best one is wanted.
    fn value_of(&self, grasp: &Grasp) -> f32 {
        if self.settings.query.choice == Choice::FirstValid {
            return 0.0;
        }
        grasp_value(grasp)
    }

    /// The highest index such that all attempts up to it have ended and none below it has been beaten by a
    /// valid attempt with a lower index.
    fn last_settled(&self) -> Option<u64> {
        // Reads the bound last: a valid attempt lowers it before its worker moves on.
        let lowest_running = self
            .running
            .iter()
            .map(|running| running.load(Ordering::SeqCst))
            .min()?;
        Some(
            lowest_running
                .checked_sub(1)?
                .min(self.bound.load(Ordering::SeqCst)),
        )
    }

    /// The outcome, after all workers have stopped.
    pub(super) fn outcome(self) -> SearchOutcome {
        let interrupted = self.lowest_interrupted.into_inner();
        let Winners { clear, unclear } = self.winners.into_inner().unwrap_or_else(PoisonError::into_inner);
        let index_of = |winner: &Winner| match winner.source {
            GraspSource::Attempt(index) => Some(index),
            GraspSource::Atlas(_) | GraspSource::Recent => None,
        };
        let last = unclear.as_ref().and_then(index_of).map(last_replacing);
        // Without `reproducible`, attempts beyond the last may have run.
        let replaces = |clear: &Winner| index_of(clear) <= last || !self.settings.run.reproducible;
        let (winner, replaceable_until) = match clear {
            Some(clear) if last.is_none() || replaces(&clear) => (Some(clear), None),
            _ => (unclear, last),
        };
        // Reproducible: an interrupted attempt with a lower index, or one that replaces the winner, might have won.
        let winner = winner.filter(|winner| {
            let decided = replaceable_until.or(index_of(winner));
            !self.settings.run.reproducible || decided.is_none_or(|index| index < interrupted)
        });
        let source = winner.as_ref().map(|winner| winner.source);
        let winning_index = match source {
            Some(GraspSource::Attempt(index)) => Some(index),
            _ => None,
        };
        let end = if winner.is_some() {
            SearchEnd::Found
        } else if interrupted == u64::MAX && self.next.into_inner() >= self.end {
            SearchEnd::AttemptsExhausted
        } else if self.stop.load(Ordering::Relaxed) {
            SearchEnd::Stopped
        } else {
            SearchEnd::DeadlinePassed
        };
        let mut report = SearchReport {
            attempt: winning_index,
            source,
            // How many others were found by then depends on the number of workers.
            candidates: if self.settings.run.reproducible {
                u64::from(source.is_some())
            } else {
                self.candidates.into_inner()
            },
            known_grips: self.known.map_or(0, KnownGrips::atlas_len),
            ..SearchReport::default()
        };
        let last_counted = replaceable_until
            .or(winning_index)
            .filter(|_| winner.is_some() && self.settings.run.reproducible);
        for tally in self.tallies.into_inner().unwrap_or_else(PoisonError::into_inner) {
            tally.add_to(&mut report, last_counted);
        }
        if winner.is_some() {
            report.nearest_miss = None;
        }
        SearchOutcome {
            end,
            replaceable_until: replaceable_until.filter(|_| winner.is_some()),
            value: winner.as_ref().map_or(0.0, |winner| winner.value),
            grasp: winner.map(|winner| *winner.grasp),
            report,
        }
    }
}

/// The last attempt whose grasp, if it has a clear type, replaces that of a valid attempt without one.
fn last_replacing(attempt: u64) -> u64 {
    attempt.saturating_mul(2).saturating_add(CLEAR_TYPE_ATTEMPTS)
}
