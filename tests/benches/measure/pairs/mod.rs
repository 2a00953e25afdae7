//! Pairs of valid grasps, one plausible and one not: how many of them the score's weights rank right, and which weights
//! would do better.
//!
//! `cargo bench -p grasp-tests --bench measure -- pairs` prints a table and writes `target/pairs/index.html`, with a picture of every
//! grasp, and `target/pairs/pairs.png`. `--fit` suggests weights, `--json` writes JSON for scripts, and `--test`
//! only checks that everything runs. [`grasp_tests::pairs`] says what makes a grasp plausible.

mod page;
mod picture;
mod table;
mod weights;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    thread,
};

use clap::Args;
use grasp_tests::{
    pairs::{
        catalogue::{LabelledObject, few_labelled_objects, labelled_objects},
        gathering::{Offer, gather},
        pairing::{Gathered, Pair, pairs},
    },
    progress::bar,
    random_holdouts::{GivingHand, giving_hands},
};
use rayon::prelude::*;
use serde::Serialize;

use table::Line;
use weights::Suggestion;

/// Grasps of each holdout in a quick run.
const QUICK_GRASPS: usize = 6;

/// Pairs drawn on the page of a quick run.
const QUICK_DRAWN: usize = 2;

/// Checks the score's weights by pairs of grasps.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Only these objects.
    #[arg(long, value_name = "NAME", value_delimiter = ',', num_args = 1..)]
    objects: Vec<String>,
    /// Grasps gathered of each holdout.
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..))]
    grasps: u32,
    /// Givers of each object, besides nobody.
    #[arg(long, default_value_t = 2)]
    givers: u32,
    /// Seed of givers, searches and pairs.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Pairs on the page: those ranked wrong, then others.
    #[arg(long, default_value_t = 200)]
    drawn: usize,
    /// Suggest weights.
    #[arg(long)]
    fit: bool,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Only check that everything runs, on a few objects and grasps.
    #[arg(long)]
    test: bool,
}

/// Everything that is printed.
#[derive(Serialize)]
struct Report {
    objects: usize,
    holdouts: usize,
    grasps: usize,
    lines: Vec<Line>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fit: Option<Suggestion>,
}

/// Measures and prints.
pub(crate) fn run(arguments: &Arguments) {
    let mut objects = if arguments.test {
        few_labelled_objects()
    } else {
        labelled_objects()
    };
    if !arguments.objects.is_empty() {
        objects.retain(|object| arguments.objects.iter().any(|name| name == object.name));
    }
    let all = gathered(objects, arguments);
    let pairs = pairs(&all, arguments.seed);
    let report = Report {
        objects: all.iter().map(|gathered| gathered.object + 1).max().unwrap_or(0),
        holdouts: all.len(),
        grasps: all.iter().map(|gathered| gathered.candidates.len()).sum(),
        lines: table::lines(&pairs),
        fit: (arguments.fit || arguments.test).then(|| weights::suggest(&pairs)),
    };
    // A quick run leaves the page of a full one alone.
    let folder = folder(if arguments.test { "pairs-test" } else { "pairs" });
    let drawn = if arguments.test {
        QUICK_DRAWN
    } else {
        arguments.drawn
    };
    draw(&folder, &pairs, drawn);
    if arguments.json {
        println!(
            "{}",
            serde_json::to_string_pretty(&report).expect("a report is plain data")
        );
        return;
    }
    println!(
        "{} objects, {} holdouts, {} grasps\n\n{}",
        report.objects,
        report.holdouts,
        report.grasps,
        table::render(&report.lines)
    );
    if let Some(fit) = &report.fit {
        println!("\n{}", weights::render(fit));
    }
    println!("\n{}", folder.join("index.html").display());
}

/// The grasps of all offers of these objects.
fn gathered(objects: Vec<LabelledObject>, arguments: &Arguments) -> Vec<Gathered> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("threads can be started");
    let givers = if arguments.test { 1 } else { arguments.givers };
    let grasps = if arguments.test {
        QUICK_GRASPS
    } else {
        arguments.grasps as usize
    };
    let hands = giving_hands();
    let bar = bar(objects.len(), "objects");
    let objects: Vec<(usize, Arc<LabelledObject>)> = objects.into_iter().map(Arc::new).enumerate().collect();
    pool.install(|| {
        objects
            .par_iter()
            .flat_map_iter(|(object_number, object)| {
                let gathered = offers(object, &hands, givers as usize, arguments.seed)
                    .into_iter()
                    .enumerate()
                    .map(|(number, offer)| Gathered {
                        object: *object_number,
                        number,
                        candidates: gather(&offer, grasps, arguments.seed),
                        offer,
                    })
                    .collect::<Vec<_>>();
                bar.inc(1);
                gathered
            })
            .collect()
    })
}

/// An object held by nobody and by some givers: those of its built-in holdouts, if it has any.
fn offers(object: &Arc<LabelledObject>, hands: &[GivingHand], givers: usize, seed: u64) -> Vec<Offer> {
    let mut offers = vec![Offer::free(object)];
    offers.extend(Offer::built_in(object).into_iter().take(givers));
    let others = givers + 1 - offers.len();
    offers.extend((0..others as u64).map(|giver| Offer::held(object, hands, seed + giver)));
    offers
}

/// Writes the page and the sheet.
fn draw(folder: &Path, pairs: &[Pair<'_>], most: usize) {
    let chosen = page::chosen(pairs, most);
    let bar = bar(2 * chosen.len(), "pictures");
    page::write(folder, pairs, &chosen, || bar.inc(1)).expect("cargo's target folder can be written");
}

/// A folder in cargo's target folder.
fn folder(name: &str) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent();
    target.expect("cargo's temporary folder has a parent").join(name)
}
