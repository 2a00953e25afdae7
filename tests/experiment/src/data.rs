//! A run's records as figures and tables need them.

use grasp_synthesis::model::strategy::Strategy;

use crate::{
    plan::{Cell, Set, Settings},
    record::{Details, Record, SearchFigures, Source},
};

/// The requested records; a folder may have more.
#[derive(Clone, Debug)]
pub struct Data<'a> {
    /// The request.
    pub settings: &'a Settings,
    records: Vec<&'a Record>,
}

impl<'a> Data<'a> {
    /// Selects the requested records.
    pub fn new(settings: &'a Settings, records: &'a [Record]) -> Self {
        let cells = settings.cells();
        let is_requested = |record: &&Record| {
            let limit = if record.rejection.is_some() {
                settings.invalid_of(&record.cell)
            } else {
                settings.valid
            };
            record.number < limit && cells.contains(&record.cell)
        };
        let mut records: Vec<_> = records.iter().filter(is_requested).collect();
        let place = |record: &Record| cells.iter().position(|cell| *cell == record.cell);
        records.sort_by_key(|record| (place(record), record.rejection.is_some(), record.number));
        Self { settings, records }
    }

    /// All records by cell, valid ones first, then by number.
    pub fn records(&self) -> impl Iterator<Item = &'a Record> {
        self.records.iter().copied()
    }

    /// The requested sets.
    pub fn sets(&self) -> impl Iterator<Item = Set> + use<'a> {
        self.settings.sets.iter().copied()
    }

    /// The requested strategies of the thesis, A to F.
    pub fn ladder(&self) -> impl Iterator<Item = Strategy> + use<'a> {
        self.sets().filter(|set| set.is_ladder()).map(|set| set.strategy)
    }

    /// The largest requested number of threads, if it is more than one.
    pub fn more_threads(&self) -> Option<usize> {
        self.settings
            .threads
            .iter()
            .copied()
            .max()
            .filter(|threads| *threads > 1)
    }

    /// The positive grasp set, on one thread.
    pub fn valid(&self, set: Set) -> impl Iterator<Item = &'a Record> {
        self.of_set(set).filter(|record| record.is_valid())
    }

    /// The negative grasp set.
    pub fn invalid(&self, set: Set) -> impl Iterator<Item = &'a Record> {
        self.of_set(set).filter(|record| record.rejection.is_some())
    }

    /// Positive and negative grasp set together, with their details.
    pub fn both(&self, set: Set) -> impl Iterator<Item = (&'a Record, &'a Details)> {
        self.of_set(set)
            .filter_map(|record| Some((record, record.details.as_ref()?)))
    }

    fn of_set(&self, set: Set) -> impl Iterator<Item = &'a Record> {
        self.records()
            .filter(move |record| record.cell.set == set && record.cell.threads == 1)
    }

    /// Effort of a cell's searches. Empty if one of them gave up: the others would then underestimate the effort.
    pub fn searches(&self, cell: Cell) -> Vec<SearchFigures> {
        let own = || self.records().filter(|record| record.cell == cell);
        if own().any(|record| record.source == Source::Nowhere) {
            return Vec::new();
        }
        own().filter_map(|record| record.search).collect()
    }

    /// Holdouts where a search of a set gave up, on any number of threads.
    pub fn given_up(&self, set: Set) -> Vec<&'static str> {
        let gave_up = |record: &&Record| record.cell.set == set && record.source == Source::Nowhere;
        let mut names: Vec<_> = self
            .records()
            .filter(gave_up)
            .map(|record| record.cell.built_in().name.as_str())
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Effort of a set's searches by holdout; empty where one gave up.
    pub fn searches_by_holdout(&self, set: Set, threads: usize) -> Vec<Vec<SearchFigures>> {
        let of_holdout = |&holdout: &usize| {
            self.searches(Cell {
                set,
                threads,
                holdout,
            })
        };
        self.settings.holdouts.iter().map(of_holdout).collect()
    }
}

/// Attempts of searches.
pub fn attempts(searches: &[SearchFigures]) -> Vec<f64> {
    searches.iter().map(|search| search.attempts as f64).collect()
}

/// Times of searches in milliseconds.
pub fn milliseconds(searches: &[SearchFigures]) -> Vec<f64> {
    searches
        .iter()
        .map(|search| search.nanoseconds as f64 / 1e6)
        .collect()
}
