//! The race: workers pull attempt indices until a valid grasp is found, the deadline passes or they are told to stop.

mod candidates;
mod race;
mod report;
mod tally;

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use crate::{
    atlas::{Atlas, recent::RecentGrips},
    clock::Clock,
    constraints::Constraints,
    grasp::Grasp,
    hand::rig::Rig,
    holdout::Holdout,
    strategy::{BendRatioChoice, Choice, Strategy, Validity},
    synthesis::{
        scene::Scene,
        stopwatch::{NoStopwatch, StepStopwatch},
    },
};
use candidates::KnownGrips;
use race::Race;
pub use report::{GraspSource, NearestMiss, SearchReport};

pub use crate::synthesis::{start_grips::StartFrom, stopwatch::StepTimes};

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
    /// What is demanded of the grasps beside being valid, in the object's frame.
    pub constraints: Constraints,
    /// Which of the valid grasps is wanted.
    pub choice: Choice,
    /// Grips that are known, to be tried first under `GUIDED` and `PHYSICAL`; made for this object and rig.
    pub atlas: Option<Arc<Atlas>>,
    /// Grips for attempts to start from where what is known is in the giver's way, or nothing is; likewise.
    pub starts: StartFrom,
    /// Grips that earlier searches found for this object and rig, under the object's own friction: tried after those of the
    /// atlas, and not if the search is reproducible.
    pub recent: RecentGrips,
    /// Known grips that need not be tried again, as [`LookUp::NotFound`] told of the same ones.
    pub known_tried: usize,
    /// Answer with the valid grip of the atlas that is first in its order, or else with the valid attempt of the lowest
    /// index, instead of with the first to finish.
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
    /// How good it is, where the best is wanted; more is better.
    pub value: f32,
    /// What the search did.
    pub report: SearchReport,
}

/// True if a search with these settings may be answered from an atlas.
pub fn uses_atlas(strategy: Strategy, validity: Validity) -> bool {
    strategy == Strategy::Guided && validity == Validity::Physical
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
    holdout: &Holdout,
    rig: &Rig,
    settings: &SearchSettings,
    clock: &dyn Clock,
    within: Duration,
) -> LookUp {
    if settings.choice != Choice::FirstValid || settings.reproducible {
        return LookUp::NotFound { tried: 0 };
    }
    let scene = prepare(holdout, rig, settings);
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
    find_grasp_in(pool, &prepare(holdout, rig, settings), settings, clock, stop)
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
    debug_assert!(settings.workers >= 1, "there must be at least one worker");
    let known = KnownGrips::of(scene, settings);
    let race = Race::new(scene, settings, known.as_ref(), clock, stop);
    // Mostly one of the first known grips is the answer, and waking a worker takes longer than looking at some dozens.
    if race.looks_ahead() {
        return race.outcome();
    }
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

/// What the attempts of a search share.
pub fn prepare<'a>(holdout: &'a Holdout, rig: &'a Rig, settings: &SearchSettings) -> Scene<'a> {
    let starts = if uses_atlas(settings.strategy, settings.validity) {
        settings.starts.clone()
    } else {
        StartFrom::Nothing
    };
    // The validity comes last: it brings kilobytes, which each step after it would move.
    Scene::new(
        holdout,
        rig,
        settings.strategy,
        settings.bend_ratios,
        settings.friction,
    )
    .with_constraints(settings.constraints)
    .starting_from(starts)
    .with_validity(settings.validity)
}
