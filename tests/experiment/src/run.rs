//! Makes missing records.

use std::{
    collections::HashMap,
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use crate::{
    folder::{Folder, FolderError},
    make::Maker,
    plan::{Cell, Settings},
    record::{Record, Source},
};

/// Progress of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Valid grasps made, in this run or before, or given up.
    pub done: u64,
    /// All requested valid grasps.
    pub total: u64,
    /// The current cell.
    pub cell: Cell,
    /// Estimated remaining time, once there is a basis.
    pub left: Option<Duration>,
}

/// How a successful run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// The folder has everything requested.
    Complete,
    /// It was stopped; the folder has what was made.
    Stopped,
}

/// A folder's records of one cell.
#[derive(Clone, Copy, Debug, Default)]
struct Made {
    valid: u64,
    invalid: u64,
    next_invalid_attempt: u64,
    nanoseconds: u64,
    /// A search gave up; others would, too.
    gave_up: bool,
}

/// Makes the records that the folder lacks.
///
/// # Errors
/// The folder cannot be written, or another version of the algorithm made its records.
pub fn run(
    settings: &Settings,
    maker: &Maker,
    folder: &mut Folder,
    stop: &AtomicBool,
    mut progress: impl FnMut(Progress),
) -> Result<RunEnd, FolderError> {
    check_earlier_records(maker, folder)?;
    let cells = settings.cells();
    let mut made: HashMap<Cell, Made> = HashMap::new();
    for record in folder.records() {
        made.entry(record.cell).or_default().count(record);
    }
    for cell in &cells {
        while let Some(part) = missing(settings, cell, made.get(cell)) {
            progress(progress_at(settings, &cells, &made, *cell));
            if stop.load(Ordering::Relaxed) {
                return Ok(RunEnd::Stopped);
            }
            let records = match part {
                Part::Invalid {
                    numbers,
                    first_attempt,
                } => maker.invalid(settings, cell, numbers, first_attempt),
                Part::Valid { number } => match maker.valid(settings, cell, number, stop) {
                    Some(record) => vec![record],
                    None => return Ok(RunEnd::Stopped),
                },
            };
            let so_far = made.entry(*cell).or_default();
            for record in &records {
                so_far.count(record);
            }
            folder.add(records)?;
        }
    }
    Ok(RunEnd::Complete)
}

/// Records made in one step.
enum Part {
    /// Some failed attempts.
    Invalid { numbers: Range<u64>, first_attempt: u64 },
    /// A valid grasp.
    Valid { number: u64 },
}

/// The next missing part of a cell.
fn missing(settings: &Settings, cell: &Cell, made: Option<&Made>) -> Option<Part> {
    let made = made.copied().unwrap_or_default();
    let invalid = settings.invalid_of(cell);
    if made.invalid < invalid {
        Some(Part::Invalid {
            numbers: made.invalid..invalid,
            first_attempt: made.next_invalid_attempt,
        })
    } else {
        (made.valid_left(settings) > 0).then_some(Part::Valid { number: made.valid })
    }
}

impl Made {
    /// Records of a cell come in the order of their numbers.
    fn count(&mut self, record: &Record) {
        if record.rejection.is_some() {
            self.invalid += 1;
            self.next_invalid_attempt = record.source.attempt().map_or(0, |attempt| attempt + 1);
        } else if record.source == Source::Nowhere {
            self.gave_up = true;
        } else {
            self.valid += 1;
            self.nanoseconds += record.search.map_or(0, |search| search.nanoseconds);
        }
    }

    /// Valid grasps still to be made.
    fn valid_left(&self, settings: &Settings) -> u64 {
        if self.gave_up {
            0
        } else {
            settings.valid.saturating_sub(self.valid)
        }
    }

    /// Mean time of a valid grasp, in nanoseconds.
    fn mean(&self) -> Option<f64> {
        (self.valid > 0).then(|| self.nanoseconds as f64 / self.valid as f64)
    }
}

/// Reproduces the first and the last record of each cell, as the search may have changed since an earlier run.
fn check_earlier_records(maker: &Maker, folder: &Folder) -> Result<(), FolderError> {
    let mut ends: HashMap<(Cell, bool), [&Record; 2]> = HashMap::new();
    for record in folder.records() {
        let key = (record.cell, record.rejection.is_some());
        ends.entry(key).or_insert([record; 2])[1] = record;
    }
    let mut checked: Vec<_> = ends.into_values().flatten().collect();
    // Sorted, so that errors do not depend on the map's order.
    checked.sort_by_key(|record| (record.cell.holdout, record.seed, record.source));
    match checked.into_iter().find(|record| !maker.is_reproducible(record)) {
        None => Ok(()),
        Some(record) => Err(FolderError::Outdated {
            path: folder.path().to_owned(),
            holdout: record.cell.built_in().name.clone(),
            seed: record.seed,
            hand: record.source,
        }),
    }
}

fn progress_at(settings: &Settings, cells: &[Cell], made: &HashMap<Cell, Made>, cell: Cell) -> Progress {
    let done = |cell: &Cell| {
        made.get(cell)
            .map_or(0, |made| settings.valid - made.valid_left(settings))
    };
    Progress {
        done: cells.iter().map(done).sum(),
        total: settings.valid * cells.len() as u64,
        cell,
        left: time_left(settings, cells, made),
    }
}

/// A grasp is expected to take as long as its cell's grasps so far, or else as its holdout's in the latest cell with
/// some, or else the overall average.
fn time_left(settings: &Settings, cells: &[Cell], made: &HashMap<Cell, Made>) -> Option<Duration> {
    let means: Vec<_> = cells.iter().filter_map(|cell| made.get(cell)?.mean()).collect();
    if means.is_empty() {
        return None;
    }
    let overall = means.iter().sum::<f64>() / means.len() as f64;
    let mut of_holdout: HashMap<usize, f64> = HashMap::new();
    let mut left = 0.0;
    for cell in cells {
        let made = made.get(cell).copied().unwrap_or_default();
        if let Some(mean) = made.mean() {
            of_holdout.insert(cell.holdout, mean);
        }
        let mean = of_holdout.get(&cell.holdout).copied().unwrap_or(overall);
        left += mean * made.valid_left(settings) as f64;
    }
    Some(Duration::from_nanos(left as u64))
}
