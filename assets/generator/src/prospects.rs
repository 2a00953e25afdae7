//! Teaches the network by which GUIDED search prefers hands that are likely to hold.

mod examples;
mod shapes;
mod teacher;

use std::fmt::Write as _;

use grasp_assets::hands::hand;
use grasp_synthesis::{model::hand::Handedness, propose::success_prior::Network};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::AssetFile;
use examples::Example;

/// The file, below the assets' folder.
const PATH: &str = "../server/synthesis/src/guided/prospects/taught.rs";

/// Shapes that the network is taught on. More take longer, a fifth of a second each.
const SHAPES: u64 = 480;

/// Further shapes that it is examined on.
const EXAMINED: u64 = 48;

/// Share of an examined shape's hands, those rated best, whose holds are counted.
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
    let bar = ProgressBar::new(SHAPES + EXAMINED).with_style(style);
    bar.set_message("holding shapes");
    let mut by_shape: Vec<Vec<Example>> = (0..SHAPES + EXAMINED)
        .into_par_iter()
        .map(|number| {
            let found = examples::of_shape(number, rig);
            bar.inc(1);
            found
        })
        .collect();
    bar.finish();
    let examined = by_shape.split_off(SHAPES as usize);
    let network = teacher::teach(&by_shape);
    println!(
        "of {} shapes that were not taught, the {:.0} % rated best hold {:.2} times as often as all",
        examined.len(),
        100.0 * BEST_SHARE,
        lift(&network, &examined)
    );
    vec![(PATH.to_owned(), source(&network).into_bytes())]
}

/// How much more often the hands rated best hold than all do: the geometric mean over the shapes that can be held at all.
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
                .map(|example| (network.log_odds(&example.told), example))
                .collect();
            rated.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            let rated: Vec<&Example> = rated.into_iter().map(|(_, example)| example).collect();
            let best = &rated[..(rated.len() as f64 * BEST_SHARE) as usize];
            let all = share(&rated);
            // One in a thousand more of both: shapes of which none is found count, too.
            (all > 0.0).then(|| ((share(best) + 0.001) / (all + 0.001)).ln())
        })
        .collect();
    (lifts.iter().sum::<f64>() / lifts.len().max(1) as f64).exp()
}

/// The network as Rust.
fn source(network: &Network) -> String {
    let mut text = String::from(
        "//! The numbers that the network was taught: made by `grasp-assets-generator prospects`, not by hand.\n\n\
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
