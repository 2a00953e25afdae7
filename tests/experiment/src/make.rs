//! Makes records: runs searches, and examines single attempts.

mod details;

pub(crate) use details::COMFORT_REPEATS;

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use grasp_assets::{
    hands::{Hand, hand},
    holdouts::{BuiltInHoldout, HoldoutError, holdouts},
};
use grasp_synthesis::{
    base::{
        clock::Clock,
        random::AttemptStream,
        rejection::{Failure, Rejection},
        stop::Stop,
        stopwatch::Stopwatch,
    },
    known::{recheck::GripChecker, seed_source::SeedSource},
    model::{grasp::Grasp, hand::Handedness, holdout::Holdout, strategy::Validity},
    physical::grip::Gripper,
    propose::prepared::PreparedRig,
    search::{
        SearchEnd,
        attempt::Attempt,
        find_grasp,
        scene::{Scene, Task},
        settings::{Known, Query, Run, SearchSettings},
    },
};

use self::details::Closer;
use crate::{
    atlases::Atlases,
    plan::{Cell, PHYSICAL_RIG, Set, Settings, THESIS_RIG},
    record::{AtlasFigures, Record, SearchFigures, Source},
};

/// The receiving hand of a set: the right hand of its rig.
pub fn receiving_hand(set: Set) -> Option<&'static Hand> {
    hand(set.rig_name(), Handedness::Right).map(|hand| &**hand)
}

