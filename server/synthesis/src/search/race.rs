//! The workers of a search and what they share.

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
    known_grips::{KnownGrips, Tried, value},
    report::{GraspSource, SearchReport},
    scene::Scene,
    settings::SearchSettings,
    tally::{Record, Tally},
};
use crate::{
    base::mechanisms::Mechanism,
    base::{clock::Clock, random::AttemptStream, rejection::Rejection, stopwatch::Stopwatch},
    model::{grasp::Grasp, strategy::Choice},
    physical::grip::Gripper,
};

/// How long known grips are looked at before other workers are woken to look for fresh ones. Waking them takes about
/// 50 µs, and nine in ten requests have their answer by then.
const HEAD_START: Duration = Duration::from_micros(300);

/// A worker that is not running an attempt.
const IDLE: u64 = u64::MAX;

/// What the workers of one search share.
pub(super) struct Race<'a> {
    scene: &'a Scene<'a>,
    settings: &'a SearchSettings,
    clock: &'a dyn Clock,
    stop: &'a AtomicBool,
    /// One past the last attempt.
    end: u64,
    /// The next attempt that nobody has taken yet. Indices are taken in order, so all below it are taken.
    next: AtomicU64,
    /// Attempts above this index need not be run: the lowest valid one so far, if the search is reproducible.
    bound: AtomicU64,
    /// Nobody need go on: a grasp was found, if any will do, or a worker panicked.
    over: AtomicBool,
    /// The lowest attempt that was taken but not run to its end.
    lowest_interrupted: AtomicU64,
    /// What each worker is running, or an index below; [`IDLE`] before it starts and after it stops.
    running: Vec<AtomicU64>,
    known: Option<&'a KnownGrips<'a>>,
    /// Valid grasps so far.
    candidates: AtomicU64,
    winner: Mutex<Option<Winner>>,
    tallies: Mutex<Vec<Tally>>,
}

/// The best valid grasp so far, by what the search prefers.
struct Winner {
    source: GraspSource,
    grasp: Box<Grasp>,
    value: f32,
}

/// Tells the other workers that it is over, should its own worker panic.
struct Alarm<'a>(&'a AtomicBool);

