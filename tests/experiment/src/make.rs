//! Runs searches and single attempts.

use std::time::{Duration, Instant};

use grasp_assets::{
    hands::hand,
    holdouts::{BuiltInHoldout, HoldoutError, holdouts},
};
use grasp_synthesis::{
    base::{clock::Clock, stop::Stop},
    model::{hand::Handedness, holdout::Holdout, strategy::Validity},
    propose::prepared::PreparedRig,
    search::{
        SearchReport, find_grasp,
        scene::{Scene, Task},
        settings::{Query, Run, SearchSettings},
    },
};

use crate::plan::{Cell, Set, Settings};

/// The receiving hand under the thesis' validity: the server's default.
const RIG: &str = "thesis";

/// Why no grasps can be made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A built-in holdout is broken.
    #[error("the built-in holdout {0} is broken")]
    Holdout(&'static str, #[source] HoldoutError),
    /// A built-in rig is missing.
    #[error("the rig {0:?} is not built in")]
    Rig(&'static str),
    /// The system provides no threads.
    #[error("cannot start {0} threads")]
    Threads(usize, #[source] rayon::ThreadPoolBuildError),
}

/// The machine's monotonic clock.
pub(crate) struct MonotonicClock(Instant);

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// A finished search.
pub(crate) struct Search {
    pub(crate) report: SearchReport,
    /// Wall-clock time.
    pub(crate) took: Duration,
}

/// Prepared holdouts, and threads to search them with.
pub(crate) struct Maker {
    pub(crate) holdouts: Vec<Holdout>,
    pub(crate) rig: &'static PreparedRig,
    pools: Vec<(usize, rayon::ThreadPool)>,
    pub(crate) clock: MonotonicClock,
}

impl Maker {
    pub(crate) fn new(settings: &Settings) -> Result<Self, MakeError> {
        let receiving_hand = hand(RIG, Handedness::Right).ok_or(MakeError::Rig(RIG))?;
        let ready = |holdout: &'static BuiltInHoldout| {
            holdout
                .to_holdout()
                .map_err(|error| MakeError::Holdout(&holdout.name, error))
        };
        let pool = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map(|pool| (threads, pool))
                .map_err(|error| MakeError::Threads(threads, error))
        };
        Ok(Self {
            holdouts: holdouts().iter().map(ready).collect::<Result<_, _>>()?,
            rig: &receiving_hand.rig,
            pools: [1, settings.threads]
                .into_iter()
                .map(pool)
                .collect::<Result<_, _>>()?,
            clock: MonotonicClock(Instant::now()),
        })
    }

    /// Searches until there is a valid grasp: every built-in holdout leaves some.
    pub(crate) fn search(&self, cell: &Cell, seed: u64) -> Search {
        let settings = SearchSettings {
            query: query(cell.set),
            run: Run {
                seed,
                // On two threads the same attempt wins as on one.
                reproducible: true,
                workers: cell.threads,
                ..Run::default()
            },
            ..SearchSettings::default()
        };
        let (_, pool) = self
            .pools
            .iter()
            .find(|(threads, _)| *threads == cell.threads)
            .expect("a cell has one thread or the settings'");
        // From inside the pool, so that searches on one thread do not include waking it.
        pool.install(|| {
            let start = self.clock.now();
            let outcome = find_grasp(pool, self.task(cell), &settings, &self.clock, Stop::NEVER);
            Search {
                took: self.clock.now().saturating_sub(start),
                report: outcome.report,
            }
        })
    }

    pub(crate) fn scene(&self, cell: &Cell) -> Scene<'_> {
        let settings = SearchSettings {
            query: query(cell.set),
            ..SearchSettings::default()
        };
        Scene::new(self.task(cell), &settings)
    }

    fn task(&self, cell: &Cell) -> Task<'_> {
        Task {
            holdout: &self.holdouts[cell.holdout],
            object: cell.built_in().prepared_object(),
            rig: self.rig,
        }
    }
}

/// The query of a set's searches.
fn query(set: Set) -> Query {
    Query {
        strategy: set.strategy,
        validity: Validity::Thesis,
        bend_ratios: set.bend_ratios,
        ..Query::default()
    }
}
