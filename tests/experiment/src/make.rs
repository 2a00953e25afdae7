//! Makes records: searches with the crate that the server searches with, and looks closely at single attempts.

mod details;

pub(crate) use details::COMFORT_REPEATS;

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, HoldoutError, holdouts},
};
use grasp_synthesis::{
    clock::Clock,
    constraints::Constraints,
    hand::{Handedness, rig::Rig},
    holdout::Holdout,
    rejection::Rejection,
    search::{SearchEnd, SearchSettings, find_grasp},
    strategy::{Choice, Validity},
    synthesis::{
        attempt::{Attempt, AttemptEnd, Scene},
        random::AttemptStream,
        stopwatch::NoStopwatch,
    },
};

use crate::{
    plan::{Cell, Set, Settings},
    record::{Record, SearchFigures},
};

/// The receiving hand: the thesis' own.
pub const RECEIVING_RIG: &str = "thesis";

/// The machine's monotonic clock.
pub(crate) struct MonotonicClock(Instant);

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// Why nothing can be made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A built-in holdout is broken.
    #[error("the built-in holdout {0} is broken")]
    Holdout(&'static str, #[source] HoldoutError),
    /// A built-in rig is missing.
    #[error("the rig {RECEIVING_RIG:?} is not built in")]
    Rig,
    /// The system gives no threads.
    #[error("cannot start {0} threads")]
    Threads(usize, #[source] rayon::ThreadPoolBuildError),
}

/// The holdouts, ready to be searched, and the threads to do it.
pub struct Maker {
    holdouts: Vec<Holdout>,
    rig: &'static Rig,
    pools: Vec<(usize, rayon::ThreadPool)>,
    clock: MonotonicClock,
}

impl Maker {
    /// Gets everything ready that the settings need.
    ///
    /// # Errors
    /// A built-in holdout or hand is broken, or there are no threads to be had.
    pub fn new(settings: &Settings) -> Result<Self, MakeError> {
        let ready = |holdout: &'static BuiltInHoldout| {
            holdout
                .to_holdout()
                .map_err(|error| MakeError::Holdout(&holdout.name, error))
        };
        let mut threads = settings.threads.clone();
        threads.push(1);
        threads.sort_unstable();
        threads.dedup();
        let pool = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map(|pool| (threads, pool))
                .map_err(|error| MakeError::Threads(threads, error))
        };
        Ok(Self {
            holdouts: holdouts().iter().map(ready).collect::<Result<_, _>>()?,
            rig: &hand(RECEIVING_RIG, Handedness::Right).ok_or(MakeError::Rig)?.rig,
            pools: threads.into_iter().map(pool).collect::<Result<_, _>>()?,
            clock: MonotonicClock(Instant::now()),
        })
    }

    /// Searches for the valid grasp number `number` of a cell. None if it was told to stop.
    pub fn valid(&self, settings: &Settings, cell: &Cell, number: u64, stop: &AtomicBool) -> Option<Record> {
        let seed = settings.seed_of_valid(cell, number);
        let holdout = &self.holdouts[cell.holdout];
        let search = SearchSettings {
            seed,
            strategy: cell.set.strategy,
            bend_ratios: cell.set.bend_ratios,
            validity: Validity::Thesis,
            friction: holdout.object.friction_under(Validity::Thesis),
            constraints: Constraints::default(),
            choice: Choice::FirstValid,
            atlas: None,
            reproducible: false,
            first_attempt: 0,
            max_attempts: u64::MAX,
            deadline: None,
            workers: cell.threads,
            record_step_times: false,
        };
        let (_, pool) = self.pools.iter().find(|(threads, _)| *threads == cell.threads)?;
        // From inside the pool, so that waking a thread is not measured where one thread is asked for.
        let (outcome, took) = pool.install(|| {
            let start = self.clock.now();
            let outcome = find_grasp(pool, holdout, self.rig, &search, &self.clock, stop);
            (outcome, self.clock.now().saturating_sub(start))
        });
        let attempt = match outcome.end {
            SearchEnd::Found => outcome.report.attempt?,
            SearchEnd::DeadlinePassed | SearchEnd::AttemptsExhausted | SearchEnd::Stopped => return None,
        };
        let details = (cell.threads == 1).then(|| {
            let closer = self.closer_look(cell, seed, attempt);
            debug_assert!(matches!(closer.end, AttemptEnd::Valid(_)), "attempt {attempt}");
            closer.details
        });
        Some(Record {
            cell: *cell,
            number,
            seed,
            attempt,
            rejection: None,
            search: Some(SearchFigures {
                attempts: outcome.report.attempts,
                pruned_placements: outcome.report.pruned_placements,
                rejections: Rejection::OF_THESIS.map(|kind| outcome.report.rejections[kind.index()]),
                nanoseconds: nanoseconds(took),
            }),
            details,
        })
    }

    /// The invalid attempts from number `from` to `until` of a cell: the first ones of their seed, starting at attempt
    /// `first_attempt`.
    pub fn invalid(
        &self,
        settings: &Settings,
        cell: &Cell,
        numbers: std::ops::Range<u64>,
        first_attempt: u64,
    ) -> Vec<Record> {
        let seed = settings.seed_of_invalid(cell);
        let mut records = Vec::new();
        let mut number = numbers.start;
        let mut attempt = first_attempt;
        while number < numbers.end {
            let closer = self.closer_look(cell, seed, attempt);
            if let AttemptEnd::Rejected { rejection, .. } = closer.end {
                records.push(Record {
                    cell: *cell,
                    number,
                    seed,
                    attempt,
                    rejection: Some(rejection),
                    search: None,
                    details: Some(closer.details),
                });
                number += 1;
            }
            attempt += 1;
        }
        records
    }

    /// Runs a record's attempt again. True if it ends as recorded, with the same wrist and digits.
    pub fn comes_out_again(&self, record: &Record) -> bool {
        let closer = self.closer_look(&record.cell, record.seed, record.attempt);
        let rejection = match closer.end {
            AttemptEnd::Valid(_) => None,
            AttemptEnd::Rejected { rejection, .. } => Some(rejection),
            AttemptEnd::Interrupted => return false,
        };
        rejection == record.rejection
            && record.details.as_ref().is_none_or(|details| {
                details.measures == closer.details.measures && details.digits == closer.details.digits
            })
    }

    /// The valid grasp of a record, made again.
    pub fn grasp_of(&self, record: &Record) -> Option<Box<grasp_synthesis::grasp::Grasp>> {
        let scene = self.scene(&record.cell);
        let mut stream = AttemptStream::new(record.seed, record.attempt);
        let end = Attempt::default().try_synthesize_grasp(&scene, &mut stream, &mut NoStopwatch, &|| false);
        match end {
            AttemptEnd::Valid(grasp) => Some(grasp),
            AttemptEnd::Rejected { .. } | AttemptEnd::Interrupted => None,
        }
    }

    fn scene(&self, cell: &Cell) -> Scene<'_> {
        let holdout = &self.holdouts[cell.holdout];
        let Set {
            strategy,
            bend_ratios,
        } = cell.set;
        let friction = holdout.object.friction_under(Validity::Thesis);
        Scene::new(holdout, self.rig, strategy, bend_ratios, friction)
    }
}

/// A duration as it is recorded; a search of more than 584 years counts as that long.
fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
