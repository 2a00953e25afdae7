//! Whether a new hand can take anything: boxes of its size, held by nobody.

use std::{sync::Arc, time::Duration};

use glam::Vec3;
use grasp_synthesis::{
    base::{clock::Clock, rejection::Rejection, stop::Stop},
    known::primitives::Primitive,
    model::holdout::Holdout,
    propose::prepared::{PreparedObject, PreparedRig},
    search::{
        find_grasp,
        scene::Task,
        settings::{Run, SearchSettings},
    },
};

/// Half of the edges of the boxes for a hand of an adult's size, in metres: a bar, a remote control and a block.
const BOXES: [Vec3; 3] = [
    Vec3::new(0.08, 0.010, 0.010),
    Vec3::new(0.08, 0.022, 0.012),
    Vec3::new(0.06, 0.028, 0.028),
];

/// Attempts at each box. Ordinary hands need some tens; more would delay the refusal of hands that take nothing.
const ATTEMPTS: u64 = 1500;

/// How a hand took the boxes.
#[derive(Debug)]
pub(super) struct Trial {
    /// Number of boxes that were taken.
    pub(super) taken: usize,
    /// Why most attempts failed.
    pub(super) main_rejection: Rejection,
}

/// A clock for searches that attempts end.
struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

impl Trial {
    /// Number of boxes.
    pub(super) const BOXES: usize = BOXES.len();

    /// Attempts at each box.
    pub(super) const ATTEMPTS: u64 = ATTEMPTS;

    /// Lets a hand that is `size` times as large as an adult's take the boxes: each time the same attempts, on the calling
    /// thread.
    pub(super) fn of(rig: &PreparedRig, size: f32) -> Self {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.expect("a thread can be started");
        let mut taken = 0;
        let mut rejections = [0; Rejection::ALL.len()];
        for half_extents in BOXES {
            let primitive = Primitive {
                half_extents: size * half_extents,
            };
            let object = Arc::new(primitive.object());
            let prepared = PreparedObject::new(Arc::clone(&object));
            let holdout = Holdout::new(object, None, Vec3::Y).expect("up is a unit vector");
            let task = Task {
                holdout: &holdout,
                object: &prepared,
                rig,
            };
            let settings = SearchSettings {
                run: Run {
                    max_attempts: ATTEMPTS,
                    reproducible: true,
                    ..Run::default()
                },
                ..SearchSettings::default()
            };
            let outcome = find_grasp(&pool, task, &settings, &NoClock, Stop::NEVER);
            taken += usize::from(outcome.grasp.is_some());
            for (sum, count) in rejections.iter_mut().zip(outcome.report.rejections) {
                *sum += count;
            }
        }
        let main = Rejection::ALL
            .into_iter()
            .max_by_key(|rejection| rejections[rejection.index()]);
        Self {
            taken,
            main_rejection: main.unwrap_or(Rejection::NoContacts),
        }
    }
}
