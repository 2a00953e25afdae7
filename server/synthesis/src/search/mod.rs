//! The search for a valid grasp, step by step:
//!
//! 1. [`settings`] holds the query, the known grips and the options of a run; [`scene`], the data that all attempts share.
//! 2. [`current`] keeps, adjusts or replaces the grasp that the character already holds on to.
//! 3. `known_grips` tries preferred hands, the atlas and learned grips, natural ones (`preference`) first.
//! 4. `race` runs each [`attempt`] by index on several workers until one succeeds, time is up or the search is stopped.
//! 5. [`report`] sums up the search and keeps alternatives; [`limits`] explains why no grasp exists.
//! 6. [`key_frames`] plans the motion to the grasp.
//!
//! [`evaluation`] rates a holdout by its known grips; [`verdicts`] checks a hand that a client posed. Neither searches.

pub mod attempt;
pub mod current;
pub mod evaluation;
pub mod key_frames;
mod known_grips;
pub mod limits;
mod preference;
mod race;
mod reading;
pub mod report;
pub mod scene;
pub mod settings;
pub mod verdicts;

use std::time::Duration;

use known_grips::KnownGrips;
use race::Race;
use scene::{Scene, Task};
use settings::SearchSettings;

use crate::{
    base::{clock::Clock, stop::Stop, stopwatch::Stopwatch},
    model::{grasp::Grasp, strategy::Choice},
};

pub use race::REFINING_ATTEMPTS;
pub use report::{FoundGrasp, GraspObserver, GraspSource, NearestMiss, SearchReport};

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchEnd {
    /// A valid grasp was found.
    Found,
    /// The deadline passed first.
    DeadlinePassed,
    /// All attempts are used up.
    AttemptsExhausted,
    /// The search was stopped.
    Stopped,
    /// The search did not start: the current grasp is committed and not valid.
    Aborted,
}

/// The outcome of a search.
#[derive(Clone, Debug)]
pub struct SearchOutcome {
    /// How the search ended.
    pub end: SearchEnd,
    /// The grasp, if one was found.
    pub grasp: Option<Grasp>,
    /// Quality of the grasp; higher is better.
    pub value: f32,
    /// Until when a natural grasp replaces this one, if this one is not natural. May be after the search's last attempt or
    /// deadline.
    pub replaceable_until: Option<Replaceable>,
    /// Statistics of the search.
    pub report: SearchReport,
}

/// Until when a natural grasp may replace a valid one that is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replaceable {
    /// Up to this attempt, if the search is reproducible.
    UntilAttempt(u64),
    /// Until this time on the search's clock.
    UntilTime(Duration),
}

impl Replaceable {
    /// The earlier of two ends of the same search.
    #[must_use]
    pub fn earlier(self, other: Self) -> Self {
        match (self, other) {
            (Self::UntilAttempt(one), Self::UntilAttempt(other)) => Self::UntilAttempt(one.min(other)),
            (Self::UntilTime(one), Self::UntilTime(other)) => Self::UntilTime(one.min(other)),
            _ => self,
        }
    }
}

/// Looks for a valid known grip in `settings`, for up to `within` and on the calling thread only. Serves searches for the first
/// valid grasp that are not reproducible.
///
/// # Errors
/// The number of grips tried or excluded, if none was valid in time. With this in `settings.known.tried`, [`find_grasp`] continues.
pub fn find_known_grasp(
    task: Task<'_>,
    settings: &SearchSettings,
    clock: &dyn Clock,
    within: Duration,
) -> Result<SearchOutcome, usize> {
    if settings.query.choice != Choice::FirstValid || settings.run.reproducible {
        return Err(0);
    }
    let scene = Scene::new(task, settings);
    let known = KnownGrips::of(&scene, settings).ok_or(0_usize)?;
    let race = Race::new(&scene, settings, Some(&known), clock, Stop::NEVER);
    if race.try_known_until(Some(clock.now() + within)) {
        return Ok(race.outcome());
    }
    // The search tries a grip again that its attempts may replace.
    Err(known.tried() - usize::from(race.is_beside_region()))
}

/// Races `settings.run.workers` tasks of `pool` for a valid grasp. Returns when all of them have stopped. `scene` is prepared with
/// the same settings, apart from the range of attempts and the known grips.
///
/// Called from a thread of `pool`, that thread is one of the workers; called from elsewhere, it waits.
///
/// A worker checks `stop`, the clock and the others' results at least every 50 µs or so of its own work. With
/// `settings.run.reproducible`, the outcome is the same for any number of workers, apart from step times, unless the deadline or
/// `stop` cuts the search short. Then it has that grasp or none.
///
/// # Panics
/// If an attempt panics. The other workers stop first, and the pool stays usable.
pub fn find_grasp(
    pool: &rayon::ThreadPool,
    scene: &Scene<'_>,
    settings: &SearchSettings,
    clock: &dyn Clock,
    stop: Stop<'_>,
) -> SearchOutcome {
    debug_assert!(settings.run.workers >= 1, "there must be at least one worker");
    let known = KnownGrips::of(scene, settings);
    let race = Race::new(scene, settings, known.as_ref(), clock, stop);
    if race.tries_known_first() {
        return race.outcome();
    }
    let run = &|worker: usize| {
        let stopwatch = if settings.run.record_step_times {
            Stopwatch::new(clock)
        } else {
            Stopwatch::off()
        };
        race.run_worker(worker, stopwatch);
    };
    pool.in_place_scope(|scope| {
        let own = usize::from(pool.current_thread_index().is_some());
        for worker in own..settings.run.workers {
            scope.spawn(move |_| run(worker));
        }
        if own == 1 {
            run(0);
        }
    });
    race.outcome()
}
