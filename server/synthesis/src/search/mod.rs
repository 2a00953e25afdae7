//! The race: workers pull attempt indices until a valid grasp is found, the deadline passes or they are told to stop.

use std::{sync::atomic::AtomicBool, time::Duration};

use crate::{
    clock::Clock,
    grasp::Grasp,
    hand::{HandPose, rig::Rig},
    holdout::Holdout,
    rejection::Rejection,
    strategy::{BendRatioChoice, Strategy},
};

/// How to search.
#[derive(Clone, Debug)]
pub struct SearchSettings {
    /// Start of every attempt's random stream.
    pub seed: u64,
    /// The step of the ladder.
    pub strategy: Strategy,
    /// Which bend ratios a digit tries.
    pub bend_ratios: BendRatioChoice,
    /// Coefficient of static friction.
    pub friction: f32,
    /// Answer with the valid attempt of the lowest index instead of the first to finish.
    pub reproducible: bool,
    /// The attempt indices to run: from here …
    pub first_attempt: u64,
    /// … this many at most.
    pub max_attempts: u64,
    /// When to give up, by the clock that is handed in.
    pub deadline: Option<Duration>,
    /// How many workers race; at least 1.
    pub workers: usize,
    /// Record the time spent in each step?
    pub record_step_times: bool,
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchEnd {
    /// A valid grasp was found.
    Found,
    /// The deadline passed first.
    DeadlinePassed,
    /// The attempts were used up.
    AttemptsExhausted,
    /// The stop flag was set.
    Stopped,
}

/// The time spent in each step of Algorithm 1, summed over workers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepTimes {
    /// Step 1.
    pub wrist_placement: Duration,
    /// Step 2.
    pub finger_posing: Duration,
    /// Step 3.
    pub collision_validation: Duration,
    /// Step 4.
    pub contact_validation: Duration,
    /// Step 5.
    pub immobility_validation: Duration,
}

/// The failed attempt that came closest to a grasp.
#[derive(Clone, Debug, PartialEq)]
pub struct NearestMiss {
    /// Why it failed.
    pub rejection: Rejection,
    /// Its index.
    pub attempt: u64,
    /// For `NotImmobilizing`: the smallest wrench angle, in radians.
    pub wrench_angle: Option<f32>,
    /// The hand in the object's frame.
    pub pose: HandPose,
}

/// What a search did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchReport {
    /// Attempts that were run to their end: accepted placements, as the thesis counts.
    pub attempts: u64,
    /// Placements that the measures pruned.
    pub pruned_placements: u64,
    /// Rejections by kind, in the order of [`Rejection::ALL`].
    pub rejections: [u64; 8],
    /// Times by step, if they were asked for.
    pub step_times: Option<StepTimes>,
    /// The index of the attempt that gave the grasp.
    pub attempt: Option<u64>,
    /// The attempt that came closest, if none was valid.
    pub nearest_miss: Option<NearestMiss>,
}

/// The end of a search.
#[derive(Clone, Debug)]
pub struct SearchOutcome {
    /// How it ended.
    pub end: SearchEnd,
    /// The grasp, if one was found.
    pub grasp: Option<Grasp>,
    /// What the search did.
    pub report: SearchReport,
}

/// Races `settings.workers` tasks of `pool` for a valid grasp. Returns when all of them have stopped.
pub fn find_grasp(
    pool: &rayon::ThreadPool,
    holdout: &Holdout,
    rig: &Rig,
    settings: &SearchSettings,
    clock: &dyn Clock,
    stop: &AtomicBool,
) -> SearchOutcome {
    let _ = (pool, holdout, rig, settings, clock, stop);
    SearchOutcome {
        end: SearchEnd::Stopped,
        grasp: None,
        report: SearchReport::default(),
    }
}
