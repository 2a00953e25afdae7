//! The race: workers pull attempt indices until a valid grasp is found, the deadline passes or they are told to stop.

pub mod attempt;
pub mod key_frames;
mod known_grips;
pub mod physical_attempt;
mod race;
mod report;
pub mod scene;
pub mod settings;
mod tally;

use std::{sync::atomic::AtomicBool, time::Duration};

use crate::{
    base::{
        clock::Clock,
        mechanisms::Mechanism,
        stopwatch::{NoStopwatch, StepStopwatch},
    },
    model::{grasp::Grasp, strategy::Choice},
};
use known_grips::KnownGrips;
use race::Race;
use scene::{Scene, Task};
use settings::SearchSettings;

pub use report::{GraspSource, NearestMiss, SearchReport};

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchEnd {
    /// A valid grasp was found.
    Found,
    /// The deadline passed first.
    DeadlinePassed,
    /// The attempts were used up.
    AttemptsExhausted,
    /// The stop flag was set.
    Stopped,
}

/// The end of a search.
#[derive(Clone, Debug)]
pub struct SearchOutcome {
    /// How it ended.
    pub end: SearchEnd,
    /// The grasp, if one was found.
    pub grasp: Option<Grasp>,
    /// How good it is, where the best is wanted; more is better.
    pub value: f32,
    /// What the search did.
    pub report: SearchReport,
}

/// The end of a look at known grips.
#[derive(Clone, Debug)]
pub enum LookUp {
    /// One of them holds.
    Found(Box<SearchOutcome>),
    /// Nothing was found in time.
    NotFound {
        /// How many were tried, or are out of the question.
        tried: usize,
    },
}

impl LookUp {
    /// What was found.
    pub fn found(self) -> Option<SearchOutcome> {
        match self {
            Self::Found(outcome) => Some(*outcome),
            Self::NotFound { .. } => None,
        }
    }
}

/// Looks for a valid grip among those that `settings` say are known, for no longer than `within` and without any other
/// thread. If none was found by then, [`find_grasp`] looks further, from there on where it is told how many were tried. For
/// first answers only, not for the best.
pub fn find_known_grasp(
    task: Task<'_>,
    settings: &SearchSettings,
    clock: &dyn Clock,
    within: Duration,
) -> LookUp {
    let is_first_valid = settings.query.choice == Choice::FirstValid && !settings.run.reproducible;
    if !is_first_valid || !settings.run.mechanisms.has(Mechanism::CallerLookUp) {
        return LookUp::NotFound { tried: 0 };
    }
    let scene = prepare(task, settings);
    let Some(known) = KnownGrips::of(&scene, settings) else {
        return LookUp::NotFound { tried: 0 };
    };
    let stop = AtomicBool::new(false);
    let race = Race::new(&scene, settings, Some(&known), clock, &stop);
    if race.look_ahead(Some(clock.now() + within)) {
        LookUp::Found(Box::new(race.outcome()))
    } else {
        LookUp::NotFound { tried: known.tried() }
    }
}

/// Races `settings.run.workers` tasks of `pool` for a valid grasp. Returns when all of them have stopped.
///
/// Called from a thread of `pool` itself, that thread is one of the workers; called from elsewhere, it waits.
///
/// A worker looks at `stop`, at the clock and at what the others found at least every 50 µs or so of its own work.
/// Without a deadline or with one that does not come, and without `stop`, a search with `settings.run.reproducible` has the
/// same outcome for any number of workers, step times aside. If it is cut short, it has no grasp: never another one.
///
/// # Panics
/// If an attempt panics. The other workers stop first, and the pool stays usable.
pub fn find_grasp(
    pool: &rayon::ThreadPool,
    task: Task<'_>,
    settings: &SearchSettings,
    clock: &dyn Clock,
    stop: &AtomicBool,
) -> SearchOutcome {
    find_grasp_in(pool, &prepare(task, settings), settings, clock, stop)
}

/// [`find_grasp`] in a scene that was prepared for the same settings, but for which of the attempts are to be run and
/// whether known grips are tried before them: what attempts find out about the holdout once serves further ones.
///
/// # Panics
/// As [`find_grasp`].
pub fn find_grasp_in(
    pool: &rayon::ThreadPool,
    scene: &Scene<'_>,
    settings: &SearchSettings,
    clock: &dyn Clock,
    stop: &AtomicBool,
) -> SearchOutcome {
    debug_assert!(settings.run.workers >= 1, "there must be at least one worker");
    let known = KnownGrips::of(scene, settings);
    let race = Race::new(scene, settings, known.as_ref(), clock, stop);
    // Mostly one of the first known grips is the answer, and waking a worker takes longer than looking at some dozens.
    if race.looks_ahead() {
        return race.outcome();
    }
    let run = |worker: usize| {
        if settings.run.record_step_times {
            race.run_worker(worker, StepStopwatch::new(clock));
        } else {
            race.run_worker(worker, NoStopwatch);
        }
    };
    let run = &run;
    pool.in_place_scope(|scope| {
        let own = usize::from(pool.current_thread_index().is_some());
        for worker in own..settings.run.workers {
            scope.spawn(move |_| run(worker));
        }
        if own == 1 {
            run(0);
        }
    });
    race.outcome()
}

/// What the attempts of a search share.
pub fn prepare<'a>(task: Task<'a>, settings: &SearchSettings) -> Scene<'a> {
    Scene::new(task, settings)
}
