//! Trains the success prior: the network by which GUIDED search prefers hands that are likely to hold.

mod examples;
pub(crate) mod shapes;
mod trainer;

use std::fmt::Write as _;

use grasp_assets::hands::hand;
use grasp_synthesis::{model::hand::Handedness, propose::success_prior::Network};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::AssetFile;
use examples::Example;

/// The file, below the assets' folder.
const PATH: &str = "../server/synthesis/src/guided/prospects/taught.rs";

/// Shapes in the training set. More take longer, a fifth of a second each.
const TRAINING: u64 = 480;

/// Shapes in the validation set.
const VALIDATION: u64 = 48;

/// Share of a validation shape's hands, those rated best, whose success rate is measured.
const BEST_SHARE: f64 = 0.1;

/// Numbers on a line.
const NUMBERS_PER_LINE: usize = 8;

/// Makes the file: a minute or two on two cores.
pub(crate) fn generate() -> Vec<AssetFile> {
    let rig = &hand("adult", Handedness::Right).expect("the rig is built in").rig;
    // Otherwise, every thread would make them.
    rig.oppositions();
    let style = ProgressStyle::with_template("{msg:24} {bar:40} {pos}/{len}, {elapsed}")
        .expect("the template is right");
    let bar = ProgressBar::new(TRAINING + VALIDATION).with_style(style);
    bar.set_message("holding shapes");
    let mut by_shape: Vec<Vec<Example>> = (0..TRAINING + VALIDATION)
        .into_par_iter()
        .map(|number| {
            let found = examples::of_shape(number, rig);
            bar.inc(1);
            found
        })
        .collect();
    bar.finish();
    let validation = by_shape.split_off(TRAINING as usize);
    let network = trainer::train(&by_shape);
    println!(
        "of {} validation shapes, the {:.0} % of hands rated best hold {:.2} times as often as all",
        validation.len(),
        100.0 * BEST_SHARE,
        lift(&network, &validation)
    );
    vec![(PATH.to_owned(), source(&network).into_bytes())]
}

/// How much more often the hands rated best hold than all hands do: the geometric mean over shapes that can be held.
fn lift(network: &Network, by_shape: &[Vec<Example>]) -> f64 {
    let share = |examples: &[&Example]| {
        let held = examples.iter().filter(|example| example.holds).count();
        held as f64 / examples.len().max(1) as f64
    };
    let lifts: Vec<f64> = by_shape
        .iter()
        .filter_map(|examples| {
            let mut rated: Vec<(f32, &Example)> = examples
                .iter()
                .map(|example| (network.log_odds(&example.features), example))
                .collect();
            rated.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            let rated: Vec<&Example> = rated.into_iter().map(|(_, example)| example).collect();
            let best = &rated[..(rated.len() as f64 * BEST_SHARE) as usize];
            let all = share(&rated);
            // A thousandth added to both keeps shapes in whose best share no hand holds.
            (all > 0.0).then(|| ((share(best) + 0.001) / (all + 0.001)).ln())
        })
        .collect();
    (lifts.iter().sum::<f64>() / lifts.len().max(1) as f64).exp()
}

/// The network as Rust.
fn source(network: &Network) -> String {
    let mut text = String::from(
        "//! The numbers that the network was taught: made by `grasp-assets-generator success-prior`, not by hand.\n\n\
         #![allow(clippy::unreadable_literal, clippy::excessive_precision)]\n\n\
         use super::Network;\n\n\
         /// Taught on hands of the rig `adult` and shapes that were drawn at random.\n\
         #[rustfmt::skip]\n\
         pub const TRAINED: Network = Network {\n",
    );
    let mut field = |name: &str, numbers: &[f32]| {
        let _ = writeln!(text, "    {name}: [\n{}    ],", lines(numbers));
    };
    field("means", &network.means);
    field("scales", &network.scales);
    field("biases", &network.biases);
    field("outputs", &network.outputs);
    text.push_str("    weights: [\n");
    for weights in &network.weights {
        let _ = writeln!(text, "        [\n{}        ],", lines(weights));
    }
    let _ = writeln!(text, "    ],\n    output_bias: {:.5},\n}};", network.output_bias);
    text
}

fn lines(numbers: &[f32]) -> String {
    numbers
        .chunks(NUMBERS_PER_LINE)
        .fold(String::new(), |mut text, line| {
            let line: Vec<String> = line.iter().map(|number| format!("{number:.5}")).collect();
            let _ = writeln!(text, "            {},", line.join(", "));
            text
        })
}
