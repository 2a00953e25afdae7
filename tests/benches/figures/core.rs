//! The core alone, on the same holdouts and atlases as the server: what its own share of the time is.

use std::{
    fs,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_assets::{atlas_folder::AtlasFolder, atlases::shipped_atlas};
use grasp_synthesis::{
    base::mechanisms::Mechanisms,
    known::{atlas::Atlas, codec::decode, seed_source::SeedSource, transferred_grips::TransferredGrips},
    model::{hand::Handedness, holdout::Holdout, object::GraspObject},
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        LookUp, find_grasp, find_known_grasp,
        scene::Task,
        settings::{Known, Run, SearchSettings},
    },
};
use grasp_tests::searches::{MonotonicClock, prepared};
use rayon::ThreadPool;

use crate::{asking::ANSWERED_WITHIN, setting::default_hand};

/// Workers of a search, as of a test's server.
pub(crate) const WORKERS: usize = 2;

/// How long the server looks for a known grip before it wakes its workers.
pub(crate) const LOOK_UP_TIME: Duration = Duration::from_micros(200);

/// What one search took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken {
    /// Was a grasp found?
    pub(crate) found: bool,
    /// From the clock on the wall, or of one thread alone.
    pub(crate) time: Duration,
}

/// Searches of the core.
pub(crate) struct Core {
    rig: &'static PreparedRig,
    pool: ThreadPool,
    mechanisms: Mechanisms,
}

impl Core {
    /// Searches with the default right hand by some mechanisms.
    pub(crate) fn new(mechanisms: Mechanisms) -> Self {
        Self {
            rig: &default_hand(Handedness::Right).rig,
            pool: rayon::ThreadPoolBuilder::new()
                .num_threads(WORKERS)
                .build()
                .expect("threads can be had"),
            mechanisms,
        }
    }

    /// The atlas that a server used: the one that it kept in a folder, or else the grips that ship with it. None if there is
    /// none for the object and the hand.
    pub(crate) fn atlas(&self, id: &str, folder: &AtlasFolder, object: &GraspObject) -> Option<Arc<Atlas>> {
        let decoded = |bytes: &[u8]| decode(bytes, object, self.rig).ok();
        let kept = fs::read(folder.file(object, self.rig)).ok();
        let kept = kept.and_then(|bytes| decoded(&bytes));
        let grown = kept.or_else(|| shipped_atlas(id, self.rig).and_then(decoded))?;
        Some(grown.atlas)
    }

    /// The wall time of a search as the server runs it: a look on the calling thread, then a race of the workers.
    pub(crate) fn search(&self, holdout: &Holdout, atlas: &Arc<Atlas>, seed: u64) -> Taken {
        let mut settings = settings(Knows::Atlas(atlas), self.mechanisms, seed);
        let object = prepared(&holdout.object);
        let task = self.task(holdout, &object);
        let clock = MonotonicClock::default();
        let start = Instant::now();
        let outcome = match find_known_grasp(task, &settings, &clock, LOOK_UP_TIME) {
            LookUp::Found(outcome) => *outcome,
            LookUp::NotFound { tried } => {
                settings.known.tried = tried;
                let stop = AtomicBool::new(false);
                find_grasp(&self.pool, task, &settings, &clock, &stop)
            }
        };
        Taken {
            time: start.elapsed(),
            found: outcome.grasp.is_some(),
        }
    }

    fn task<'a>(&self, holdout: &'a Holdout, object: &'a PreparedObject) -> Task<'a> {
        Task {
            holdout,
            object,
            rig: self.rig,
        }
    }

    /// The processor time of a look through the whole atlas up to the first valid grip, on the calling thread: what else
    /// runs on the machine shows less than in wall time.
    pub(crate) fn look_up(&self, holdout: &Holdout, atlas: &Arc<Atlas>) -> Taken {
        let settings = settings(Knows::Atlas(atlas), self.mechanisms, 0);
        let object = prepared(&holdout.object);
        let task = self.task(holdout, &object);
        let clock = MonotonicClock::default();
        let start = thread_time();
        let outcome = find_known_grasp(task, &settings, &clock, ANSWERED_WITHIN);
        Taken {
            time: thread_time().saturating_sub(start),
            found: outcome.found().is_some(),
        }
    }
}

/// What a server knows of how a hand holds an object.
#[derive(Clone, Copy)]
pub(crate) enum Knows<'a> {
    /// A complete atlas.
    Atlas(&'a Arc<Atlas>),
    /// No atlas yet, but grips of boxes like the object, if any fit.
    Boxes(Option<&'a Arc<TransferredGrips>>),
}

/// The settings that the server's defaults come to.
pub(crate) fn settings(knows: Knows<'_>, mechanisms: Mechanisms, seed: u64) -> SearchSettings {
    let (atlas, seeds) = match knows {
        Knows::Atlas(atlas) => (Some(Arc::clone(atlas)), SeedSource::Atlas(Arc::clone(atlas))),
        Knows::Boxes(Some(grips)) => (None, SeedSource::Transferred(Arc::clone(grips))),
        Knows::Boxes(None) => (None, SeedSource::Nothing),
    };
    SearchSettings {
        known: Known {
            atlas,
            seeds,
            ..Known::default()
        },
        run: Run {
            seed,
            deadline: Some(ANSWERED_WITHIN),
            workers: WORKERS,
            mechanisms,
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

/// Where the system tells no thread's time, wall time must do.
#[cfg(not(target_os = "linux"))]
pub(crate) fn thread_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}
