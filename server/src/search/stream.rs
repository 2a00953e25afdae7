//! Searches whose grasps are wanted as they are found: every better one, or the best that differ.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU32, Ordering},
    },
    time::Instant,
};

use grasp_proto::{v1, wire_duration};
use grasp_synthesis::{
    model::{grasp::Grasp, hand::Handedness, object::GraspObject},
    search::{
        FoundGrasp, GraspObserver, GraspSource,
        report::{Alternative, Alternatives, Class, Differences},
    },
};
use tokio::sync::Notify;

use super::{
    find::{RunningSearch, overdue, search},
    job::{Answered, FindJob, PreparedJob},
};
use crate::{
    answer::wire_grasp,
    error::ServiceError,
    executor::{Admission, SearchExecutor, run_blocking},
};

/// Which grasps are wanted.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wanted {
    /// Each that is better than those before.
    Better,
    /// At most so many that differ.
    Alternatives {
        /// How many.
        most: usize,
        /// What they differ by.
        by: Differences,
    },
}

/// The grasps of a search that runs.
#[derive(Clone, Debug)]
pub(crate) struct Stream {
    running: Arc<RunningSearch>,
    finds: Arc<Finds>,
}

/// A grasp of a search, and its hand.
#[derive(Debug)]
pub(crate) struct Found {
    handedness: Handedness,
    grasp: FoundGrasp,
}

/// What the observers of both hands have found.
#[derive(Debug)]
struct Finds {
    wanted: Wanted,
    /// Bits of the least quality that any grasp has to reach to be looked at.
    least: AtomicU32,
    state: Mutex<State>,
    /// A better grasp waits.
    news: Notify,
}

#[derive(Debug)]
struct State {
    /// A grasp better than all that were taken.
    waiting: Option<Found>,
    /// The best that differ.
    alternatives: Alternatives,
}

/// Observes the search with one hand.
#[derive(Debug)]
struct HandObserver {
    handedness: Handedness,
    object: Arc<GraspObject>,
    finds: Arc<Finds>,
}

impl Finds {
    fn new(wanted: Wanted) -> Self {
        let most = match wanted {
            Wanted::Better => 0,
            Wanted::Alternatives { most, .. } => most,
        };
        Self {
            wanted,
            least: AtomicU32::new(f32::NEG_INFINITY.to_bits()),
            state: Mutex::new(State {
                waiting: None,
                alternatives: Alternatives::new(most),
            }),
            news: Notify::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // No code panics while it holds the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn least(&self) -> f32 {
        f32::from_bits(self.least.load(Ordering::Relaxed))
    }

    fn set_least(&self, least: f32) {
        self.least.store(least.to_bits(), Ordering::Relaxed);
    }

    /// Keeps a grasp if it is better than all before.
    fn keep_better(&self, found: Found) {
        let mut state = self.state();
        let is_preferred = found.grasp.source.is_preferred();
        let least = self.least();
        if !(found.grasp.value > least || (is_preferred && least < f32::INFINITY)) {
            return;
        }
        // Nothing is better than a preferred grip.
        self.set_least(if is_preferred {
            f32::INFINITY
        } else {
            found.grasp.value
        });
        state.waiting = Some(found);
        drop(state);
        self.news.notify_one();
    }

    /// Keeps a grasp if it is among the best that differ.
    fn keep_alternative(&self, alternative: Alternative) {
        let mut state = self.state();
        state.alternatives.offer(alternative);
        if let Some(least) = state.alternatives.least() {
            self.set_least(least);
        }
    }
}

impl GraspObserver for HandObserver {
    fn wants(&self, _: &Grasp, source: GraspSource, value: f32) -> bool {
        let least = self.finds.least();
        match self.finds.wanted {
            Wanted::Better => value > least || (source.is_preferred() && least < f32::INFINITY),
            Wanted::Alternatives { .. } => value >= least || source.is_preferred(),
        }
    }

    fn keep(&self, found: FoundGrasp) {
        let handedness = self.handedness;
        match self.finds.wanted {
            Wanted::Better => self.finds.keep_better(Found {
                handedness,
                grasp: found,
            }),
            Wanted::Alternatives { by, .. } => self.finds.keep_alternative(Alternative {
                class: Class::of(&found.grasp, handedness, &self.object, by),
                handedness,
                found,
            }),
        }
    }

    fn goes_on_after_preferred(&self) -> bool {
        matches!(self.finds.wanted, Wanted::Alternatives { .. })
    }
}

impl Stream {
    /// A stream before its search.
    pub(crate) fn new(wanted: Wanted) -> Self {
        Self {
            running: Arc::default(),
            finds: Arc::new(Finds::new(wanted)),
        }
    }

    /// Runs the search, whose grasps the other methods return meanwhile. Dropping the returned future stops it.
    ///
    /// # Errors
    /// Those of [`super::find`].
    pub(crate) async fn run(
        &self,
        job: FindJob,
        executor: &SearchExecutor,
        admission: Admission,
    ) -> Result<Answered, ServiceError> {
        let overdue = overdue(&job);
        let (job, finds) = (Box::new(job), Arc::clone(&self.finds));
        let prepare = move || {
            let mut job = job.prepare()?;
            let object = Arc::clone(job.derived.object.object());
            for search in &mut job.hands {
                search.settings.run.observer = Some(Arc::new(HandObserver {
                    handedness: search.hand.hand.rig.handedness,
                    object: Arc::clone(&object),
                    finds: Arc::clone(&finds),
                }));
            }
            Ok(Arc::new(job))
        };
        search(Arc::clone(&self.running), prepare, overdue, executor, admission).await
    }

    /// Waits until there may be a better grasp.
    pub(crate) async fn news(&self) {
        self.finds.news.notified().await;
    }

    /// Takes the best grasp so far, if it is better than all that were taken.
    pub(crate) fn take_better(&self) -> Option<Found> {
        self.finds.state().waiting.take()
    }

    /// Takes the best grasps that differ, best first.
    pub(crate) fn take_alternatives(&self) -> Vec<Found> {
        let alternatives = std::mem::replace(&mut self.finds.state().alternatives, Alternatives::new(0));
        let best = alternatives.into_best().into_iter();
        best.map(|best| Found {
            handedness: best.handedness,
            grasp: best.found,
        })
        .collect()
    }

    /// Makes the message of a grasp, with key frames if the request asks for them.
    ///
    /// # Errors
    /// Planning them panicked.
    pub(crate) async fn message(&self, found: Found) -> Result<v1::FindGraspResponse, ServiceError> {
        // Set before the search started.
        let job = Arc::clone(self.running.job.wait().await);
        if job.query.plan_key_frames {
            run_blocking(move || message(&job, found)).await
        } else {
            Ok(message(&job, found))
        }
    }
}

fn message(job: &PreparedJob, found: Found) -> v1::FindGraspResponse {
    let Found {
        handedness,
        mut grasp,
    } = found;
    let place = job
        .hands
        .iter()
        .position(|search| search.hand.hand.rig.handedness == handedness)
        .unwrap_or_default();
    job.plan_key_frames(place, &mut grasp.grasp);
    let at: Instant = job.arrived + grasp.at;
    v1::FindGraspResponse {
        grasps: vec![wire_grasp(&grasp.grasp, &job.hands[place].hand, job.frame())],
        report: Some(v1::SearchReport {
            search_time: Some(wire_duration(at.saturating_duration_since(job.start))),
            ..v1::SearchReport::default()
        }),
        origin: Some(job.origin(place, Some(grasp.source))),
        ..v1::FindGraspResponse::default()
    }
}
