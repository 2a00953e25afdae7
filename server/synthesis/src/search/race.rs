//! The workers of a search and what they share.

use std::{
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
};

use super::{
    SearchEnd, SearchOutcome, SearchSettings,
    report::SearchReport,
    tally::{Record, Tally},
};
use crate::{
    clock::Clock,
    grasp::Grasp,
    synthesis::{
        attempt::{Attempt, AttemptEnd, Scene},
        random::AttemptStream,
        stopwatch::Stopwatch,
    },
};

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
    winner: Mutex<Option<(u64, Box<Grasp>)>>,
    tallies: Mutex<Vec<Tally>>,
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
        clock: &'a dyn Clock,
        stop: &'a AtomicBool,
    ) -> Self {
        Self {
            scene,
            settings,
            clock,
            stop,
            end: settings.first_attempt.saturating_add(settings.max_attempts),
            next: AtomicU64::new(settings.first_attempt),
            bound: AtomicU64::new(u64::MAX),
            over: AtomicBool::new(false),
            lowest_interrupted: AtomicU64::new(u64::MAX),
            running: (0..settings.workers).map(|_| AtomicU64::new(IDLE)).collect(),
            winner: Mutex::new(None),
            tallies: Mutex::new(Vec::with_capacity(settings.workers)),
        }
    }

    /// Runs attempts until the race is over.
    pub(super) fn run_worker(&self, worker: usize, mut stopwatch: impl Stopwatch) {
        let alarm = Alarm(&self.over);
        let mut tally = Tally::default();
        let mut attempt = Attempt::default();
        while let Some(index) = self.take_attempt(worker) {
            let mut stream = AttemptStream::new(self.settings.seed, index);
            let ended = attempt.try_synthesize_grasp(self.scene, &mut stream, &mut stopwatch, &|| {
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
                    self.enter_winner(index, grasp);
                    None
                }
                AttemptEnd::Rejected {
                    rejection,
                    wrench_angle,
                } => {
                    tally.note_miss(rejection, wrench_angle, index, || attempt.pose(self.scene));
                    Some(rejection)
                }
            };
            let record = Record {
                attempt: index,
                pruned,
                rejection,
            };
            if self.settings.reproducible {
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
                .deadline
                .is_some_and(|deadline| self.clock.now() >= deadline)
    }

    /// Enters a valid grasp: any ends the race, unless it is to be the one of the lowest index.
    fn enter_winner(&self, index: u64, grasp: Box<Grasp>) {
        let mut winner = self.winner.lock().unwrap_or_else(PoisonError::into_inner);
        if self.settings.reproducible {
            self.bound.fetch_min(index, Ordering::SeqCst);
            if winner.as_ref().is_none_or(|&(lowest, _)| index < lowest) {
                *winner = Some((index, grasp));
            }
        } else {
            self.over.store(true, Ordering::Relaxed);
            winner.get_or_insert((index, grasp));
        }
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
            .filter(|&(index, _)| !self.settings.reproducible || index < interrupted);
        let winning_index = winner.as_ref().map(|&(index, _)| index);
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
            ..SearchReport::default()
        };
        let lowest_winner = winning_index.filter(|_| self.settings.reproducible);
        for tally in self.tallies.into_inner().unwrap_or_else(PoisonError::into_inner) {
            tally.add_to(&mut report, lowest_winner);
        }
        if winner.is_some() {
            report.nearest_miss = None;
        }
        SearchOutcome {
            end,
            grasp: winner.map(|(_, grasp)| *grasp),
            report,
        }
    }
}
