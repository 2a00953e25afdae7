//! Searches on the built-in holdouts without a server, for benches and figures.

use std::{
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};

use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, holdouts},
};
use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    known::seed_source::SeedSource,
    model::{
        hand::Handedness,
        holdout::Holdout,
        object::GraspObject,
        plain_object::THESIS_FRICTION,
        strategy::{Strategy, Validity},
    },
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        SearchOutcome, find_grasp,
        scene::Task,
        settings::{Known, Query, Run, SearchSettings},
    },
};

/// The machine's monotonic clock.
pub struct MonotonicClock(Instant);

impl Default for MonotonicClock {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// The fifteen holdouts, the thesis' right hand and a pool of workers.
pub struct Bench {
    /// The holdouts, ready to be searched, with their descriptions.
    pub holdouts: Vec<(&'static BuiltInHoldout, Holdout)>,
    /// The receiving hand.
    pub rig: &'static PreparedRig,
    pool: rayon::ThreadPool,
    workers: usize,
}

impl Bench {
    /// Searches with this many workers.
    pub fn new(workers: usize) -> Self {
        Self {
            holdouts: holdouts()
                .iter()
                .map(|built_in| {
                    (
                        built_in,
                        built_in.to_holdout().expect("built-in holdouts are sound"),
                    )
                })
                .collect(),
            rig: &hand("thesis", Handedness::Right)
                .expect("the thesis rig is built in")
                .rig,
            pool: rayon::ThreadPoolBuilder::new()
                .num_threads(workers)
                .build()
                .expect("threads can be started"),
            workers,
        }
    }

    /// Searches holdout number `holdout` for a valid grasp, in `max_attempts` attempts of `seed` starting at
    /// `first_attempt`.
    pub fn search(
        &self,
        holdout: usize,
        strategy: Strategy,
        seed: u64,
        first_attempt: u64,
        max_attempts: u64,
    ) -> SearchOutcome {
        self.search_on(
            &self.holdouts[holdout].1,
            strategy,
            seed,
            first_attempt,
            max_attempts,
        )
    }

    /// [`Self::search`] on any holdout.
    pub fn search_on(
        &self,
        holdout: &Holdout,
        strategy: Strategy,
        seed: u64,
        first_attempt: u64,
        max_attempts: u64,
    ) -> SearchOutcome {
        let settings = SearchSettings {
            query: Query {
                strategy,
                validity: Validity::Thesis,
                bend_ratios: strategy.default_bend_ratios(),
                friction: Some(THESIS_FRICTION),
                ..Query::default()
            },
            run: Run {
                seed,
                first_attempt,
                max_attempts,
                workers: self.workers,
                ..Run::default()
            },
            ..SearchSettings::default()
        };
        let clock = MonotonicClock::default();
        let task = Task {
            holdout,
            object: &prepared(&holdout.object),
            rig: self.rig,
        };
        find_grasp(&self.pool, task, &settings, &clock, Stop::NEVER)
    }

    /// Runs exactly `attempts` attempts of one worker on a holdout, continuing after each valid grasp; returns the
    /// number of valid ones.
    pub fn run_attempts(&self, holdout: usize, strategy: Strategy, seed: u64, attempts: u64) -> u64 {
        assert_eq!(self.workers, 1, "only one worker runs attempts in order");
        let (mut next, mut valid) = (0, 0);
        while next < attempts {
            let outcome = self.search(holdout, strategy, seed, next, attempts - next);
            match outcome.report.attempt {
                Some(attempt) => {
                    valid += 1;
                    next = attempt + 1;
                }
                None => break,
            }
        }
        valid
    }
}

/// A reproducible default search by one worker, without known grips, whose attempts are seeded by `seeds`.
pub fn search_from(
    seeds: SeedSource,
    holdout: &Holdout,
    rig: &PreparedRig,
    seed: u64,
    max_attempts: u64,
) -> SearchOutcome {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("threads can be started");
    let settings = SearchSettings {
        known: Known {
            seeds,
            ..Known::default()
        },
        run: Run {
            seed,
            reproducible: true,
            max_attempts,
            ..Run::default()
        },
        ..SearchSettings::default()
    };
    let clock = MonotonicClock::default();
    let task = Task {
        holdout,
        object: &prepared(&holdout.object),
        rig,
    };
    find_grasp(&pool, task, &settings, &clock, Stop::NEVER)
}

/// An object with what proposals derive from it, derived once for all that ask.
pub fn prepared(object: &Arc<GraspObject>) -> Arc<PreparedObject> {
    static PREPARED: Mutex<Vec<Arc<PreparedObject>>> = Mutex::new(Vec::new());
    let mut all = PREPARED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = all.iter().find(|known| Arc::ptr_eq(known.object(), object)) {
        return Arc::clone(known);
    }
    let new = Arc::new(PreparedObject::new(Arc::clone(object)));
    all.push(Arc::clone(&new));
    new
}
