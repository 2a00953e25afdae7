//! Measures the service's promises under load: starts a server process, drives it from this one, and prints each promise with its target
//! and the figure. Exits with 1 if a promise is broken, with 77 if some could not be proven because other programs were busy.

mod bench;
mod cores;
mod load;
mod report;
mod requests;
mod scenarios;
mod server;

use std::{error::Error, fs, path::PathBuf, process::ExitCode};

use clap::{Parser, ValueEnum as _};

use crate::{
    bench::Bench,
    cores::TimeOfOthers,
    report::{Row, table},
    scenarios::Scenario,
};

/// Any error of a measurement.
pub(crate) type Failure = Box<dyn Error + Send + Sync>;

/// Measures the service's promises under load.
///
/// Every load stays on this machine and ends by itself. A promise that is broken is measured again; the best figure counts.
#[derive(Debug, Parser)]
#[command(name = "grasp-promises")]
struct Flags {
    /// The scenarios to run; all without any.
    scenarios: Vec<Scenario>,
    /// Run for as long as the promises say, instead of minutes in all.
    #[arg(long)]
    long: bool,
    /// How often a broken promise is measured.
    #[arg(long, default_value_t = 3, value_name = "N")]
    tries: usize,
    /// Also write the table as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// The server's program; by default grasp-server next to this one.
    #[arg(long, value_name = "FILE")]
    server: Option<PathBuf>,
}

fn main() -> ExitCode {
    match measure(Flags::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn measure(flags: Flags) -> Result<ExitCode, Failure> {
    let program = match flags.server {
        Some(program) => program,
        None => std::env::current_exe()?.with_file_name("grasp-server"),
    };
    let bench = Bench::new(program, flags.long)?;
    let scenarios = if flags.scenarios.is_empty() {
        Scenario::value_variants().to_vec()
    } else {
        flags.scenarios
    };
    let rows: Vec<Row> = scenarios
        .into_iter()
        .flat_map(|scenario| best_rows(&bench, scenario, flags.tries))
        .collect();
    println!("{}", table(&rows));
    if let Some(path) = flags.json {
        fs::write(path, serde_json::to_vec_pretty(&rows)?)?;
    }
    let missed: Vec<&Row> = rows.iter().filter(|row| !row.is_kept()).collect();
    Ok(if missed.is_empty() {
        ExitCode::SUCCESS
    } else if missed.iter().all(|row| row.is_disturbed()) {
        ExitCode::from(77)
    } else {
        ExitCode::from(1)
    })
}

/// The rows of a scenario, the best of each if some were missed.
fn best_rows(bench: &Bench, scenario: Scenario, tries: usize) -> Vec<Row> {
    let measure_once = || {
        let before = TimeOfOthers::now()?;
        let mut rows = bench.measure(scenario)?;
        let cores = TimeOfOthers::now()?.cores_since(before);
        for row in &mut rows {
            row.cores_of_others = cores;
        }
        Ok::<_, Failure>(rows)
    };
    let measure = || {
        measure_once().unwrap_or_else(|error| {
            vec![Row::failed(
                &format!("{scenario:?}").to_lowercase(),
                error.to_string(),
            )]
        })
    };
    let mut rows = measure();
    for _ in 1..tries {
        if rows.iter().all(Row::is_kept) {
            break;
        }
        let later = measure();
        rows = if rows.len() == later.len() {
            rows.into_iter()
                .zip(later)
                .map(|(row, later)| row.better(later))
                .collect()
        } else {
            // One of them failed as a whole.
            [rows, later].into_iter().max_by_key(Vec::len).unwrap_or_default()
        };
    }
    rows
}
