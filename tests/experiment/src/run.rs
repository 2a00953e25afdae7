//! Runs a plan into a folder.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use grasp_synthesis::base::rejection::Rejection;
use serde_json::json;

use crate::{
    csv::{CsvFile, Row},
    details::{nanoseconds, type_of},
    machine::Machine,
    make::{MakeError, Maker},
    plan::{Cell, Settings},
};

/// Why a run ended early. Its folder has what was made before.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file cannot be written.
    #[error("cannot write {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Something built in is broken.
    #[error("cannot search")]
    Make(#[from] MakeError),
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Valid grasps made.
    pub done: u64,
    /// Valid grasps to make.
    pub total: u64,
    /// The current cell.
    pub cell: Cell,
}

/// Writes a run's files into a folder, over those of an earlier run. The same settings give the same rows, except for
/// times:
///
/// - `searches.csv`: the effort of every search,
/// - `attempts.csv`: the failed attempts and the valid grasps on one thread, examined,
/// - `run.json`: the command and the machine.
///
/// # Errors
/// A file cannot be written, or something built in is broken.
pub fn run(
    settings: &Settings,
    command: &str,
    folder: &Path,
    mut progress: impl FnMut(Progress),
) -> Result<(), RunError> {
    let maker = Maker::new(settings)?;
    fs::create_dir_all(folder).map_err(cannot_write(folder))?;
    let about = folder.join("run.json");
    let machine = Machine::this();
    let text = json!({
        "command": command,
        "machine": machine.to_string(),
        "clock_nanoseconds": machine.clock_nanoseconds,
    });
    fs::write(&about, format!("{text:#}\n")).map_err(cannot_write(&about))?;
    let searches_path = folder.join("searches.csv");
    let attempts_path = folder.join("attempts.csv");
    let mut searches = CsvFile::create(&searches_path).map_err(cannot_write(&searches_path))?;
    let mut attempts = CsvFile::create(&attempts_path).map_err(cannot_write(&attempts_path))?;
    let cells = settings.cells();
    let mut now = Progress {
        done: 0,
        total: settings.valid * cells.len() as u64,
        cell: cells[0],
    };
    for cell in &cells {
        now.cell = *cell;
        progress(now);
        for row in failed_attempts(&maker, settings, cell) {
            attempts.write(row).map_err(cannot_write(&attempts_path))?;
        }
        for number in 0..settings.valid {
            let seed = settings.seed_of_valid(cell, number);
            let search = maker.search(cell, seed);
            let report = &search.report;
            let attempt = report.attempt().expect("a search without a limit finds a grasp");
            let mut row = origin(cell, number, seed, attempt);
            row.add("threads", cell.threads);
            row.add("attempts", report.attempts);
            row.add("pruned_placements", report.pruned_placements);
            row.add("nanoseconds", nanoseconds(search.took));
            for kind in Rejection::THESIS {
                row.add(type_of(kind), report.rejections[kind.index()]);
            }
            searches.write(row).map_err(cannot_write(&searches_path))?;
            if cell.threads == 1 {
                let examined = maker.examine(cell, seed, attempt);
                debug_assert!(examined.is_valid(), "{seed}/{attempt} is not valid again");
                let mut row = origin(cell, number, seed, attempt);
                examined.add_to(&mut row);
                attempts.write(row).map_err(cannot_write(&attempts_path))?;
            }
            now.done += 1;
            progress(now);
        }
    }
    searches.finish().map_err(cannot_write(&searches_path))?;
    attempts.finish().map_err(cannot_write(&attempts_path))
}

/// The first failed attempts of a cell's seed.
fn failed_attempts(maker: &Maker, settings: &Settings, cell: &Cell) -> Vec<Row> {
    let seed = settings.seed_of_invalid(cell);
    let failed = (0..).filter_map(|attempt| {
        let examined = maker.examine(cell, seed, attempt);
        (!examined.is_valid()).then_some((attempt, examined))
    });
    (0..settings.invalid_of(cell))
        .zip(failed)
        .map(|(number, (attempt, examined))| {
            let mut row = origin(cell, number, seed, attempt);
            examined.add_to(&mut row);
            row
        })
        .collect()
}

/// A row that begins with what reproduces an attempt.
fn origin(cell: &Cell, number: u64, seed: u64, attempt: u64) -> Row {
    let mut row = Row::default();
    row.add("set", cell.set.name);
    row.add("holdout", &cell.built_in().name);
    row.add("number", number);
    row.add("seed", seed);
    row.add("attempt", attempt);
    row
}

fn cannot_write(path: &Path) -> impl FnOnce(io::Error) -> RunError {
    let path = path.to_owned();
    move |source| RunError::Io { path, source }
}
