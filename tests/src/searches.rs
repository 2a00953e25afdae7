//! Searches without a server.

use std::{
    sync::{Arc, Mutex, PoisonError, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_synthesis::{
    base::clock::Clock,
    known::seed_source::SeedSource,
    model::{holdout::Holdout, object::GraspObject},
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        SearchOutcome, find_grasp,
        scene::Task,
        settings::{Known, Run, SearchSettings},
    },
};

/// The machine's monotonic clock.
pub struct MonotonicClock(Instant);

impl Default for MonotonicClock {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl Clock for MonotonicClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// A reproducible default search by one worker, without known grips, whose attempts are seeded by `seeds`.
pub fn search_from(
    seeds: SeedSource,
    holdout: &Holdout,
    rig: &PreparedRig,
    seed: u64,
    max_attempts: u64,
) -> SearchOutcome {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("threads can be started");
    let settings = SearchSettings {
        known: Known {
            seeds,
            ..Known::default()
        },
        run: Run {
            seed,
            reproducible: true,
            max_attempts,
            ..Run::default()
        },
        ..SearchSettings::default()
    };
    let clock = MonotonicClock::default();
    let task = Task {
        holdout,
        object: &prepared(&holdout.object),
        rig,
    };
    find_grasp(&pool, task, &settings, &clock, &AtomicBool::new(false))
}

/// An object with what proposals derive from it, derived once for all that ask.
pub fn prepared(object: &Arc<GraspObject>) -> Arc<PreparedObject> {
    static PREPARED: Mutex<Vec<Arc<PreparedObject>>> = Mutex::new(Vec::new());
    let mut all = PREPARED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = all.iter().find(|known| Arc::ptr_eq(known.object(), object)) {
        return Arc::clone(known);
    }
    let new = Arc::new(PreparedObject::new(Arc::clone(object)));
    all.push(Arc::clone(&new));
    new
}
