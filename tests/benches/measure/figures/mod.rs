//! Figures: the time to a grasp warm, cold, over the wire and after an object is registered, against targets.
//!
//! `cargo bench -p grasp-tests --bench measure -- figures`; `--only warm` measures one row, `--test` only checks that
//! everything runs, and `--json` writes JSON for scripts. Slow preparations are kept: atlases in `target/atlases`, givers in `target/figures`. Server and client share the process and two cores, as on a
//! developer's machine. The load average is printed, because other load shows in the outer quantiles. A missed target
//! is reported, but is not a failure.

mod best;
mod cold;
pub(crate) mod core;
mod echo;
mod ellipsoid;
mod everyday;
mod graspit;
mod hands;
mod registration;
mod requests;
mod setting;
mod sizes;
mod table;
mod warm;
mod wire;

use clap::{Args, ValueEnum};
use grasp_experiment::machine::Machine;
use serde::Serialize;

use setting::Setting;
use table::Line;

/// Holdouts per object in a quick run.
const QUICK_HOLDOUTS: usize = 4;

/// Givers per object in a quick run.
const QUICK_GIVERS: usize = 2;

/// Figures that are measured together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum Row {
    /// With complete atlases: the first valid grasp, in the server and in the core.
    Warm,
    /// Whole calls over gRPC, next to an echo of the same size.
    Wire,
    /// The best grasp within the default budget.
    Best,
    /// At other sizes than the objects' own.
    Sizes,
    /// Without an atlas.
    Cold,
    /// Everyday objects that nobody holds out, without an atlas.
    Everyday,
    /// From a mesh to a complete atlas.
    Registration,
    /// Comparison with `GraspIt!`.
    Graspit,
    /// Hands of the clients' own.
    Hands,
}

impl Row {
    fn name(self) -> &'static str {
        match self {
            Self::Warm => "warm",
            Self::Wire => "wire",
            Self::Best => "best",
            Self::Sizes => "sizes",
            Self::Cold => "cold",
            Self::Everyday => "everyday",
            Self::Registration => "registration",
            Self::Graspit => "graspit",
            Self::Hands => "hands",
        }
    }
}

/// Measures figures against their targets.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Measure only these rows.
    #[arg(long, value_enum, value_delimiter = ',', num_args = 1..)]
    only: Vec<Row>,
    /// Random holdouts per object; p99.9 needs at least a thousand.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    holdouts: u32,
    /// Recorded givers per object. More vary the holdouts more and take half a second each, the first time; one giver
    /// of 48 who leaves no room is 2 % of the holdouts.
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u32).range(1..))]
    givers: u32,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Only check that everything runs and is answered: a few requests each, with whatever atlases exist.
    #[arg(long)]
    test: bool,
}

/// All measurements.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    load_before: Option<String>,
    load_after: Option<String>,
    holdouts: usize,
    givers: usize,
    lines: Vec<Line>,
}

/// Measures and prints.
pub(crate) fn run(arguments: &Arguments) {
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
    let setting = Setting::new(arguments.test, holdouts, givers);
    let load_before = load_average();
    let report = Report {
        lines: measure(&setting, |row| {
            arguments.only.contains(&row) || arguments.only.is_empty()
        }),
        machine: Machine::this(),
        load_before,
        load_after: load_average(),
        holdouts,
        givers,
    };
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&report).expect("figures are plain data")
        );
        return;
    }
    let load = |load: &Option<String>| load.clone().unwrap_or_else(|| "unknown".to_owned());
    println!(
        "{}; load average {} before and {} after; {holdouts} random holdouts per object, from {givers} givers\n\n{}",
        report.machine,
        load(&report.load_before),
        load(&report.load_after),
        table::render(&report.lines)
    );
}

fn measure(setting: &Setting, is_selected: impl Fn(Row) -> bool) -> Vec<Line> {
    let test_objects = setting.built_in_test_objects();
    let mut lines = Vec::new();
    if [Row::Warm, Row::Wire, Row::Best, Row::Sizes]
        .into_iter()
        .any(&is_selected)
    {
        let server = setting.server_with_atlases(&test_objects.iter().collect::<Vec<_>>());
        if is_selected(Row::Warm) {
            lines.extend(warm::measure(setting, &server, &test_objects));
        }
        if is_selected(Row::Wire) {
            lines.extend(wire::measure(setting, &server, &test_objects));
        }
        if is_selected(Row::Best) {
            lines.extend(best::measure(setting, &server, &test_objects));
        }
        if is_selected(Row::Sizes) {
            lines.extend(sizes::measure(setting, &server));
        }
        setting.serving.block_on(server.stop());
    }
    if is_selected(Row::Cold) {
        lines.extend(cold::measure(setting, &test_objects));
    }
    if is_selected(Row::Everyday) {
        lines.extend(everyday::measure(setting));
    }
    if is_selected(Row::Registration) {
        lines.extend(registration::measure(setting, &test_objects));
    }
    if is_selected(Row::Graspit) {
        lines.extend(graspit::measure(setting));
    }
    if is_selected(Row::Hands) {
        lines.extend(hands::measure(setting));
    }
    lines
}

/// The machine's load average over the last minute, where the system provides it.
pub(crate) fn load_average() -> Option<String> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next().map(str::to_owned)
}
