//! Searches on the built-in holdouts without a server, for benches and figures.

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, holdouts},
};
use grasp_synthesis::{
    base::clock::Clock,
    known::{recent_grips::RecentGrips, seed_source::SeedSource},
    base::mechanisms::Mechanisms,
    model::{
        constraints::Constraints,
        hand::{Handedness, rig::Rig},
        holdout::Holdout,
        object::THESIS_FRICTION,
        strategy::{Choice, Strategy, Validity},
    },
    search::{SearchOutcome, find_grasp, settings::SearchSettings},
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
    pub rig: &'static Rig,
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
            seed,
            strategy,
            bend_ratios: strategy.default_bend_ratios(),
            validity: Validity::Thesis,
            friction: THESIS_FRICTION,
            reproducible: false,
            first_attempt,
            max_attempts,
            deadline: None,
            workers: self.workers,
            record_step_times: false,
            mechanisms: Mechanisms::ALL,
            constraints: Constraints::default(),
            choice: Choice::FirstValid,
            atlas: None,
            starts: SeedSource::Nothing,
            recent: RecentGrips::default(),
            known_tried: 0,
        };
        let clock = MonotonicClock::default();
        find_grasp(
            &self.pool,
            holdout,
            self.rig,
            &settings,
            &clock,
            &AtomicBool::new(false),
        )
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
    rig: &Rig,
    seed: u64,
    max_attempts: u64,
) -> SearchOutcome {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("threads can be started");
    let settings = SearchSettings {
        seed,
        strategy: Strategy::Guided,
        validity: Validity::Physical,
        bend_ratios: Strategy::Guided.default_bend_ratios(),
        friction: holdout.object.friction_under(Validity::Physical),
        constraints: Constraints::default(),
        choice: Choice::FirstValid,
        atlas: None,
        starts: seeds,
        recent: RecentGrips::default(),
        known_tried: 0,
        reproducible: true,
        first_attempt: 0,
        max_attempts,
        deadline: None,
        workers: 1,
        record_step_times: false,
    };
    let clock = MonotonicClock::default();
    find_grasp(&pool, holdout, rig, &settings, &clock, &AtomicBool::new(false))
}
