//! The core alone, on the same holdouts and atlases as the server: its share of the time.

use std::{
    fs,
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_assets::{atlas_folder::AtlasFolder, atlases::shipped_atlas};
use grasp_synthesis::{
    base::stop::Stop,
    known::{atlas::Atlas, codec::decode, seed_source::SeedSource},
    model::{hand::Handedness, holdout::Holdout, object::GraspObject, strategy::Choice},
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        LookUp, find_grasp, find_known_grasp,
        scene::Task,
        settings::{Known, Run, SearchSettings},
    },
};
use grasp_tests::searches::{MonotonicClock, prepared};
use rayon::ThreadPool;

use crate::figures::{requests::ANSWERED_WITHIN, setting::default_hand};

/// Workers per search, as on the test server.
pub(crate) const WORKERS: usize = 2;

/// Duration of the server's look-up before it wakes its workers.
pub(crate) const LOOK_UP_TIME: Duration = Duration::from_micros(200);

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
        Self {
            rig: &default_hand(Handedness::Right).rig,
            pool: rayon::ThreadPoolBuilder::new()
                .num_threads(WORKERS)
                .build()
                .expect("threads can be started"),
        }
    }

    /// The atlas a server uses: the shipped grips, else the one saved in a folder. `None` if there is none for this object and
    /// hand.
    pub(crate) fn atlas(&self, id: &str, folder: &AtlasFolder, object: &GraspObject) -> Option<Arc<Atlas>> {
        let decoded = |bytes: &[u8]| decode(bytes, object, self.rig).ok();
        let shipped = shipped_atlas(id, self.rig).and_then(decoded);
        let kept = || decoded(&fs::read(folder.file(object, self.rig)).ok()?);
        Some(shipped.or_else(kept)?.completed().atlas)
    }

    /// Wall time of a search as the server runs it: a look-up on the calling thread, then a race of the workers.
    pub(crate) fn search(&self, holdout: &Holdout, atlas: &Arc<Atlas>, seed: u64) -> Timing {
        let mut settings = settings(atlas, seed);
        let object = prepared(&holdout.object);
        let task = self.task(holdout, &object);
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

    /// How many valid grasps a search for the best one within a budget compares.
    pub(crate) fn compared(&self, holdout: &Holdout, atlas: &Arc<Atlas>, budget: Duration, seed: u64) -> u64 {
        let mut settings = settings(atlas, seed);
        settings.query.choice = Choice::BestWithinBudget;
        settings.run.deadline = Some(budget);
        let object = prepared(&holdout.object);
        let clock = MonotonicClock::default();
        let task = self.task(holdout, &object);
        find_grasp(&self.pool, task, &settings, &clock, Stop::NEVER)
            .report
            .candidates
    }

    fn task<'a>(&self, holdout: &'a Holdout, object: &'a PreparedObject) -> Task<'a> {
        Task {
            holdout,
            object,
            rig: self.rig,
        }
    }

    /// Processor time of a look-up through the whole atlas up to the first valid grip, on the calling thread: less
    /// sensitive to other load than wall time.
    pub(crate) fn look_up(&self, holdout: &Holdout, atlas: &Arc<Atlas>) -> Timing {
        let settings = settings(atlas, 0);
        let object = prepared(&holdout.object);
        let task = self.task(holdout, &object);
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
pub(crate) fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(time).expect("a thread's time is positive")
}

/// Wall time, on systems without a clock per thread.
#[cfg(not(target_os = "linux"))]
pub(crate) fn thread_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}

/// Processor time of all threads of this process.
#[cfg(target_os = "linux")]
pub(crate) fn process_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).expect("a process' time is positive")
}

/// Without such a clock, all threads count as busy.
#[cfg(not(target_os = "linux"))]
pub(crate) fn process_time() -> Duration {
    thread_time() * WORKERS as u32
}
