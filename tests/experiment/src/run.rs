//! Runs a plan into a folder.

use std::{
    fmt::{Display, Write as _},
    fs::{self, File},
    io::{self, BufWriter, Write as _},
    num::NonZeroUsize,
    path::{Path, PathBuf},
    time::Instant,
};

use grasp_synthesis::base::rejection::Rejection;
use serde_json::json;

use crate::{
    make::{MakeError, Maker, nanoseconds, type_of},
    plan::{Cell, Settings},
};

/// Why a run ended early. Its folder keeps the rows written before.
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
    let text = json!({
        "command": command,
        "machine": machine(),
        "clock_nanoseconds": clock_nanoseconds(),
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

/// A row that begins with the columns that reproduce an attempt.
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

/// The processor, system and build on which times were measured, as text.
fn machine() -> String {
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let processor = processor().unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let plural = if threads == 1 { "" } else { "s" };
    let mut text = format!("{processor}, {threads} thread{plural}, {}", std::env::consts::OS);
    let features = [
        ("avx2", cfg!(target_feature = "avx2")),
        ("fma", cfg!(target_feature = "fma")),
        ("avx512f", cfg!(target_feature = "avx512f")),
        ("neon", cfg!(target_feature = "neon")),
    ];
    let used: Vec<&str> = features
        .into_iter()
        .filter(|(_, is_used)| *is_used)
        .map(|(name, _)| name)
        .collect();
    if !used.is_empty() {
        let _ = write!(text, ", built for {}", used.join(" "));
    }
    if cfg!(debug_assertions) {
        text.push_str(", built without optimisation");
    }
    text
}

/// Linux names it in a file; elsewhere the architecture takes its place.
fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}

/// The time of one clock reading in nanoseconds, of which a step's time contains about one.
fn clock_nanoseconds() -> f64 {
    const READINGS: u32 = 100_000;
    let start = Instant::now();
    for _ in 0..READINGS {
        std::hint::black_box(Instant::now());
    }
    // One decimal: more would suggest false precision.
    (start.elapsed().as_nanos() as f64 / f64::from(READINGS) * 10.0).round() / 10.0
}

/// A row with the names of its columns.
#[derive(Debug, Default)]
pub(crate) struct Row(Vec<(String, String)>);

impl Row {
    pub(crate) fn add(&mut self, column: impl Into<String>, value: impl Display) {
        self.0.push((column.into(), value.to_string()));
    }

    /// Adds a value that may be missing, which leaves its place empty.
    pub(crate) fn add_known(&mut self, column: impl Into<String>, value: Option<impl Display>) {
        let text = value.map_or_else(String::new, |value| value.to_string());
        self.0.push((column.into(), text));
    }
}

/// A file whose rows have the columns of the first.
pub(crate) struct CsvFile {
    out: BufWriter<File>,
    columns: Vec<String>,
}

impl CsvFile {
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        Ok(Self {
            out: BufWriter::new(File::create(path)?),
            columns: Vec::new(),
        })
    }

    pub(crate) fn write(&mut self, row: Row) -> io::Result<()> {
        let (columns, values): (Vec<_>, Vec<_>) = row.0.into_iter().unzip();
        if self.columns.is_empty() {
            writeln!(self.out, "{}", columns.join(","))?;
            self.columns = columns;
        } else {
            debug_assert_eq!(self.columns, columns, "rows have other columns");
        }
        writeln!(self.out, "{}", values.join(","))
    }

    pub(crate) fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}