impl Drop for Alarm<'_> {
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
            winner: Mutex::new(None),
            tallies: Mutex::new(Vec::with_capacity(settings.run.workers)),
        }
    }

    /// Runs attempts until the race is over.
    pub(super) fn run_worker(&self, worker: usize, mut stopwatch: impl Stopwatch) {
        let alarm = Alarm(&self.over);
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
                    tally.note_interrupted(pruned);
                    break;
                }
                AttemptEnd::Valid(grasp) => {
                    let value = self.value_of(&grasp);
                    self.enter_winner(GraspSource::Attempt(index), grasp, value);
                    None
                }
                AttemptEnd::Rejected {
                    rejection,
                    wrench_angle,
                } => {
                    // A wrist that may not be there is no near miss.
                    if rejection != Rejection::UnmetConstraint || !attempt.is_unposed() {
                        tally.note_miss(rejection, wrench_angle, index, || attempt.pose(self.scene));
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
        tally.note_times(stopwatch.times());
        self.tallies
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(tally);
        drop(alarm);
    }

    /// The next attempt for a worker, if there is one and it is to be run.
    fn take_attempt(&self, worker: usize) -> Option<u64> {
        // An index that is taken must be run, or the attempts below a winner would not all be settled: so look first.
        let open = self.next.load(Ordering::SeqCst);
        if open >= self.end || self.is_over_for(open) {
            return None;
        }
        // Before taking an index, announce that it will be this one or a higher one.
        self.running[worker].store(open, Ordering::SeqCst);
        let index = self.next.fetch_add(1, Ordering::SeqCst);
        (index < self.end).then_some(index)
    }

    /// True if an attempt need not be run to its end.
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

    /// Looks at the known grips before any other worker is woken: for as long as [`HEAD_START`], or at all of them if the
    /// search is to be reproducible. True if the race is over.
    pub(super) fn looks_ahead(&self) -> bool {
        if self.known.is_none() {
            return false;
        }
        match (self.settings.query.choice, self.settings.run.reproducible) {
            (Choice::BestWithinBudget, _) => false,
            (Choice::FirstValid, true) => self.look_ahead(None),
            (Choice::FirstValid, false) => {
                self.settings.run.mechanisms.has(Mechanism::HeadStart)
                    && self.look_ahead(Some(self.clock.now() + HEAD_START))
            }
        }
    }

    /// Tries known grips until one is valid or it is `until`. True if one is.
    pub(super) fn look_ahead(&self, until: Option<Duration>) -> bool {
        let Some(known) = self.known else {
            return false;
        };
        let mut gripper = Gripper::default();
        while !self.is_over_for(0) && until.is_none_or(|until| self.clock.now() < until) {
            match known.try_next(&mut gripper) {
                Tried::NoneLeft => return false,
                Tried::Refused => {}
                Tried::Valid { source, grasp, value } => {
                    self.enter_winner(source, grasp, value);
                    return true;
                }
            }
        }
        false
    }

    /// Tries known grips beside the other workers' fresh attempts: one worker does, or all if the best is wanted.
    fn try_known_grips(&self, worker: usize) {
        let Some(known) = self.known else { return };
        if worker > 0 && self.settings.query.choice == Choice::FirstValid {
            return;
        }
        let mut gripper = Gripper::default();
        while !self.is_over_for(0) {
            match known.try_next(&mut gripper) {
                Tried::NoneLeft => return,
                Tried::Refused => {}
                Tried::Valid { source, grasp, value } => {
                    self.enter_winner(source, grasp, value);
                }
            }
        }
    }

    /// Enters a valid grasp. The first ends the race, unless the best or the one of the lowest index is wanted.
    fn enter_winner(&self, source: GraspSource, grasp: Box<Grasp>, value: f32) {
        self.candidates.fetch_add(1, Ordering::Relaxed);
        let mut winner = self.winner.lock().unwrap_or_else(PoisonError::into_inner);
        let is_preferred = match (self.settings.query.choice, source) {
            (Choice::BestWithinBudget, _) => winner.as_ref().is_none_or(|best| value > best.value),
            (Choice::FirstValid, GraspSource::Attempt(index)) if self.settings.run.reproducible => {
                self.bound.fetch_min(index, Ordering::SeqCst);
                // A known grip comes before every attempt.
                winner.as_ref().is_none_or(
                    |lowest| matches!(lowest.source, GraspSource::Attempt(lowest) if index < lowest),
                )
            }
            (Choice::FirstValid, _) => {
                self.over.store(true, Ordering::Relaxed);
                winner.is_none()
            }
        };
        if is_preferred {
            *winner = Some(Winner { source, grasp, value });
        }
    }

    /// How good a fresh grasp is; only asked where the best is wanted.
    fn value_of(&self, grasp: &Grasp) -> f32 {
        if self.settings.query.choice == Choice::FirstValid {
            return 0.0;
        }
        value(grasp)
    }

    /// The highest index up to which every attempt has ended without being beaten by a valid one of a lower index.
    fn last_settled(&self) -> Option<u64> {
        // The bound is read last: a valid attempt lowers it before its worker moves on.
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
        let winner = self
            .winner
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner)
            // Reproducible: an attempt of a lower index that was cut short might have won.
            .filter(|winner| match winner.source {
                GraspSource::Attempt(index) => !self.settings.run.reproducible || index < interrupted,
                GraspSource::Atlas(_) | GraspSource::Spared(_) | GraspSource::Recent => true,
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
            // How many more others had found by then hangs on their number.
            candidates: if self.settings.run.reproducible {
                u64::from(source.is_some())
            } else {
                self.candidates.into_inner()
            },
            known_grips: self.known.map_or(0, KnownGrips::of_atlas),
            ..SearchReport::default()
        };
        let lowest_winner = winning_index.filter(|_| self.settings.run.reproducible);
        for tally in self.tallies.into_inner().unwrap_or_else(PoisonError::into_inner) {
            tally.add_to(&mut report, lowest_winner);
        }
        if winner.is_some() {
            report.nearest_miss = None;
        }
        SearchOutcome {
            end,
            value: winner.as_ref().map_or(0.0, |winner| winner.value),
            grasp: winner.map(|winner| *winner.grasp),
            report,
        }
    }
}
