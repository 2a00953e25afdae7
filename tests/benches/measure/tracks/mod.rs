//! Tracks of moving givers: how soon frames are answered, how many tracks a server holds, and what becomes of grasps.
//!
//! `cargo bench -p grasp-tests --bench measure -- tracks` measures all rows, in some minutes; `--only latency` (or `opens`, `crowd`, `sway`,
//! `motions`) one of them, `--test` only checks that everything runs, and `--json` writes JSON for scripts. Server and clients share the
//! processors, as on a developer's machine.

mod crowd;
mod echo;
mod latency;
mod motions;
mod nearest;
mod objects;
mod opens;
mod play;
mod sway;

use clap::{Args, ValueEnum};
use serde::Serialize;

/// Frames per second of a headset.
const RATE: f64 = 90.0;

/// Measures tracks.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Only this row.
    #[arg(long)]
    only: Option<Row>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Only check that everything runs.
    #[arg(long)]
    test: bool,
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Row {
    /// Time from a frame to its answer, against an echo.
    Latency,
    /// What creating a track costs.
    Opens,
    /// Many tracks at a time.
    Crowd,
    /// Givers whose hands sway.
    Sway,
    /// Objects and givers that move.
    Motions,
}

/// All measurements.
#[derive(Debug, Default, Serialize)]
struct Report {
    latencies: Vec<latency::Latency>,
    opens: Option<opens::Opens>,
    crowds: Vec<crowd::Crowd>,
    sways: Vec<sway::Sway>,
    motions: Option<motions::Motions>,
}

/// The value below which a share of others are.
fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(f64::NAN)
}

/// Measures and prints.
pub(crate) fn run(arguments: &Arguments) {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("threads start");
    let wanted = |row| arguments.only.is_none_or(|only| only == row);
    let mut report = Report::default();
    runtime.block_on(async {
        if wanted(Row::Latency) {
            let frames = if arguments.test { 20 } else { 1800 };
            for only_changes in [false, true] {
                report
                    .latencies
                    .push(latency::measure(frames, only_changes).await);
            }
        }
        if wanted(Row::Opens) {
            report.opens = Some(opens::measure(if arguments.test { 2 } else { 200 }).await);
        }
        if wanted(Row::Crowd) {
            let (sizes, seconds): (&[usize], u64) = if arguments.test {
                (&[3], 1)
            } else {
                (&[50, 100, 200], 10)
            };
            for &size in sizes {
                report.crowds.push(crowd::measure(size, seconds).await);
            }
        }
        if wanted(Row::Sway) {
            report.sways = sway::measure(arguments.test).await;
        }
        if wanted(Row::Motions) {
            report.motions = Some(motions::measure(arguments.test).await);
        }
    });
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&report).expect("numbers make JSON")
        );
        return;
    }
    for latency in &report.latencies {
        println!("{latency}");
    }
    if let Some(opens) = &report.opens {
        println!("{opens}");
    }
    for crowd in &report.crowds {
        println!("{crowd}");
    }
    for sway in &report.sways {
        println!("{sway}");
    }
    if let Some(motions) = &report.motions {
        println!("{motions}");
    }
}
