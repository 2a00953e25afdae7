//! Measurements of the service, each with options of its own: `cargo bench -p grasp-tests --bench measure -- figures --help`.
//!
//! Without a measurement, as in `cargo test --benches`, every one runs briefly, which only checks that everything runs.

mod deadlines;
mod figures;
mod pairs;
mod studio;
mod tracks;

use clap::{Parser, Subcommand};

/// Measures the service.
#[derive(Debug, Parser)]
struct Arguments {
    #[command(subcommand)]
    measurement: Option<Measurement>,
    /// Passed by cargo.
    #[arg(long, hide = true, global = true)]
    bench: bool,
}

#[derive(Debug, Subcommand)]
enum Measurement {
    Deadlines(deadlines::Arguments),
    Figures(figures::Arguments),
    Pairs(pairs::Arguments),
    Studio(studio::Arguments),
    Tracks(tracks::Arguments),
}

impl Measurement {
    fn run(self) {
        match self {
            Self::Deadlines(arguments) => deadlines::run(&arguments),
            Self::Figures(arguments) => figures::run(&arguments),
            Self::Pairs(arguments) => pairs::run(&arguments),
            Self::Studio(arguments) => studio::run(arguments),
            Self::Tracks(arguments) => tracks::run(&arguments),
        }
    }
}

fn main() {
    if let Some(measurement) = Arguments::parse().measurement {
        return measurement.run();
    }
    for name in ["deadlines", "figures", "pairs", "studio", "tracks"] {
        println!("\n{name}, briefly");
        let arguments = Arguments::parse_from(["measure", name, "--test"]);
        arguments.measurement.expect("it is named").run();
    }
}
