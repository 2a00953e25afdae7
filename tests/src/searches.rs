//! Searches on the built-in holdouts without a server in between, for benches and figures.

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

/// What the searches need: the fifteen holdouts, the thesis' right hand and a pool of workers.
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
                .expect("threads can be had"),
            workers,
        }
    }

    /// Searches holdout number `holdout` for a valid grasp among `max_attempts` attempts of `seed` from
    /// `first_attempt` on.
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

    /// The same on any holdout.
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

    /// Runs exactly `attempts` attempts of one worker on a holdout, going on after each valid grasp; returns how many
    /// were valid.
    pub fn run_attempts(&self, holdout: usize, strategy: Strategy, seed: u64, attempts: u64) -> u64 {
        assert_eq!(
            self.workers, 1,
            "attempt indices are run in order by one worker only"
        );
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
