//! Where a search runs, how long its call waits for it, and the grasps shown meanwhile: every better one, or the best that differ.

use std::{
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::Instant,
};

use grasp_proto::{v1, wire_duration};
use grasp_synthesis::{
    model::{grasp::Grasp, hand::Handedness, object::GraspObject},
    search::{
        FoundGrasp, GraspObserver, GraspSource, SearchEnd,
        report::{Alternative, Alternatives, Class},
    },
};
use tokio::sync::{Notify, SetOnce};

use super::{
    job::FindJob,
    prepared::{Answered, PreparedJob},
    slices::Progress,
};
use crate::{
    answer::wire_grasp,
    error::ServiceError,
    executor::{Admission, SearchExecutor, run_blocking},
    sync::{Mutex, locked},
    validate::Sent,
};

/// A search on the executor, as the call that waits for it sees it.
#[derive(Debug, Default)]
struct RunningSearch {
    job: SetOnce<Arc<PreparedJob>>,
    progress: Progress,
}

/// Runs a job: looks known grips up on this thread if that is quick, else searches on the executor. If the call has a deadline and
/// the search does not end in time, because its threads wait for a core, the answer is made from the grasps found so far.
pub(crate) async fn find(
    job: FindJob,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    let overdue = job.overdue();
    let running = Arc::default();
    // Boxed: jobs of some kilobytes would make the futures of all calls large.
    if !job.is_quick_if_known() {
        let job = Box::new(job);
        return search(
            running,
            move || job.prepare().map(Arc::new),
            overdue,
            executor,
            admission,
        )
        .await;
    }
    let mut job = Box::new(job.prepare()?);
    match job.look_up() {
        Some(answered) => {
            admission.done();
            answered
        }
        None => search(running, move || Ok(Arc::from(job)), overdue, executor, admission).await,
    }
}

/// Searches on the executor, and waits for the end or until the search is overdue.
async fn search(
    running: Arc<RunningSearch>,
    prepare: impl FnOnce() -> Result<Arc<PreparedJob>, ServiceError> + Send + 'static,
    overdue: Option<Instant>,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    let end = {
        let running = Arc::clone(&running);
        executor.run(admission, move |workers, stop| {
            let job = prepare()?;
            // Fails only if it is set, and nothing else sets it.
            let _ = running.job.set(Arc::clone(&job));
            job.run(workers, stop, &running.progress)
        })
    };
    let Some(overdue) = overdue else {
        return end.await?;
    };
    let overdue = async {
        tokio::time::sleep_until(overdue.into()).await;
        running.job.wait().await
    };
    tokio::select! {
        biased;
        answered = end => answered?,
        // Dropping `end` stops the search.
        job = overdue => job.answer(running.progress.outcome(SearchEnd::DeadlinePassed), None),
    }
}

/// The grasps of a search that runs.
#[derive(Debug)]
pub(crate) struct Stream {
    running: Arc<RunningSearch>,
    finds: Arc<Finds>,
}

#[derive(Debug)]
pub(crate) struct Found {
    handedness: Handedness,
    grasp: FoundGrasp,
}

/// Grasps found with both hands.
#[derive(Debug)]
struct Finds {
    sent: Sent,
    /// Bits of the least quality at which a grasp is considered.
    least: AtomicU32,
    /// A grasp better than all that were taken.
    waiting: Mutex<Option<Found>>,
    /// The best that differ.
    alternatives: Mutex<Alternatives>,
    news: Notify,
}

#[derive(Debug)]
struct HandObserver {
    handedness: Handedness,
    object: Arc<GraspObject>,
    finds: Arc<Finds>,
}

impl Finds {
    fn least(&self) -> f32 {
        f32::from_bits(self.least.load(Ordering::Relaxed))
    }

    fn set_least(&self, least: f32) {
        self.least.store(least.to_bits(), Ordering::Relaxed);
    }

    /// True if a grasp is better than all before; nothing is better than a preferred grip.
    fn is_better(&self, source: GraspSource, value: f32) -> bool {
        let least = self.least();
        value > least || (source.is_preferred() && least < f32::INFINITY)
    }
}

impl GraspObserver for HandObserver {
    fn wants(&self, _: &Grasp, source: GraspSource, value: f32) -> bool {
        match self.finds.sent {
            Sent::Better { .. } => self.finds.is_better(source, value),
            Sent::Alternatives { .. } => value >= self.finds.least() || source.is_preferred(),
        }
    }

    fn keep(&self, found: FoundGrasp) {
        let Self {
            handedness,
            object,
            finds,
        } = self;
        match finds.sent {
            Sent::Better { .. } => {
                let mut waiting = locked(&finds.waiting);
                if !finds.is_better(found.source, found.value) {
                    return;
                }
                let is_preferred = found.source.is_preferred();
                finds.set_least(if is_preferred { f32::INFINITY } else { found.value });
                *waiting = Some(Found {
                    handedness: *handedness,
                    grasp: found,
                });
                drop(waiting);
                finds.news.notify_one();
            }
            Sent::Alternatives { by, .. } => {
                let alternative = Alternative {
                    class: Class::of(&found.grasp, *handedness, object, by),
                    handedness: *handedness,
                    found,
                };
                let mut alternatives = locked(&finds.alternatives);
                alternatives.offer(alternative);
                if let Some(least) = alternatives.least() {
                    finds.set_least(least);
                }
            }
        }
    }

