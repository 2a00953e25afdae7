//! Measures the service: `cargo bench -p grasp-tests --bench measure -- warm cold`, or everything if nothing is named.
//!
//! Server and client share the process and two cores, as on a developer's machine. The load average is printed, because other load
//! shows in the outer quantiles. A missed target is reported, but is not a failure. `cargo test --bench measure` only checks that
//! everything runs.

mod cold;
mod echo;
mod setting;
mod studio;
mod table;
mod tracks;
mod warm;

use clap::{Parser, ValueEnum};

use setting::Setting;
use table::Line;

/// Holdouts per object, givers per object, objects and seconds of the studio in a brief run.
const BRIEF: [u32; 4] = [4, 2, 6, 4];

/// Measurements that run together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Row {
    /// With complete atlases: the first valid grasp.
    Warm,
    /// Whole calls over gRPC, next to an echo of the same size.
    Wire,
    /// Without an atlas.
    Cold,
    /// Everyday objects that nobody holds out, without an atlas.
    Everyday,
    /// Time from a frame of a track to its answer, next to an echo.
    Latency,
    /// Cost of creating a track.
    Opens,
    /// Many tracks at a time.
    Crowd,
    /// Hundreds of objects: answers from atlases, and memory.
    Studio,
}

/// Measures the service.
#[derive(Debug, Parser)]
struct Arguments {
    /// Only these.
    #[arg(value_enum)]
    rows: Vec<Row>,
    /// Random holdouts per object; p99.9 needs at least a thousand.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    holdouts: u32,
    /// Recorded givers per object. More vary the holdouts more and take half a second each; one giver of 48 who leaves no room is
    /// 2 % of the holdouts.
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u32).range(1..))]
    givers: u32,
    /// Objects of the studio.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    objects: u32,
    /// How long to request them, in seconds.
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..))]
    seconds: u32,
    /// Calls for them per second.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rate: u32,
    /// Only check that everything runs.
    #[arg(long)]
    test: bool,
    /// Passed by `cargo bench`.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let mut arguments = Arguments::parse();
    let is_brief = arguments.test || !arguments.bench;
    if is_brief {
        [
            arguments.holdouts,
            arguments.givers,
            arguments.objects,
            arguments.seconds,
        ] = BRIEF;
    }
    let setting = Setting::new(is_brief, arguments.holdouts as usize, arguments.givers.into());
    let load_before = load_average();
    let rows = if arguments.rows.is_empty() {
        Row::value_variants()
    } else {
        &arguments.rows[..]
    };
    let lines: Vec<Line> = rows
        .iter()
        .flat_map(|&row| measure(&setting, row, &arguments))
        .collect();
    println!(
        "load average {load_before} before and {} after; {} random holdouts per object, from {} givers\n\n{}",
        load_average(),
        arguments.holdouts,
        arguments.givers,
        table::render(&lines)
    );
}

fn measure(setting: &Setting, row: Row, arguments: &Arguments) -> Vec<Line> {
    match row {
        Row::Warm => warm::measure(setting),
        Row::Wire => warm::measure_wire(setting),
        Row::Cold => cold::measure(setting),
        Row::Everyday => cold::measure_everyday(setting),
        Row::Latency => tracks::measure_latency(setting),
        Row::Opens => vec![tracks::measure_opens(setting)],
        Row::Crowd => tracks::measure_crowds(setting),
        Row::Studio => studio::measure(setting, arguments.objects, arguments.seconds, arguments.rate),
    }
}

/// The machine's load average over the last minute, where the system tells.
fn load_average() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().next().unwrap_or("unknown").to_owned()
}
