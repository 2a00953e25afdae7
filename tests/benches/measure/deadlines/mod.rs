//! Calls with deadlines while other processes keep every core busy.
//!
//! `cargo bench -p grasp-tests --bench measure -- deadlines`; `--test` only checks that everything runs, and `--json` writes
//! JSON for scripts. Server, burners and client are processes of their own, as on a developer's machine. The last row is
//! measured after the burners have ended: by then, searches should have nearly the whole deadline again. A missed target
//! is reported, but is not a failure.

mod calls;
mod processes;
mod table;

use std::{num::NonZeroUsize, thread, time::Duration};

use calls::{Client, Load};
use clap::{Args, ValueEnum};
use grasp_experiment::machine::Machine;
use processes::Helper;
use serde::Serialize;
use table::Row;

/// Calls per cell in a quick run.
const QUICK_CALLS: usize = 4;

/// Time without load before the last row: the reserve should recover meanwhile.
const RECOVERY: Duration = Duration::from_mins(1);

/// What a process of this program does.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Role {
    /// Serves with the binary's defaults.
    Serve,
    /// Keeps a core busy.
    Burn,
}

/// Measures calls with deadlines under load.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Calls per deadline and number in flight; half of them exhaust their budget.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(2..))]
    calls: u32,
    /// Deadlines in milliseconds.
    #[arg(long, value_name = "MS", value_delimiter = ',', num_args = 1.., default_values_t = [50, 200])]
    deadlines: Vec<u64>,
    /// Numbers of calls in flight.
    #[arg(long, value_name = "N", value_delimiter = ',', num_args = 1.., default_values_t = [1, 4, 8])]
    in_flight: Vec<usize>,
    /// Processes that compute all the time; by default, one per core.
    #[arg(long, value_name = "N")]
    burners: Option<usize>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Only check that everything runs and is answered.
    #[arg(long)]
    test: bool,
    /// Role of a helper process.
    #[arg(long, hide = true)]
    role: Option<Role>,
}

/// All measurements.
#[derive(Serialize)]
struct Report {
    machine: Machine,
    burners: usize,
    load_before: Option<String>,
    load_after: Option<String>,
    rows: Vec<Row>,
}

/// Measures how late answers are, or plays the role of a helper process.
pub(crate) fn run(arguments: &Arguments) {
    match arguments.role {
        Some(Role::Serve) => processes::serve(),
        Some(Role::Burn) => processes::burn(),
        None => {
            let report = measure(arguments);
            if arguments.json {
                println!(
                    "{}",
                    serde_json::to_string_pretty(&report).expect("measurements are plain data")
                );
            } else {
                println!("{}", table::render(&report));
            }
        }
    }
}

fn measure(arguments: &Arguments) -> Report {
    let cores = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let burners = arguments.burners.unwrap_or(cores);
    let calls = if arguments.test {
        QUICK_CALLS
    } else {
        arguments.calls as usize
    };
    let mut server = Helper::start(Role::Serve);
    let client = Client::new(&server.first_line());
    let load_before = load_average();
    let mut rows = Vec::new();

    let busy: Vec<Helper> = (0..burners).map(|_| Helper::start(Role::Burn)).collect();
    for &deadline in &arguments.deadlines {
        for &in_flight in &arguments.in_flight {
            let load = Load {
                deadline: Duration::from_millis(deadline),
                in_flight,
                calls,
            };
            rows.extend(table::rows("busy", &load, &client.send(&load)));
        }
    }
    let load_after = load_average();
    drop(busy);

    if let Some(&deadline) = arguments.deadlines.first() {
        if !arguments.test {
            thread::sleep(RECOVERY);
        }
        let load = Load {
            deadline: Duration::from_millis(deadline),
            in_flight: 1,
            calls,
        };
        rows.extend(table::rows("idle again", &load, &client.send(&load)));
    }
    Report {
        machine: Machine::this(),
        burners,
        load_before,
        load_after,
        rows,
    }
}

/// The load averages of the last 1, 5 and 15 minutes, where the system provides them.
fn load_average() -> Option<String> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    Some(text.split_whitespace().take(3).collect::<Vec<_>>().join(" "))
}
