//! The core alone, on the same holdouts and atlases as the server: what its own share of the time is.

use std::{
    fs,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use grasp_assets::atlases::atlas;
use grasp_synthesis::{
    base::mechanisms::Mechanisms,
    known::{
        atlas::Atlas, codec::decode, recent_grips::RecentGrips, seed_source::SeedSource,
        transferred_grips::TransferredGrips,
    },
    model::{
        constraints::Constraints,
        hand::{Handedness, rig::Rig},
        holdout::Holdout,
        object::GraspObject,
        strategy::{Choice, Strategy, Validity},
    },
    search::{LookUp, find_grasp, find_known_grasp, settings::SearchSettings},
};
use grasp_tests::searches::MonotonicClock;
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
    rig: &'static Rig,
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

    /// The atlas that a server used: the one that comes with it, or one that it left in a folder. None if there is none for
    /// the object and the hand.
    pub(crate) fn atlas(&self, id: &str, folder: &Path, object: &GraspObject) -> Option<Arc<Atlas>> {
        let decoded = |bytes: &[u8]| decode(bytes, object, self.rig).ok();
        let built_in = atlas(id, self.rig).and_then(decoded);
        let grown = built_in.or_else(|| {
            let mut files = fs::read_dir(folder).ok()?;
            files.find_map(|file| decoded(&fs::read(file.ok()?.path()).ok()?))
        })?;
        Some(grown.atlas)
    }

    /// The wall time of a search as the server runs it: a look on the calling thread, then a race of the workers.
    pub(crate) fn search(&self, holdout: &Holdout, atlas: &Arc<Atlas>, seed: u64) -> Taken {
        let mut settings = SearchSettings {
            mechanisms: self.mechanisms,
            ..settings(holdout, Known::Atlas(atlas), seed)
        };
        let clock = MonotonicClock::default();
        let start = Instant::now();
        let outcome = match find_known_grasp(holdout, self.rig, &settings, &clock, LOOK_UP_TIME) {
            LookUp::Found(outcome) => *outcome,
            LookUp::NotFound { tried } => {
                settings.known_tried = tried;
                let stop = AtomicBool::new(false);
                find_grasp(&self.pool, holdout, self.rig, &settings, &clock, &stop)
            }
        };
        Taken {
            time: start.elapsed(),
            found: outcome.grasp.is_some(),
        }
    }

    /// The processor time of a look through the whole atlas up to the first valid grip, on the calling thread: what else
    /// runs on the machine shows less than in wall time.
    pub(crate) fn look_up(&self, holdout: &Holdout, atlas: &Arc<Atlas>) -> Taken {
        let settings = SearchSettings {
            mechanisms: self.mechanisms,
            ..settings(holdout, Known::Atlas(atlas), 0)
        };
        let clock = MonotonicClock::default();
        let start = thread_time();
        let outcome = find_known_grasp(holdout, self.rig, &settings, &clock, ANSWERED_WITHIN);
        Taken {
            time: thread_time().saturating_sub(start),
            found: outcome.found().is_some(),
        }
    }
}

/// What a server knows of how a hand holds an object.
#[derive(Clone, Copy)]
pub(crate) enum Known<'a> {
    /// A complete atlas.
    Atlas(&'a Arc<Atlas>),
    /// No atlas yet, but grips of boxes like the object, if any fit.
    Boxes(Option<&'a Arc<Borrowed>>),
}

/// The settings that the server's defaults come to.
pub(crate) fn settings(holdout: &Holdout, known: Known<'_>, seed: u64) -> SearchSettings {
    let (atlas, starts) = match known {
        Known::Atlas(atlas) => (Some(Arc::clone(atlas)), SeedSource::Atlas(Arc::clone(atlas))),
        Known::Boxes(Some(borrowed)) => (None, SeedSource::Transferred(Arc::clone(borrowed))),
        Known::Boxes(None) => (None, SeedSource::Nothing),
    };
    SearchSettings {
        known: Known {
            atlas,
            seeds: starts,
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

/// Where the system tells no thread's time, wall time must do.
#[cfg(not(target_os = "linux"))]
pub(crate) fn thread_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}
