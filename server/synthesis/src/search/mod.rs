//! The race: workers pull attempt indices until a valid grasp is found, the deadline passes or they are told to stop.

mod race;
mod report;
mod tally;

use std::{sync::atomic::AtomicBool, time::Duration};

use crate::{
    clock::Clock,
    grasp::Grasp,
    hand::rig::Rig,
    holdout::Holdout,
    strategy::{BendRatioChoice, Strategy, Validity},
    synthesis::{
        attempt::Scene,
        stopwatch::{NoStopwatch, StepStopwatch},
    },
};
use race::Race;
pub use report::{NearestMiss, SearchReport};

pub use crate::synthesis::stopwatch::StepTimes;

/// How to search.
#[derive(Clone, Debug)]
pub struct SearchSettings {
    /// Start of every attempt's random stream.
    pub seed: u64,
    /// The step of the ladder.
    pub strategy: Strategy,
    /// Which grasps count as valid.
    pub validity: Validity,
    /// Which bend ratios a digit tries.
    pub bend_ratios: BendRatioChoice,
    /// Coefficient of static friction.
    pub friction: f32,
    /// Answer with the valid attempt of the lowest index instead of the first to finish.
    pub reproducible: bool,
    /// The attempt indices to run: from here …
    pub first_attempt: u64,
    /// … this many at most.
    pub max_attempts: u64,
    /// When to give up, by the clock that is handed in.
    pub deadline: Option<Duration>,
    /// How many workers race; at least 1.
    pub workers: usize,
    /// Record the time spent in each step?
    pub record_step_times: bool,
}

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
    /// What the search did.
    pub report: SearchReport,
}

/// Races `settings.workers` tasks of `pool` for a valid grasp. Returns when all of them have stopped.
///
/// Called from a thread of `pool` itself, that thread is one of the workers; called from elsewhere, it waits.
///
/// A worker looks at `stop`, at the clock and at what the others found at least every 50 µs or so of its own work.
/// Without a deadline or with one that does not come, and without `stop`, a search with `settings.reproducible` has the
/// same outcome for any number of workers, step times aside. If it is cut short, it has no grasp: never another one.
///
/// # Panics
/// If an attempt panics. The other workers stop first, and the pool stays usable.
pub fn find_grasp(
    pool: &rayon::ThreadPool,
    holdout: &Holdout,
    rig: &Rig,
    settings: &SearchSettings,
    clock: &dyn Clock,
    stop: &AtomicBool,
) -> SearchOutcome {
    debug_assert!(settings.workers >= 1, "there must be at least one worker");
    let scene = Scene::new(
        holdout,
        rig,
        settings.strategy,
        settings.bend_ratios,
        settings.friction,
    )
    .with_validity(settings.validity);
    let race = Race::new(&scene, settings, clock, stop);
    let run = |worker: usize| {
        if settings.record_step_times {
            race.run_worker(worker, StepStopwatch::new(clock));
        } else {
            race.run_worker(worker, NoStopwatch);
        }
    };
    let run = &run;
    pool.in_place_scope(|scope| {
        let own = usize::from(pool.current_thread_index().is_some());
        for worker in own..settings.workers {
            scope.spawn(move |_| run(worker));
        }
        if own == 1 {
            run(0);
        }
    });
    race.outcome()
}
