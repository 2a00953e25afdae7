//! Reproduces the grasp sets of chapter 5 of the thesis.

use std::{
    error::Error,
    iter::successors,
    path::PathBuf,
    process::ExitCode,
    time::{Duration, Instant},
};

use clap::{Parser, builder::PossibleValuesParser};
use grasp_assets::holdouts::holdouts;
use grasp_experiment::{
    plan::{MAX_PER_CELL, SETS, Settings},
    run::{Progress, run},
};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

/// Shortest time between messages: thousands of grasps may be found per second.
const MESSAGE_INTERVAL: Duration = Duration::from_millis(50);

/// Reproduces the grasp sets of chapter 5 of the thesis, as CSV files from which tests/experiment/run makes a report.
///
/// For each set and built-in holdout, this examines the first failed attempts and searches for valid grasps, in this
/// process and with the server's core. `grasp find --receiving-hand right --validity thesis --holdout H --strategy S
/// --seed N --replay-attempt I` answers the same grasp; of a set S/R, with `--bend-ratios R`.
#[derive(Debug, Parser)]
#[command(name = "grasp-experiment")]
struct Arguments {
    /// Only this set; may be repeated. Default: all. A to F are the thesis'; GUIDED is a server's search for the same grasps.
    #[arg(long, value_parser = PossibleValuesParser::new(SETS.map(|set| set.name)), ignore_case = true)]
    set: Vec<String>,
    /// Only this holdout; may be repeated. Default: all.
    #[arg(long, value_parser = PossibleValuesParser::new(holdouts().iter().map(|holdout| holdout.name.as_str())))]
    holdout: Vec<String>,
    /// Valid grasps per set and holdout.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u64).range(1..=MAX_PER_CELL))]
    valid: u64,
    /// Failed attempts per set and holdout.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=MAX_PER_CELL))]
    invalid: u64,
    /// Seed of all random streams.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Also measure times with this many threads; 1 for one thread only.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: u16,
    /// The folder of the files; those of an earlier run are replaced.
    #[arg(long, value_name = "FOLDER", default_value = "target/experiment/run")]
    out: PathBuf,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let settings = Settings {
        seed: arguments.seed,
        valid: arguments.valid,
        invalid: arguments.invalid,
        sets: SETS
            .into_iter()
            .filter(|set| {
                let named = &arguments.set;
                named.is_empty() || named.iter().any(|name| name.eq_ignore_ascii_case(set.name))
            })
            .collect(),
        holdouts: (0..holdouts().len())
            .filter(|&index| {
                arguments.holdout.is_empty() || arguments.holdout.contains(&holdouts()[index].name)
            })
            .collect(),
        threads: arguments.threads.into(),
    };
    let options: Vec<_> = std::env::args().skip(1).collect();
    let command = format!("grasp-experiment {}", options.join(" "));
    let mut bar = RunBar::default();
    match run(&settings, command.trim(), &arguments.out, |now| bar.show(&now)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            drop(bar);
            let causes = successors(Some(&error as &dyn Error), |&error| error.source());
            let texts: Vec<_> = causes.map(ToString::to_string).collect();
            eprintln!("error: {}", texts.join(": "));
            ExitCode::FAILURE
        }
    }
}

/// A bar that counts valid grasps; hidden unless standard error is a terminal.
#[derive(Default)]
struct RunBar {
    bar: Option<ProgressBar>,
    last_message: Option<Instant>,
}

impl RunBar {
    fn show(&mut self, now: &Progress) {
        let bar = self.bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template(
                "{bar:32} {human_pos:>6}/{human_len} {elapsed:>4}, {eta} left: {msg}",
            );
            let bar = ProgressBar::new(now.total)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
                .with_finish(ProgressFinish::AndClear);
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        let last = self.last_message;
        if last.is_some_and(|last| last.elapsed() < MESSAGE_INTERVAL) && now.done < now.total {
            return;
        }
        self.last_message = Some(Instant::now());
        bar.set_position(now.done);
        let (set, holdout, threads) = (now.cell.set.name, &now.cell.built_in().name, now.cell.threads);
        bar.set_message(format!("set {set} on {holdout}, threads: {threads}"));
    }
}
