//! `grasp experiment`

mod run_progress;
mod summary;

use std::{
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use clap::Args;
use grasp_assets::atlas_folder::AtlasFolder;
use grasp_experiment::{
    atlases::Atlases,
    folder::{Folder, Manifest},
    make::Maker,
    plan::{MAX_PER_CELL, Set, Settings},
    run::{RunEnd, run as run_missing},
};
use grasp_synthesis::model::strategy::Strategy;

use crate::{
    EXIT_CODES, Failure, Output, blocking,
    input::built_in,
    values::{Choice, one_of},
};
use run_progress::RunProgress;

/// The long help.
const ABOUT: &str = r#"Reproduce the grasp sets of chapter 5 of the thesis, and report on them.

For each set and built-in holdout, this searches for valid grasps and records the first failed attempts, in this process
and with the server's search library. The output folder keeps every grasp and attempt with its seed and index: an
interrupted run resumes, and a run that asks for more adds only what is missing. Set ATLAS needs the complete atlases of
the objects: those missing in --atlases grow first, some twenty seconds each. The report has tables next to the thesis's
figures, every plot as SVG and CSV, the claims of chapter 5 against this run, and a contact sheet of grasps ordered by
comfort.

With --json: {"folder", "report", "ladder": [{column: value, …}], "claims": [{"source", "thesis", "run", "verdict",
"why"}]}."#;

/// The sets of grasps.
fn sets() -> [Choice<Set>; 9] {
    let ladder = Set::ladder;
    [
        ("A", ladder(Strategy::A), "Naive synthesis"),
        (
            "B",
            ladder(Strategy::B),
            "Placement measures relative to the object",
        ),
        ("C", ladder(Strategy::C), "Palm-CoM-palm angle"),
        ("D", ladder(Strategy::D), "Early stop if the thumb has no contact"),
        ("E", ladder(Strategy::E), "Fewer bend ratios per finger"),
        ("F", ladder(Strategy::F), "First sufficient force distribution"),
        ("GUIDED", Set::GUIDED, "Guided search with the thesis's checks"),
        (
            "PHYSICAL",
            Set::PHYSICAL,
            "Guided search with the physical checks, without an atlas",
        ),
        (
            "ATLAS",
            Set::ATLAS,
            "The same with the object's complete atlas: a server's default",
        ),
    ]
}

/// Reproduce the grasp sets of chapter 5 of the thesis, and report on them.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    /// Only this set; may be repeated. Default: all.
    #[arg(long, value_name = "SET", value_parser = one_of(sets()), ignore_case = true)]
    set: Vec<Set>,
    /// Only this holdout, such as remote-hold1; may be repeated. Default: all.
    #[arg(long, value_name = "NAME")]
    holdout: Vec<String>,
    /// Valid grasps per set and holdout.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u64).range(1..=MAX_PER_CELL))]
    valid: u64,
    /// Failed attempts recorded per set and holdout.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=MAX_PER_CELL))]
    invalid: u64,
    /// Seed of all random streams.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Also measure times with this many threads; 1 for one thread only.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: u16,
    /// Leave out the other choices of bend ratios (Figure 5.20).
    #[arg(long)]
    no_bend_ratio_columns: bool,
    /// The folder of the run.
    #[arg(long, value_name = "FOLDER", default_value = "target/experiment")]
    out: PathBuf,
    /// The folder that complete atlases are kept in; all runs can share it.
    #[arg(long, value_name = "FOLDER", default_value = "target/atlases")]
    atlases: PathBuf,
    /// The folder of the report. Default: `report` in the folder of the run.
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
    /// Discard an earlier run in the folder.
    #[arg(long)]
    fresh: bool,
}

/// Stops the run when the command ends for any reason; the results so far are in the folder.
struct StopOnDrop(Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let settings = arguments.settings()?;
    let stop = Arc::new(AtomicBool::new(false));
    let _guard = StopOnDrop(Arc::clone(&stop));
    let report_folder = arguments.report.unwrap_or_else(|| arguments.out.join("report"));
    blocking(move || {
        let manifest = Manifest::new(settings.seed);
        let mut folder = Folder::open(&arguments.out, manifest, arguments.fresh)
            .map_err(|error| Failure::other("cannot use the folder of the run", error))?;
        let mut progress = RunProgress::default();
        let atlas_folder = AtlasFolder::new(arguments.atlases);
        let atlases = Atlases::complete(&settings, &folder, &atlas_folder, &stop, |now| {
            progress.grow(&now);
        })
        .map_err(|error| Failure::other("cannot grow the atlases", error))?
        .ok_or(Failure::Interrupted)?;
        let maker = Maker::new(&settings, atlases).map_err(|error| Failure::other("cannot search", error))?;
        let end = run_missing(&settings, &maker, &mut folder, &stop, |now| progress.show(&now))
            .map_err(|error| Failure::other("the run failed", error))?;
        if end == RunEnd::Stopped {
            return Err(Failure::Interrupted);
        }
        progress.report();
        let report = grasp_experiment::report::write(&settings, &folder, &maker, &report_folder)
            .map_err(|error| Failure::other("cannot write the report", error))?;
        drop(progress);
        summary::write(&folder, &report, output)
    })
    .await
}

impl Arguments {
    fn settings(&self) -> Result<Settings, Failure> {
        let defaults = Settings::default();
        let mut sets = defaults.sets;
        sets.retain(|set| self.set.is_empty() || self.set.contains(set));
        let mut holdouts = Vec::new();
        for name in &self.holdout {
            let built_in = built_in(name)?;
            let all = grasp_assets::holdouts::holdouts();
            holdouts.extend(all.iter().position(|other| other.name == built_in.name));
        }
        holdouts.sort_unstable();
        holdouts.dedup();
        if holdouts.is_empty() {
            holdouts = defaults.holdouts;
        }
        let mut threads = vec![1, usize::from(self.threads)];
        threads.dedup();
        Ok(Settings {
            seed: self.seed,
            valid: self.valid,
            invalid: self.invalid,
            sets,
            holdouts,
            bend_ratio_columns: !self.no_bend_ratio_columns,
            threads,
        })
    }
}
