//! The workers of a search and the state that they share. Each takes the next attempt, runs it and records a valid grasp, until a
//! winner is certain.

use std::{
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

use super::{
    Replaceable, SearchEnd, SearchOutcome,
    attempt::Attempt,
    current::{is_at_hand, nearness},
    known_grips::{KnownGrips, grasp_value},
    report::{FoundGrasp, GraspSource, Record, SearchReport, Tally},
    scene::Scene,
    settings::SearchSettings,
};
use crate::{
    base::{
        clock::Clock,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::Stopwatch,
    },
    model::{grasp::Grasp, strategy::Choice},
    physical::grip::Gripper,
};

/// How long known grips are tried before other workers are woken for fresh attempts.
const HEAD_START: Duration = Duration::from_micros(300);

/// Attempts in which a reproducible search looks for a natural grasp after a valid one that is not. They take a few milliseconds,
/// as long as other searches go on ([`super::settings::Query::refinement`]).
pub const REFINING_ATTEMPTS: u64 = 16;

/// Least time, or number of attempts of a reproducible search, to look for a grasp in a preferred region that is free. Most
/// searches find one in a tenth of it.
const REGION_REFINEMENT: Duration = Duration::from_millis(100);
const REGION_ATTEMPTS: u64 = 256;

/// Marks a worker that is not running an attempt.
const IDLE: u64 = u64::MAX;

pub(super) struct Race<'a> {
    scene: &'a Scene<'a>,
    settings: &'a SearchSettings,
    clock: &'a dyn Clock,
    stop: Stop<'a>,
    end: u64,
    /// The next attempt to start. Indices are taken in order, so all below it are taken.
    next: AtomicU64,
    /// Attempts of a reproducible search above this index need not run: the lowest attempt with a natural grasp, or the last that
    /// may replace another grasp.
    bound: AtomicU64,
    /// When a search that is not reproducible ends with a grasp that is not natural, in nanoseconds of its clock.
    settles: AtomicU64,
    /// Stops all workers: the grasp is decided, or a worker panicked.
    over: AtomicBool,
    lowest_interrupted: AtomicU64,
    /// The attempt that each worker runs, or a lower index; [`IDLE`] before it starts and after it stops.
    running: Vec<AtomicU64>,
    known: Option<&'a KnownGrips<'a>>,
    /// True if the best known grip is valid, but outside a free region that the object's owner prefers.
    is_beside_region: AtomicBool,
    candidates: AtomicU64,
    winners: Mutex<Winners>,
    tallies: Mutex<Vec<Tally>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

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
        stop: Stop<'a>,
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
            settles: AtomicU64::new(u64::MAX),
            over: AtomicBool::new(false),
            lowest_interrupted: AtomicU64::new(u64::MAX),
            running: (0..settings.run.workers).map(|_| AtomicU64::new(IDLE)).collect(),
            known,
            is_beside_region: AtomicBool::new(false),
            candidates: AtomicU64::new(0),
            winners: Mutex::default(),
            tallies: Mutex::new(Vec::with_capacity(settings.run.workers)),
        }
    }

    pub(super) fn run_worker(&self, worker: usize, mut stopwatch: Stopwatch<'_>) {
        let guard = PanicGuard(&self.over);
        let mut tally = Tally::default();
        let mut attempt = Attempt::default();
        self.try_known_grips(worker);
        while let Some(index) = self.take_attempt(worker) {
            let mut stream = AttemptStream::new(self.settings.run.seed, index);
            let is_over = || self.is_over_for(index);
            let ended = attempt.run(self.scene, &mut stream, &mut stopwatch, Stop::when(&is_over));
            let pruned = attempt.pruned_placements;
            let rejection = match ended {
                Err(Failure::Stopped) => {
                    self.lowest_interrupted.fetch_min(index, Ordering::SeqCst);
                    tally.interrupted_prunes = pruned;
                    break;
                }
                Ok(grasp) => {
                    let is_chosen = !self.has_preferences() || self.is_met_by(&grasp);
                    let value = self.value_of(&grasp);
                    self.record_valid(GraspSource::Attempt(index), grasp, value, is_chosen);
                    None
                }
                Err(Failure::Rejected {
                    rejection,
                    wrench_angle,
                }) => {
                    // An inadmissible wrist is not a near miss.
                    if rejection != Rejection::UnmetRequirement || !attempt.is_unposed() {
                        let pose = || attempt.pose(self.scene);
                        tally.report.note_miss(rejection, wrench_angle, index, pose);
                    }
                    Some(rejection)
                }
            };
            let record = Record {
                attempt: index,
                pruned,
                rejection,
            };
            tally.count_when_settled(record, || self.last_settled());
        }
        self.running[worker].store(IDLE, Ordering::SeqCst);
        tally.report.step_times = stopwatch.times();
        lock(&self.tallies).push(tally);
        drop(guard);
    }

    /// Takes the next attempt that has to run; `None` if there is none.
    fn take_attempt(&self, worker: usize) -> Option<u64> {
        // Check before taking: a taken index must run, or attempts below a winner would stay unsettled.
        let open = self.next.load(Ordering::SeqCst);
        if open >= self.end || self.is_over_for(open) {
            return None;
        }
        // Announce a lower bound of the index before taking it.
        self.running[worker].store(open, Ordering::SeqCst);
        let index = self.next.fetch_add(1, Ordering::SeqCst);
        (index < self.end).then_some(index)
    }

    fn is_over_for(&self, index: u64) -> bool {
        self.over.load(Ordering::Relaxed)
            || self.bound.load(Ordering::Relaxed) < index
            || self.stop.is_over()
            || self.end_time().is_some_and(|end| self.clock.now() >= end)
    }

    fn end_time(&self) -> Option<Duration> {
        let settled = self.settles.load(Ordering::Relaxed);
        let settled = (settled != u64::MAX).then(|| Duration::from_nanos(settled));
        [self.settings.run.deadline, settled].into_iter().flatten().min()
    }

    /// Tries known grips before any other worker is woken: for [`HEAD_START`], or all of them if the search is reproducible.
    pub(super) fn tries_known_first(&self) -> bool {
        if self.known.is_none() || self.settings.query.choice == Choice::BestWithinBudget {
            return false;
        }
        let is_reproducible = self.settings.run.reproducible;
        self.try_known_until((!is_reproducible).then(|| self.clock.now() + HEAD_START))
    }

    /// True if the best known grip is valid, but attempts may replace it.
    pub(super) fn is_beside_region(&self) -> bool {
        self.is_beside_region.load(Ordering::Relaxed)
    }

    /// Tries known grips until one is valid or the clock reaches `until`. True if one is valid and no attempt may replace it.
    pub(super) fn try_known_until(&self, until: Option<Duration>) -> bool {
        let is_late = || until.is_some_and(|until| self.clock.now() >= until);
        let Some((source, grasp)) = self.next_valid(&mut Gripper::default(), is_late) else {
            return false;
        };
        let is_where_wanted = source.is_preferred() || self.scene.preference().is_where_wanted(&grasp);
        let is_chosen = is_where_wanted || !self.has_preferences();
        self.is_beside_region.store(!is_chosen, Ordering::Relaxed);
        let value = grasp_value(&grasp);
        self.record_valid(source, grasp, value, is_chosen);
        is_chosen
    }

    /// The next valid known grip, until time is up or the race is decided.
    fn next_valid(
        &self,
        gripper: &mut Gripper,
        is_late: impl Fn() -> bool,
    ) -> Option<(GraspSource, Box<Grasp>)> {
        self.known?
            .next_valid(gripper, || self.is_over_for(0) || is_late())
    }

    /// Tries known grips while other workers run attempts: on one worker, or on all for the best grasp.
    fn try_known_grips(&self, worker: usize) {
        if self.settings.query.choice == Choice::FirstValid {
            if worker == 0 && !self.is_beside_region() {
                self.try_known_until(None);
            }
            return;
        }
        let mut gripper = Gripper::default();
        while let Some((source, grasp)) = self.next_valid(&mut gripper, || false) {
            let value = grasp_value(&grasp);
            self.record_valid(source, grasp, value, true);
        }
    }

    fn record_valid(&self, source: GraspSource, grasp: Box<Grasp>, value: f32, is_chosen: bool) {
        self.candidates.fetch_add(1, Ordering::Relaxed);
        let goes_on = self.show(source, &grasp, value);
        let is_reproducible = self.settings.run.reproducible;
        let (refinement, attempts) = self.refinement_of(&grasp);
        // Known grips precede all attempts.
        let first = self.settings.run.first_attempt;
        let next = source.attempt().map_or(first, |index| index.saturating_add(1));
        let winner = Winner {
            source,
            grasp,
            value,
            last_replacing: next.saturating_add(attempts - 1),
        };
        let mut winners = lock(&self.winners);
        let rival = &mut winners.chosen;
        let is_preferred = match (self.settings.query.choice, source) {
            (_, GraspSource::Preferred(_)) => {
                if !goes_on {
                    self.over.store(true, Ordering::Relaxed);
                }
                rival.as_ref().is_none_or(|rival| !rival.source.is_preferred())
            }
            (Choice::BestWithinBudget, _) => rival
                .as_ref()
                .is_none_or(|best| !best.source.is_preferred() && value > best.value),
            (Choice::FirstValid, _) if !is_chosen => {
                if is_reproducible {
                    self.bound.fetch_min(winner.last_replacing, Ordering::SeqCst);
                } else {
                    let settles = self.clock.now().saturating_add(refinement);
                    let nanos = u64::try_from(settles.as_nanos()).unwrap_or(u64::MAX - 1);
                    self.settles.fetch_min(nanos, Ordering::SeqCst);
                }
                winners.others.push(winner);
                return;
            }
            (Choice::FirstValid, GraspSource::Attempt(index)) if is_reproducible => {
                self.bound.fetch_min(index, Ordering::SeqCst);
                // Known grips precede all attempts.
                rival
                    .as_ref()
                    .is_none_or(|lowest| lowest.source.attempt().is_some_and(|lowest| index < lowest))
            }
            (Choice::FirstValid, _) => {
                self.over.store(true, Ordering::Relaxed);
                rival.is_none()
            }
        };
        if is_preferred {
            *rival = Some(winner);
        }
    }

    /// For how long, and how many attempts, the search continues after a grasp that is not natural.
    fn refinement_of(&self, grasp: &Grasp) -> (Duration, u64) {
        let refinement = self.settings.query.refinement;
        if self.scene.current().is_some() || self.scene.preference().is_where_wanted(grasp) {
            (refinement, REFINING_ATTEMPTS)
        } else {
            (refinement.max(REGION_REFINEMENT), REGION_ATTEMPTS)
        }
    }

    /// True if a search for the first valid grasp may end with this one: it is natural or, after a current grasp, next to the
    /// present hand.
    fn is_met_by(&self, grasp: &Grasp) -> bool {
        self.scene.current().map_or_else(
            || self.scene.preference().is_met_by(grasp),
            |current| is_at_hand(self.scene, current, grasp),
        )
    }

    /// The quality of an attempt's grasp: its score or, when looking for the first to follow a current grasp, its nearness.
    fn value_of(&self, grasp: &Grasp) -> f32 {
        match self.scene.current() {
            Some(current) if self.settings.query.choice == Choice::FirstValid => {
                nearness(self.scene, current, grasp)
            }
            _ => grasp_value(grasp),
        }
    }

    /// Shows a valid grasp to the observer. True if the race continues after a preferred grip.
    fn show(&self, source: GraspSource, grasp: &Grasp, value: f32) -> bool {
        let Some(observer) = &self.settings.run.observer else {
            return false;
        };
        if observer.wants(grasp, source, value) {
            let mut grasp = Box::new(grasp.clone());
            self.scene.pose_arm(&mut grasp);
            observer.keep(FoundGrasp {
                grasp,
                source,
                value,
                at: self.clock.now(),
            });
        }
        observer.goes_on_after_preferred()
    }

    /// True if a natural grasp wins over one found just before it.
    fn has_preferences(&self) -> bool {
        let query = &self.settings.query;
        query.choice == Choice::FirstValid && query.uses_known_grips() && !query.refinement.is_zero()
    }

    /// The highest index such that all attempts up to it have ended, and none below it lost to a valid attempt with a lower index.
    fn last_settled(&self) -> Option<u64> {
        if !self.settings.run.reproducible {
            return Some(u64::MAX);
        }
        let running = self.running.iter().map(|running| running.load(Ordering::SeqCst));
        // Read the bound last: a valid attempt lowers it before its worker moves on.
        let lowest_running = running.min()?;
        let before = lowest_running.checked_sub(1)?;
        Some(before.min(self.bound.load(Ordering::SeqCst)))
    }

    pub(super) fn outcome(self) -> SearchOutcome {
        let interrupted = self.lowest_interrupted.into_inner();
        let is_reproducible = self.settings.run.reproducible;
        let winners = self.winners.into_inner().unwrap_or_else(PoisonError::into_inner);
        let (winner, replaceable_until) = winners.decided(is_reproducible);
        let settles = Duration::from_nanos(self.settles.into_inner());
        let replaceable_until = replaceable_until.map(|last| {
            if is_reproducible {
                Replaceable::UntilAttempt(last)
            } else {
                Replaceable::UntilTime(settles)
            }
        });
        // In a reproducible search, an interrupted attempt with a lower index, or one that replaces the winner, might have won.
        let last_deciding = match replaceable_until {
            Some(Replaceable::UntilAttempt(last)) => Some(last),
            _ => winner.as_ref().and_then(|winner| winner.source.attempt()),
        };
        let mut winner =
            winner.filter(|_| !is_reproducible || last_deciding.is_none_or(|index| index < interrupted));
        if let Some(winner) = &mut winner {
            self.scene.pose_arm(&mut winner.grasp);
        }
        let source = winner.as_ref().map(|winner| winner.source);
        let end = if winner.is_some() {
            SearchEnd::Found
        } else if interrupted == u64::MAX && self.next.into_inner() >= self.end {
            SearchEnd::AttemptsExhausted
        } else if self.stop.is_over() {
            SearchEnd::Stopped
        } else {
            SearchEnd::DeadlinePassed
        };
        let mut report = SearchReport {
            source,
            // The count of other grasps would depend on the number of workers.
            candidates: if is_reproducible {
                u64::from(source.is_some())
            } else {
                self.candidates.into_inner()
            },
            ..SearchReport::default()
        };
        let last_counted = last_deciding.filter(|_| winner.is_some() && is_reproducible);
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

struct Winner {
    source: GraspSource,
    grasp: Box<Grasp>,
    value: f32,
    /// The last attempt of a reproducible search whose natural grasp replaces this one, if this one is not natural.
    last_replacing: u64,
}

/// The valid grasps so far.
#[derive(Default)]
struct Winners {
    /// The best, the first, or the natural one with the lowest index.
    chosen: Option<Winner>,
    others: Vec<Winner>,
}

impl Winners {
    /// The winner and, if it is not natural, the last attempt that may replace it (meaningful only if the search is reproducible).
    fn decided(self, is_reproducible: bool) -> (Option<Winner>, Option<u64>) {
        let Self { chosen, others } = self;
        let last = others.iter().map(|other| other.last_replacing).min();
        // Attempts beyond the last need not have run.
        let counts = |winner: &Winner| !is_reproducible || winner.source.attempt() <= last;
        if let Some(chosen) = chosen
            && (last.is_none() || counts(&chosen))
        {
            return (Some(chosen), None);
        }
        let better = |a: &Winner, b: &Winner| {
            a.value
                .total_cmp(&b.value)
                .then(b.source.attempt().cmp(&a.source.attempt()))
        };
        (others.into_iter().filter(counts).max_by(better), last)
    }
}
