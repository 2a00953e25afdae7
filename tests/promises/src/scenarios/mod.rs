//! The scenarios, each in a file.

mod attacks;
mod cancel;
mod capacity;
mod fairness;
mod goodput;
mod health;
mod overshoot;
mod recovery;
mod refusals;
mod storm;

use clap::ValueEnum;

use crate::{Failure, bench::Bench, report::Row};

/// A group of promises that are measured together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Scenario {
    /// Answers in time at several times the load that the server can take, and admitted calls that are late.
    Goodput,
    /// How soon calls are refused, and the cost of a refusal.
    Refusals,
    /// How long after an overload calls are answered as before.
    Recovery,
    /// How long after its deadline a call is answered.
    Overshoot,
    /// For how long workers go on after their client has gone.
    Cancel,
    /// A light client beside one that takes all it can get.
    Fairness,
    /// Health checks of an overloaded server.
    Health,
    /// Another client beside floods of frames, and beside idle and slow connections.
    Attacks,
    /// Clients that try refused calls again at once.
    Storm,
    /// Processor time and memory, for planning.
    Capacity,
}

/// Measures the promises of a scenario.
pub(crate) async fn measure(bench: &Bench, scenario: Scenario) -> Result<Vec<Row>, Failure> {
    match scenario {
        Scenario::Goodput => goodput::measure(bench).await,
        Scenario::Refusals => refusals::measure(bench).await,
        Scenario::Recovery => recovery::measure(bench).await,
        Scenario::Overshoot => overshoot::measure(bench).await,
        Scenario::Cancel => cancel::measure(bench).await,
        Scenario::Fairness => fairness::measure(bench).await,
        Scenario::Health => health::measure(bench).await,
        Scenario::Attacks => attacks::measure(bench).await,
        Scenario::Storm => storm::measure(bench).await,
        Scenario::Capacity => capacity::measure(bench).await,
    }
}