/// The machine's monotonic clock.
pub(crate) struct MonotonicClock(Instant);

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// Why no records can be made.
#[derive(Debug, thiserror::Error)]
pub enum MakeError {
    /// A built-in holdout is broken.
    #[error("the built-in holdout {0} is broken")]
    Holdout(&'static str, #[source] HoldoutError),
    /// A built-in rig is missing.
    #[error("the rig {0:?} is not built in")]
    Rig(&'static str),
    /// The atlas of a set is missing.
    #[error("there is no atlas of {0}")]
    Atlas(&'static str),
    /// The system provides no threads.
    #[error("cannot start {0} threads")]
    Threads(usize, #[source] rayon::ThreadPoolBuildError),
}

/// Prepared holdouts, and threads to search them with.
pub struct Maker {
    holdouts: Vec<Holdout>,
    thesis_rig: &'static PreparedRig,
    physical_rig: &'static PreparedRig,
    atlases: Atlases,
    pools: Vec<(usize, rayon::ThreadPool)>,
    clock: MonotonicClock,
}

impl Maker {
    /// Prepares everything that the settings need.
    ///
    /// # Errors
    /// A built-in holdout or hand is broken, a set's atlas is missing, or no threads can be started.
    pub fn new(settings: &Settings, atlases: Atlases) -> Result<Self, MakeError> {
        let mut cells = settings.cells().into_iter().filter(|cell| cell.set.atlas);
        if let Some(cell) = cells.find(|cell| atlases.of(cell).is_none()) {
            return Err(MakeError::Atlas(&cell.built_in().object));
        }
        let rig = |name| {
            let hand = hand(name, Handedness::Right).ok_or(MakeError::Rig(name))?;
            Ok(&hand.rig)
        };
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
            thesis_rig: rig(THESIS_RIG)?,
            physical_rig: rig(PHYSICAL_RIG)?,
            atlases,
            pools: threads.into_iter().map(pool).collect::<Result<_, _>>()?,
            clock: MonotonicClock(Instant::now()),
        })
    }

    /// Searches for valid grasp number `number` of a cell; the record may report that the search gave up. None if
    /// stopped.
    pub fn valid(&self, settings: &Settings, cell: &Cell, number: u64, stop: &AtomicBool) -> Option<Record> {
        let stop = || stop.load(Ordering::Relaxed);
        let seed = settings.seed_of_valid(cell, number);
        let search = SearchSettings {
            query: query(cell.set),
            known: Known {
                atlas: self.atlases.of(cell).cloned(),
                seeds: self
                    .atlases
                    .of(cell)
                    .cloned()
                    .map_or(SeedSource::Nothing, SeedSource::Atlas),
                ..Known::default()
            },
            run: Run {
                seed,
                max_attempts: cell.set.most_attempts(),
                workers: cell.threads,
                ..Run::default()
            },
        };
        let (_, pool) = self.pools.iter().find(|(threads, _)| *threads == cell.threads)?;
        // From inside the pool, so that searches on one thread do not include waking it.
        let (outcome, took) = pool.install(|| {
            let start = self.clock.now();
            let outcome = find_grasp(pool, self.task(cell), &search, &self.clock, Stop::when(&stop));
            (outcome, self.clock.now().saturating_sub(start))
        });
        let report = outcome.report;
        let source = match outcome.end {
            SearchEnd::Found => Source::of(report.source?)?,
            SearchEnd::AttemptsExhausted => Source::Nowhere,
            SearchEnd::DeadlinePassed | SearchEnd::Stopped | SearchEnd::Aborted => return None,
        };
        let is_examined = cell.threads == 1 && source != Source::Nowhere;
        let closer = is_examined.then(|| self.examine(cell, seed, source)).flatten();
        let is_valid = |closer: &Closer| closer.end.is_ok();
        debug_assert!(
            !is_examined || closer.as_ref().is_some_and(is_valid),
            "{source} is not valid again"
        );
        Some(Record {
            cell: *cell,
            number,
            seed,
            source,
            rejection: None,
            search: Some(SearchFigures {
                attempts: report.attempts,
                pruned_placements: report.pruned_placements,
                rejections: Rejection::THESIS.map(|kind| report.rejections[kind.index()]),
                nanoseconds: nanoseconds(took),
                atlas: cell.set.atlas.then_some(AtlasFigures {
                    entries: self
                        .atlases
                        .of(cell)
                        .map_or(0, |atlas| atlas.entries().len() as u64),
                    candidates: report.candidates,
                }),
            }),
            details: closer.map(|closer| closer.details),
        })
    }

    /// The invalid attempts of a cell with these numbers: the first failures of their seed from `first_attempt` on.
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
            let closer = self.look_at_attempt(cell, seed, attempt);
            if let Err(Failure::Rejected { rejection, .. }) = closer.end {
                records.push(Record {
                    cell: *cell,
                    number,
                    seed,
                    source: Source::Attempt(attempt),
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

    /// Repeats a record's attempt or grip. True if it ends as recorded, with the same wrist and digits. A search that
    /// gave up is not repeated, as it would take as long again, and counts as true.
    pub fn is_reproducible(&self, record: &Record) -> bool {
        if record.source == Source::Nowhere {
            return true;
        }
        let Some(closer) = self.examine(&record.cell, record.seed, record.source) else {
            return false;
        };
        let rejection = match closer.end {
            Ok(_) => None,
            Err(Failure::Rejected { rejection, .. }) => Some(rejection),
            Err(Failure::Stopped) => return false,
        };
        rejection == record.rejection
            && record.details.as_ref().is_none_or(|details| {
                details.measures == closer.details.measures && details.digits == closer.details.digits
            })
    }

    /// Reproduces the valid grasp of a record.
    pub fn grasp_of(&self, record: &Record) -> Option<Box<Grasp>> {
        let index = match record.source {
            Source::Attempt(index) => index,
            Source::AtlasEntry(entry) => return self.grip(&record.cell, entry),
            Source::Nowhere => return None,
        };
        let scene = self.scene(&record.cell);
        let mut stream = AttemptStream::new(record.seed, index);
        let end = Attempt::default().run(&scene, &mut stream, &mut Stopwatch::off(), Stop::NEVER);
        end.ok()
    }

    /// A grip of the atlas on the cell's holdout; none if it does not hold, or does not exist.
    fn grip(&self, cell: &Cell, entry: u16) -> Option<Box<Grasp>> {
        let scene = self.scene(cell);
        let (object, presented) = scene.physical()?;
        let entry = self.atlases.of(cell)?.entries().get(usize::from(entry))?;
        let solids = entry.tracked_solids(scene.rig());
        let checker = GripChecker::new(object, scene.rig(), presented);
        let grasp = checker.check(entry, &solids, &mut Gripper::default())?;
        Some(Box::new(grasp))
    }

    fn rig(&self, set: Set) -> &'static PreparedRig {
        match set.validity {
            Validity::Thesis => self.thesis_rig,
            Validity::Physical => self.physical_rig,
        }
    }

    fn task(&self, cell: &Cell) -> Task<'_> {
        Task {
            holdout: &self.holdouts[cell.holdout],
            object: cell.built_in().prepared_object(),
            rig: self.rig(cell.set),
        }
    }

    fn scene(&self, cell: &Cell) -> Scene<'_> {
        let settings = SearchSettings {
            query: query(cell.set),
            ..SearchSettings::default()
        };
        Scene::new(self.task(cell), &settings)
    }
}

/// What a set asks of a search.
fn query(set: Set) -> Query {
    Query {
        strategy: set.strategy,
        validity: set.validity,
        bend_ratios: set.bend_ratios,
        ..Query::default()
    }
}

/// A duration as recorded, saturating at 584 years.
fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
