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

use clap::{Args, ValueEnum};
use grasp_experiment::{
    atlases::Atlases,
    folder::{Folder, Manifest},
    make::Maker,
    plan::{MOST_PER_CELL, Set, Settings},
    run::{RunEnd, run as run_missing},
};
use grasp_synthesis::model::strategy::Strategy;

use crate::{EXIT_CODES, Ending, blocking, failure::Failure, holdout, output::Output};
use run_progress::RunProgress;

/// The long help.
const ABOUT: &str = r#"Make the grasp sets of the thesis' chapter 5 again, and report on them.

For each set and built-in holdout this searches for valid grasps and keeps the first failed attempts, in this process,
with the crate that the server searches with. Every grasp and attempt is kept in the output folder with its seed and
index; a run that was interrupted goes on where it was, and one that is asked for more makes only what is missing. Set
ATLAS needs the complete atlases of the objects: where they do not come with the objects, they are grown first, which
takes minutes for each, and kept in the folder. The report has the tables beside the thesis' own figures, every figure
as a picture and as CSV, what chapter 5 says against what this run shows, and a contact sheet of grasps in the order of
comfort.

With --json: {"folder", "report", "ladder": [{column: value, …}], "claims": [{"source", "thesis", "run", "verdict",
"why"}]}."#;

/// What a run can make.
#[derive(Clone, Copy, Debug, ValueEnum)]
#[value(rename_all = "UPPER")]
enum SetName {
    /// Naive synthesis.
    A,
    /// Placement measures relative to the object.
    B,
    /// Palm-CoM-palm angle.
    C,
    /// Early stop when the thumb has no contact.
    D,
    /// One way of choosing the bend ratios.
    E,
    /// First sufficient force distribution.
    F,
    /// Guided search for grasps that are valid as the thesis says.
    Guided,
    /// Guided search for physically valid grasps, without an atlas.
    Physical,
    /// The same with the object's complete atlas, as a server answers by default.
    Atlas,
}

impl From<SetName> for Set {
    fn from(name: SetName) -> Self {
        match name {
            SetName::A => Self::ladder(Strategy::A),
            SetName::B => Self::ladder(Strategy::B),
            SetName::C => Self::ladder(Strategy::C),
            SetName::D => Self::ladder(Strategy::D),
            SetName::E => Self::ladder(Strategy::E),
            SetName::F => Self::ladder(Strategy::F),
            SetName::Guided => Self::GUIDED,
            SetName::Physical => Self::PHYSICAL,
            SetName::Atlas => Self::ATLAS,
        }
    }
}

/// Make the grasp sets of the thesis' chapter 5 again, and report on them.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    /// Only this set; may be repeated. Default: all.
    #[arg(long, value_name = "SET", ignore_case = true)]
    set: Vec<SetName>,
    /// Only this holdout, such as remote-hold1; may be repeated. Default: all.
    #[arg(long, value_name = "NAME")]
    holdout: Vec<String>,
    /// Valid grasps for each set and holdout.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u64).range(1..=MOST_PER_CELL))]
    valid: u64,
    /// Failed attempts that are kept for each set and holdout.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=MOST_PER_CELL))]
    invalid: u64,
    /// Start of all randomness.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Search with this many threads too, for the times; 1 for one thread only.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: u16,
    /// Leave out the other ways to choose bend ratios (Figure 5.20).
    #[arg(long)]
    no_bend_ratio_columns: bool,
    /// The folder of the run.
    #[arg(long, value_name = "FOLDER", default_value = "target/experiment")]
    out: PathBuf,
    /// The folder of the report. Default: `report` in the folder of the run.
    #[arg(long, value_name = "FOLDER")]
    report: Option<PathBuf>,
    /// Forget what the folder has of an earlier run; atlases stay.
    #[arg(long)]
    fresh: bool,
}

/// Tells the run to stop when the command does, however it ends: what was made is then in the folder.
struct StopOnDrop(Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let settings = arguments.settings()?;
    let stop = Arc::new(AtomicBool::new(false));
    let _guard = StopOnDrop(Arc::clone(&stop));
    let report_folder = arguments.report.unwrap_or_else(|| arguments.out.join("report"));
    blocking(move || {
        let manifest = Manifest::new(settings.seed);
        let mut folder = Folder::open(&arguments.out, manifest, arguments.fresh)
            .map_err(|error| Failure::other("cannot use the folder of the run", error))?;
        let mut progress = RunProgress::default();
        let atlases = Atlases::complete(&settings, &folder, grasp_assets::atlases::atlas, &stop, |now| {
            progress.grow(&now);
        })
        .map_err(|error| Failure::other("the atlases cannot be made", error))?
        .ok_or(Failure::Interrupted)?;
        let maker = Maker::new(&settings, atlases).map_err(|error| Failure::other("cannot search", error))?;
        let end = run_missing(&settings, &maker, &mut folder, &stop, |now| progress.show(&now))
            .map_err(|error| Failure::other("the run cannot go on", error))?;
        if end == RunEnd::Stopped {
            return Err(Failure::Interrupted);
        }
        progress.report();
        let report = grasp_experiment::report::write(&settings, &folder, &maker, &report_folder)
            .map_err(|error| Failure::other("cannot write the report", error))?;
        progress.finish();
        summary::write(&folder, &report, output)?;
        Ok(Ending::Done)
    })
    .await
}

impl Arguments {
    fn settings(&self) -> Result<Settings, Failure> {
        let usual = Settings::default();
        let asked: Vec<Set> = self.set.iter().map(|name| (*name).into()).collect();
        let mut sets = usual.sets;
        sets.retain(|set| asked.is_empty() || asked.contains(set));
        let mut holdouts = Vec::new();
        for name in &self.holdout {
            let built_in = holdout::built_in(name)?;
            let all = grasp_assets::holdouts::holdouts();
            holdouts.extend(all.iter().position(|other| other.name == built_in.name));
        }
        holdouts.sort_unstable();
        holdouts.dedup();
        let mut threads = vec![1, usize::from(self.threads)];
        threads.dedup();
        Ok(Settings {
            seed: self.seed,
            valid: self.valid,
            invalid: self.invalid,
            sets,
            holdouts: if holdouts.is_empty() {
                usual.holdouts
            } else {
                holdouts
            },
            bend_ratio_columns: !self.no_bend_ratio_columns,
            threads,
        })
    }
}
