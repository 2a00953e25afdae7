//! The core alone, on the same holdouts and atlases as the server: its share of the time.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_assets::{atlases::shipped_atlas, hands::hand};
use grasp_synthesis::{
    base::stop::Stop,
    known::{atlas::Atlas, codec::decode, seeds::SeedSource},
    model::{hand::Handedness, holdout::Holdout, object::GraspObject},
    propose::prepared::PreparedRig,
    search::{
        LookUp, find_grasp, find_known_grasp,
        scene::Task,
        settings::{Known, Run, SearchSettings},
    },
};
use grasp_tests::searches::{MonotonicClock, prepared};
use rayon::ThreadPool;

use crate::calls::ANSWERED_WITHIN;

/// Workers per search, as on the test server.
const WORKERS: usize = 2;

/// Duration of the server's look-up before it wakes its workers.
const LOOK_UP_TIME: Duration = Duration::from_micros(200);

/// The timing of one search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    /// Whether a grasp was found.
    pub(crate) found: bool,
    /// Wall time, or processor time of one thread.
    pub(crate) time: Duration,
}

/// Runs searches of the core.
pub(crate) struct CoreSearcher {
    rig: &'static PreparedRig,
    pool: ThreadPool,
}

impl CoreSearcher {
    /// Searches with the default right hand.
    pub(crate) fn new() -> Self {
        let hand = hand("adult", Handedness::Right).expect("the adult rig is built in");
        Self {
            rig: &hand.rig,
            pool: rayon::ThreadPoolBuilder::new()
                .num_threads(WORKERS)
                .build()
                .expect("threads can be started"),
        }
    }

    /// The atlas that a server uses for a built-in object.
    pub(crate) fn atlas(&self, id: &str, object: &GraspObject) -> Arc<Atlas> {
        let shipped = shipped_atlas(id, self.rig).expect("built-in objects have atlases");
        let decoded = decode(shipped, object, self.rig).expect("it is of this hand");
        decoded.completed().atlas
    }

    /// Wall time of a search as the server runs it: a look-up on the calling thread, then a race of the workers.
    pub(crate) fn search(&self, holdout: &Holdout, atlas: &Arc<Atlas>, seed: u64) -> Timing {
        let mut settings = settings(atlas, seed);
        let object = prepared(&holdout.object);
        let task = Task {
            holdout,
            object: &object,
            rig: self.rig,
        };
        let clock = MonotonicClock::default();
        let start = Instant::now();
        let outcome = match find_known_grasp(task, &settings, &clock, LOOK_UP_TIME) {
            LookUp::Found(outcome) => *outcome,
            LookUp::NotFound { tried } => {
                settings.known.tried = tried;
                find_grasp(&self.pool, task, &settings, &clock, Stop::NEVER)
            }
        };
        Timing {
            time: start.elapsed(),
            found: outcome.grasp.is_some(),
        }
    }

    /// Processor time of a look-up through the whole atlas up to the first valid grip, on the calling thread: less
    /// sensitive to other load than wall time.
    pub(crate) fn look_up(&self, holdout: &Holdout, atlas: &Arc<Atlas>) -> Timing {
        let settings = settings(atlas, 0);
        let object = prepared(&holdout.object);
        let task = Task {
            holdout,
            object: &object,
            rig: self.rig,
        };
        let clock = MonotonicClock::default();
        let start = thread_time();
        let outcome = find_known_grasp(task, &settings, &clock, ANSWERED_WITHIN);
        Timing {
            time: thread_time().saturating_sub(start),
            found: outcome.found().is_some(),
        }
    }
}

/// The settings that the server's defaults amount to.
fn settings(atlas: &Arc<Atlas>, seed: u64) -> SearchSettings {
    SearchSettings {
        known: Known {
            atlas: Some(Arc::clone(atlas)),
            seeds: SeedSource::Atlas(Arc::clone(atlas)),
            ..Known::default()
        },
        run: Run {
            seed,
            deadline: Some(ANSWERED_WITHIN),
            workers: WORKERS,
            ..Run::default()
        },
        ..SearchSettings::default()
    }
}

/// Processor time of this thread.
#[cfg(target_os = "linux")]
fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(time).expect("a thread's time is positive")
}

/// Processor time of all threads of this process.
#[cfg(target_os = "linux")]
pub(crate) fn process_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).expect("a process' time is positive")
}

/// Wall time, on systems without a clock per thread.
#[cfg(not(target_os = "linux"))]
fn thread_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}

/// Without such a clock, all threads count as busy.
#[cfg(not(target_os = "linux"))]
pub(crate) fn process_time() -> Duration {
    thread_time() * WORKERS as u32
}