    fn goes_on_after_preferred(&self) -> bool {
        matches!(self.finds.sent, Sent::Alternatives { .. })
    }
}

impl Stream {
    pub(crate) fn new(sent: Sent) -> Self {
        let most = match sent {
            Sent::Better { .. } => 0,
            Sent::Alternatives { count, .. } => count,
        };
        Self {
            running: Arc::default(),
            finds: Arc::new(Finds {
                sent,
                least: AtomicU32::new(f32::NEG_INFINITY.to_bits()),
                waiting: Mutex::default(),
                alternatives: Mutex::new(Alternatives::new(most)),
                news: Notify::new(),
            }),
        }
    }

    /// Runs the search, whose grasps the other methods return meanwhile. Dropping the returned future stops it.
    pub(crate) async fn run(
        &self,
        job: FindJob,
        executor: &SearchExecutor,
        admission: Admission,
    ) -> Result<Answered, ServiceError> {
        let overdue = job.overdue();
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

    /// Takes the best grasp so far if it is better than all that were taken; or, once the search has ended, the best that differ,
    /// best first.
    pub(crate) fn take(&self) -> Vec<Found> {
        let waiting = locked(&self.finds.waiting).take();
        let alternatives = std::mem::replace(&mut *locked(&self.finds.alternatives), Alternatives::new(0));
        let alternatives = alternatives.best.into_iter().map(|best| Found {
            handedness: best.handedness,
            grasp: best.found,
        });
        waiting.into_iter().chain(alternatives).collect()
    }

    /// Makes the message of a grasp, with key frames if the request asks for them.
    pub(crate) async fn message(&self, found: Found) -> Result<v1::FindGraspResponse, ServiceError> {
        // Set before the search started.
        let job = Arc::clone(self.running.job.wait().await);
        let plans = job.query.plan_key_frames;
        let message = move || {
            let Found {
                handedness,
                mut grasp,
            } = found;
            let mut hands = job.hands.iter();
            let place = hands.position(|search| search.hand.hand.rig.handedness == handedness);
            let place = place.unwrap_or_default();
            job.plan_key_frames(place, &mut grasp.grasp);
            let found: Instant = job.arrived + grasp.at;
            v1::FindGraspResponse {
                grasps: vec![wire_grasp(&grasp.grasp, &job.hands[place].hand, job.frame())],
                report: Some(v1::SearchReport {
                    search_time: Some(wire_duration(found.saturating_duration_since(job.start))),
                    ..v1::SearchReport::default()
                }),
                origin: Some(job.origin(place, Some(grasp.source))),
                ..v1::FindGraspResponse::default()
            }
        };
        if plans {
            run_blocking(message).await
        } else {
            Ok(message())
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, time::Duration};

    use super::*;
    use crate::{
        client::Client, objects::tests::tetrahedron, rigs::store::RigStore, search::tests::job,
        validate::find_query,
    };

    /// A search whose time has passed.
    fn late_job(has_deadline: bool) -> FindJob {
        let request = v1::FindGraspRequest::new("objects/any");
        let query = find_query(request, ("adult", &RigStore::new(0, None)), |_| true);
        FindJob {
            budget: Duration::ZERO,
            has_deadline,
            ..job(
                query.expect("the request is valid"),
                tetrahedron("any", 0.05, &[]),
            )
        }
    }

    fn admitted(executor: &SearchExecutor) -> Admission {
        let due = Instant::now() + Duration::from_mins(1);
        executor.admit(&Client::Local, due).unwrap()
    }

    #[tokio::test]
    async fn only_a_call_with_a_deadline_is_answered_before_its_search_has_ended() {
        let executor = SearchExecutor::new(1, 8).expect("threads start");
        // Occupies the only worker, as if it waited for a core.
        let (release, released) = mpsc::channel::<()>();
        let (started, has_started) = tokio::sync::oneshot::channel();
        let occupied = {
            let (executor, admission) = (executor.clone(), admitted(&executor));
            tokio::spawn(async move {
                let occupy = move || {
                    started.send(()).unwrap();
                    released.recv().unwrap();
                };
                executor
                    .run(admission, |workers, _| {
                        workers.in_turn(None, |pool| pool.install(occupy));
                    })
                    .await
            })
        };
        has_started.await.unwrap();
        let patient = {
            let (executor, admission) = (executor.clone(), admitted(&executor));
            tokio::spawn(async move { find(late_job(false), &executor, admission).await })
        };
        let urgent = find(late_job(true), &executor, admitted(&executor)).await;
        let answer = urgent.unwrap().response;
        assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
        assert_eq!(answer.attempts(), 0);
        // The search of the answered call keeps its place until it has stopped.
        assert!(!patient.is_finished() && executor.places.taken() == 3);
        release.send(()).unwrap();
        occupied.await.unwrap().unwrap();
        let answer = patient.await.unwrap().unwrap().response;
        assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    }
}
