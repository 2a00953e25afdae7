//! The table of the figures that are to be reached: how soon a grasp is there, warm, cold, over the wire, and after an
//! object was registered.
//!
//! `cargo bench -p grasp-tests --bench figures`, of which `-- --only warm` measures one row, `-- --test` only tries
//! whether all runs, and `-- --json` writes for scripts. `-- --without NAME` switches mechanisms of the search off;
//! `-- --only ablation` measures each one, and writes `tests/results/ablation`. What takes long the first time is kept:
//! atlases in `target/atlases`, givers in `target/figures`. Server and client share the process and two cores, as on a
//! developer's machine; the load average is
//! told, for whatever else runs there shows in the outer quantiles. That a target is not met is told and is no failure.

mod ablation;
mod asking;
mod best;
mod cold;
mod core;
mod echo;
mod ellipsoid;
mod graspit;
mod registration;
mod setting;
mod table;
mod warm;
mod wire;

use std::time::Duration;

use clap::{Parser, ValueEnum};
use grasp_experiment::machine::Machine;
use grasp_synthesis::base::mechanisms::{Mechanism, Mechanisms};
use serde::Serialize;

use setting::Setting;
use table::Line;

/// Holdouts an object in a quick run.
const QUICK_HOLDOUTS: usize = 4;

/// Givers that are placed on an object in a quick run.
const QUICK_GIVERS: usize = 2;

/// What is measured together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum Row {
    /// With complete atlases: the first valid grasp, in the server and in the core.
    Warm,
    /// The same over gRPC, beside an echo.
    Wire,
    /// The best grasp within the default budget.
    Best,
    /// Without an atlas.
    Cold,
    /// From a mesh to a complete atlas.
    Registration,
    /// Beside `GraspIt!`.
    Graspit,
    /// All mechanisms against each one switched off; only where it is named.
    Ablation,
}

impl Row {
    fn name(self) -> &'static str {
        match self {
            Self::Warm => "warm",
            Self::Wire => "wire",
            Self::Best => "best",
            Self::Cold => "cold",
            Self::Registration => "registration",
            Self::Graspit => "graspit",
            Self::Ablation => "ablation",
        }
    }
}

/// Measures the figures that are to be reached.
#[derive(Debug, Parser)]
struct Arguments {
    /// Measure only these rows.
    #[arg(long, value_enum, value_delimiter = ',', num_args = 1..)]
    only: Vec<Row>,
    /// Random holdouts of each object; from a thousand on, p99.9 is told.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    holdouts: u32,
    /// Recorded givers that hold each object out. More vary the holdouts more and take half a second each, the first time;
    /// one giver of 48 who leaves no room is 2 % of the holdouts.
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u32).range(1..))]
    givers: u32,
    /// Switch these mechanisms off in every row but the ablation, which switches off each in turn.
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1..)]
    without: Vec<Mechanism>,
    /// End the ablation after this many minutes, with what was measured by then.
    #[arg(long)]
    minutes: Option<u32>,
    /// Write JSON.
    #[arg(long)]
    json: bool,
    /// Only try whether everything runs and answers come: a few requests each, atlases as far as they are.
    #[arg(long)]
    test: bool,
    /// Given by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Everything that was measured.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    load_before: Option<String>,
    load_after: Option<String>,
    holdouts: usize,
    givers: usize,
    without: Vec<&'static str>,
    lines: Vec<Line>,
}

fn main() {
    let arguments = Arguments::parse();
    let holdouts = if arguments.test {
        QUICK_HOLDOUTS
    } else {
        arguments.holdouts as usize
    };
    let givers = if arguments.test {
        QUICK_GIVERS
    } else {
        arguments.givers as usize
    };
    let without = &arguments.without;
    let mechanisms = without
        .iter()
        .fold(Mechanisms::ALL, |rest, &mechanism| rest.without(mechanism));
    let setting = Setting::new(arguments.test, holdouts, givers, mechanisms);
    let load_before = load_average();
    let report = Report {
        lines: measure(&setting, arguments.minutes, |row| {
            let is_usual = row != Row::Ablation || arguments.test;
            arguments.only.contains(&row) || arguments.only.is_empty() && is_usual
        }),
        machine: Machine::this(),
        load_before,
        load_after: load_average(),
        holdouts,
        givers,
        without: without.iter().map(|mechanism| mechanism.name()).collect(),
    };
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&report).expect("figures are plain data")
        );
        return;
    }
    let load = |load: &Option<String>| load.clone().unwrap_or_else(|| "unknown".to_owned());
    if !report.without.is_empty() {
        println!("without {}", report.without.join(", "));
    }
    println!(
        "{}; load average {} before and {} after; {holdouts} random holdouts an object, of {givers} givers\n\n{}",
        report.machine,
        load(&report.load_before),
        load(&report.load_after),
        table::told(&report.lines)
    );
}

fn measure(setting: &Setting, minutes: Option<u32>, is_wanted: impl Fn(Row) -> bool) -> Vec<Line> {
    let things = setting.built_in_things();
    let mut lines = Vec::new();
    if [Row::Warm, Row::Wire, Row::Best].into_iter().any(&is_wanted) {
        let server = setting.server_with_atlases(&things.iter().collect::<Vec<_>>());
        if is_wanted(Row::Warm) {
            lines.extend(warm::measure(setting, &server, &things));
        }
        if is_wanted(Row::Wire) {
            lines.extend(wire::measure(setting, &server, &things));
        }
        if is_wanted(Row::Best) {
            lines.extend(best::measure(setting, &server, &things));
        }
        setting.serving.block_on(server.stop());
    }
    if is_wanted(Row::Cold) {
        lines.extend(cold::measure(setting, &things));
    }
    if is_wanted(Row::Registration) {
        lines.extend(registration::measure(setting, &things));
    }
    if is_wanted(Row::Graspit) {
        lines.extend(graspit::measure(setting));
    }
    if is_wanted(Row::Ablation) {
        let longest = minutes.map(|minutes| Duration::from_secs(60 * u64::from(minutes)));
        lines.extend(ablation::measure(setting, &things, longest));
    }
    lines
}

/// The machine's load average over the last minute, where the system tells.
pub(crate) fn load_average() -> Option<String> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next().map(str::to_owned)
}
