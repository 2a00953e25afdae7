//! A studio with hundreds of objects: how long until most calls are answered from atlases, how much memory that takes, and how
//! quick answers are meanwhile. The server has its defaults and saves what it holds in a folder.
//!
//! `cargo bench -p grasp-tests --bench measure -- studio` creates a thousand objects on a server in the process and asks for them by a
//! Zipf law, at a steady pace; `--objects 100 --seconds 60` does less, `--test` only checks that everything runs, and
//! `--json` writes JSON for scripts. Server, builder and client share the processors, as on a developer's machine.

mod calls;
mod objects;
mod table;

use std::{path::PathBuf, time::Duration};

use clap::Args;
use grasp_server::config::StorePlace;
use grasp_tests::{TestServer, progress::bar};
use serde::Serialize;

use calls::{Interval, ask};
use objects::Studio;

/// Share of the calls that are to be answered from atlases.
const ANSWERED_FROM_ATLASES: f64 = 0.9;

/// Givers per shape. Placing one takes a fifth of a second.
const GIVERS: u64 = 12;
const QUICK_GIVERS: u64 = 1;

/// Lines of the table.
const INTERVALS: u32 = 20;

/// Measures a studio.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Number of objects.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    objects: u32,
    /// How long to ask for them, in seconds.
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..))]
    seconds: u32,
    /// Calls per second.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rate: u32,
    /// Exponent of the Zipf law: the object at place n is asked for in proportion to 1/n to this power.
    #[arg(long, default_value_t = 1.0)]
    exponent: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Only check that everything runs and is answered: few objects, for few seconds.
    #[arg(long)]
    test: bool,
}

/// All measurements.
#[derive(Debug, Serialize)]
struct Report {
    objects: u32,
    calls_per_second: u32,
    exponent: f64,
    /// How long the objects took to create.
    creation_seconds: f64,
    /// Resident memory of the process before, and with all objects before the first call.
    megabytes_before: f64,
    megabytes_created: f64,
    /// When 90 % of the calls of an interval and of all later ones were answered from atlases.
    seconds_until_answered_from_atlases: Option<f64>,
    intervals: Vec<Interval>,
}

/// Asks a server for many objects.
pub(crate) fn run(mut arguments: Arguments) {
    if arguments.test {
        (arguments.objects, arguments.seconds) = (6, 4);
    }
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("threads can be started");
    let report = runtime.block_on(measure(&arguments));
    let asked: usize = report.intervals.iter().map(|interval| interval.calls).sum();
    let found: usize = report.intervals.iter().map(|interval| interval.found).sum();
    assert!(
        asked > 0 && found > 0,
        "{found} of {asked} calls were answered with a grasp"
    );
    if arguments.json {
        let json = serde_json::to_string_pretty(&report).expect("figures are plain data");
        println!("{json}");
    } else {
        println!("{}", table::render(&report));
    }
}

async fn measure(arguments: &Arguments) -> Report {
    let givers = if arguments.test { QUICK_GIVERS } else { GIVERS };
    let studio = Studio::new(arguments.objects as usize, arguments.exponent, givers);
    let folder = Folder::new();
    let server = TestServer::start_with(|config| {
        config.builder_threads = 1;
        config.place = StorePlace::Folder(folder.0.clone());
    })
    .await;
    let megabytes_before = resident_megabytes();
    let start = std::time::Instant::now();
    let mut client = server.objects().await;
    let bar = bar(studio.len(), "creating objects".to_owned());
    for place in 0..studio.len() {
        let created = client.create_object(studio.creation(place)).await;
        created.expect("the meshes are sound");
        bar.inc(1);
    }
    bar.finish_and_clear();
    let creation_seconds = start.elapsed().as_secs_f64();
    let megabytes_created = resident_megabytes();
    let length = Duration::from_secs(arguments.seconds.into()) / INTERVALS;
    let pace = Duration::from_secs(1) / arguments.rate;
    let intervals = ask(&server, &studio, pace, length, INTERVALS).await;
    server.stop().await;
    Report {
        objects: arguments.objects,
        calls_per_second: arguments.rate,
        exponent: arguments.exponent,
        creation_seconds,
        megabytes_before,
        megabytes_created,
        seconds_until_answered_from_atlases: until_answered(&intervals),
        intervals,
    }
}

/// The start of the first interval from which on enough calls are answered from atlases.
fn until_answered(intervals: &[Interval]) -> Option<f64> {
    let later = intervals.iter().rev();
    let answered = later.take_while(|interval| interval.share_from_atlases >= ANSWERED_FROM_ATLASES);
    answered.last().map(|interval| interval.from_seconds)
}

/// A new folder, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        Self(std::env::temp_dir().join(format!("grasp-studio-{}", std::process::id())))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder left in the temporary directory does no harm.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Resident memory of this process, client included; 0 where the system does not tell.
fn resident_megabytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kibibytes: Option<f64> = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
    kibibytes.unwrap_or(0.0) * 1024.0 / 1e6
}
