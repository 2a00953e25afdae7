//! The search pool: admits jobs, runs them off the async runtime, stops them, and contains their panics.
//!
//! Each job has a coordinating thread that waits for its turns at the workers, so that no thread of the async runtime blocks. The
//! workers' threads are named `grasp-search-N` and shared by all jobs.

use std::{
    panic::AssertUnwindSafe,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use futures_util::FutureExt as _;
use grasp_admission::{Gate, Job, TooLate};
use grasp_synthesis::base::stop::Stop;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use tokio::sync::oneshot;

use crate::{
    access::QuotaSearch,
    client::Client,
    error::{Limit, ServiceError},
    faults::{FaultPoint, Faults},
    limits::{Place, Places},
    metrics::Histogram,
    sync::spawn_blocking,
};

/// How long after its time work may end before a call with a deadline is answered without it. Work ends within half a millisecond
/// unless its threads wait for a core.
pub(crate) const OVERDUE_AFTER: Duration = Duration::from_millis(2);

/// When a rejected client should retry: after about the time of a few searches.
const RETRY_AFTER: Duration = Duration::from_millis(50);

/// Niceness of threads that build for a call. Beside busy searches, a thread has a tenth of a core.
const BUILD_NICENESS: i32 = 10;

/// Jobs that have a turn at once. Each uses all workers; another one's slice would come before its next.
const TURNS: usize = 1;

#[derive(Clone, Debug)]
pub(crate) struct SearchExecutor {
    pool: Arc<ThreadPool>,
    pub faults: Faults,
    /// A place per running or waiting job.
    pub places: Places,
    gate: Gate<Client>,
    /// How long jobs waited for their turns.
    pub queue: Arc<Histogram>,
}

/// How long a job has waited for its turns, of which it has one per slice.
#[derive(Debug, Default)]
pub(crate) struct QueueTime(AtomicU64);

impl QueueTime {
    fn add(&self, time: Duration) {
        let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        self.0.fetch_add(ns, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> Duration {
        Duration::from_nanos(self.0.load(Ordering::Relaxed))
    }
}

/// The right to run one job, returned when the job has ended, even if its call was dropped before.
#[derive(Debug)]
pub(crate) struct Admission {
    job: Arc<Job<Client>>,
    queue_time: Arc<QueueTime>,
    _place: Place,
    /// Of the client's own quota.
    _own: Option<QuotaSearch>,
}

impl Admission {
    /// The same within a client's quota.
    pub(crate) fn within(self, own: Option<QuotaSearch>) -> Self {
        Self { _own: own, ..self }
    }

    /// Sets when the job has to end, and whether it goes on as long as there is time, for which others do not wait.
    pub(crate) fn set_due(&self, due: Instant, yields: bool) {
        self.job.set_due(due, yields);
    }

    pub(crate) fn queue_time(&self) -> Arc<QueueTime> {
        Arc::clone(&self.queue_time)
    }

    /// Ends a job that needed no turn.
    pub(crate) fn done(self) {
        self.job.done();
    }
}

/// The workers, as the job on this thread sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Workers<'a> {
    pool: &'a ThreadPool,
    /// `None` for a job that has the workers for itself.
    job: Option<(&'a Job<Client>, &'a QueueTime)>,
}

impl Workers<'_> {
    #[cfg(test)]
    pub(crate) fn alone(pool: &ThreadPool) -> Workers<'_> {
        Workers { pool, job: None }
    }

    /// Does a slice of the job's work when its turn has come. If there is none within `longest`, or the job is over, it has no time
    /// left, which the work notices. The turn lasts until the next slice, or [`Self::end_turn`].
    pub(crate) fn in_turn<T>(self, longest: Option<Duration>, work: impl FnOnce(&ThreadPool) -> T) -> T {
        if let Some((job, queue_time)) = self.job {
            let start = Instant::now();
            job.next_turn(longest);
            queue_time.add(start.elapsed());
        }
        work(self.pool)
    }

    /// Leaves the workers to others until the next slice.
    pub(crate) fn end_turn(self) {
        if let Some((job, _)) = self.job {
            job.end_turn();
        }
    }
}

/// Cancels a job when its call is dropped.
struct CancelGuard(Arc<Job<Client>>);

impl Drop for CancelGuard {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

impl SearchExecutor {
    /// A pool of `workers` threads that admits up to `maximum` jobs.
    pub(crate) fn new(workers: usize, maximum: usize) -> Result<Self, ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(workers)
            .thread_name(|index| format!("grasp-search-{index}"))
            // Without a handler, a panic outside a job's scope would abort the process.
            .panic_handler(|_| tracing::error!("a search worker panicked outside of a job"))
            .build()?;
        Ok(Self {
            pool: Arc::new(pool),
            faults: Faults::default(),
            places: Places::new(Limit::Searches, maximum, RETRY_AFTER),
            gate: Gate::new(TURNS),
            queue: Arc::default(),
        })
    }

    /// Admits a job that has to end when it is due, unless there is no place or too little time for it.
    pub(crate) fn admit(&self, client: &Client, due: Instant) -> Result<Admission, ServiceError> {
        let place = self.places.take(client)?;
        let job = self.gate.admit(client.clone(), Instant::now(), due);
        let job = job.map_err(|TooLate { expected }| ServiceError::WouldMissDeadline { expected })?;
        Ok(Admission {
            job: Arc::new(job),
            queue_time: Arc::default(),
            _place: place,
            _own: None,
        })
    }

    pub(crate) fn workers(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs work of microseconds on the pool.
    pub(crate) fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        self.pool.spawn(work);
    }

    /// Runs a job and waits for it. The job gets the workers and is to stop when the returned future is dropped.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        admission: Admission,
        job: impl FnOnce(Workers<'_>, Stop<'_>) -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let pool = Arc::clone(&self.pool);
        let (faults, queue) = (self.faults.clone(), Arc::clone(&self.queue));
        let _waiting = CancelGuard(Arc::clone(&admission.job));
        run_blocking(move || {
            // Moved into the work: a dropped call frees its place only when its work has stopped.
            let admission = admission;
            let of_job = &*admission.job;
            let workers = Workers {
                pool: &pool,
                job: Some((of_job, &admission.queue_time)),
            };
            faults.at(FaultPoint::Coordinator);
            let is_over = || {
                if rayon::current_thread_index().is_some() {
                    faults.at(FaultPoint::Worker);
                }
                of_job.is_cancelled()
            };
            let output = job(workers, Stop::when(&is_over));
            queue.record(admission.queue_time.get());
            if !of_job.is_cancelled() {
                of_job.done();
            }
            output
        })
        .await
    }
}

/// Runs stoppable work away from the threads of the async runtime. It is to stop when the returned future is dropped or its time is
/// over.
pub(crate) async fn run_stoppable<T: Send + 'static>(
    due: Option<Instant>,
    work: impl FnOnce(Stop<'_>) -> T + Send + 'static,
) -> Result<T, ServiceError> {
    let waiting = Arc::new(());
    let waits = Arc::downgrade(&waiting);
    let work = run_blocking(move || work(Stop::when(&|| waits.strong_count() == 0)));
    // When it is due, the work ends soon; nobody waits for it.
    before(due, work).await?
}

/// The output of a future before the time when it is due.
pub(crate) async fn before<T>(
    due: Option<Instant>,
    future: impl Future<Output = T>,
) -> Result<T, ServiceError> {
    match due {
        None => Ok(future.await),
        Some(due) => {
            let ended = tokio::time::timeout_at(due.into(), future).await;
            ended.map_err(|_| ServiceError::DeadlineExceeded)
        }
    }
}

/// The output of a future, or [`ServiceError::Panicked`]. For work whose values are dropped after a panic.
pub(crate) async fn contained<T>(
    future: impl Future<Output = Result<T, ServiceError>>,
) -> Result<T, ServiceError> {
    let output = AssertUnwindSafe(future).catch_unwind().await;
    output.unwrap_or(Err(ServiceError::Panicked))
}

/// Runs blocking work away from the threads of the async runtime.
pub(crate) async fn run_blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ServiceError> {
    // The task catches the panic; the panic hook has logged it.
    spawn_blocking(work).await.map_err(|error| {
        if error.is_panic() {
            ServiceError::Panicked
        } else {
            ServiceError::Cancelled
        }
    })
}

/// Runs long work on a thread of its own, which leaves the cores to searches. The work must not hold a lock that searches wait for.
pub(crate) async fn run_behind_searches<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ServiceError> {
    let (sender, output) = oneshot::channel();
    let thread = thread::Builder::new()
        .name("grasp-build".to_owned())
        .spawn(move || {
            lower_priority(BUILD_NICENESS);
            // A panic drops the sender; the panic hook has logged it.
            let _ = sender.send(work());
        });
    if let Err(error) = thread {
        tracing::error!(%error, "no thread starts");
    }
    output.await.map_err(|_| ServiceError::Panicked)
}

/// Lowers the priority of this thread, where the system supports that. Raising it again would need privileges.
pub(crate) fn lower_priority(niceness: i32) {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(niceness) {
        tracing::warn!(%error, "a thread runs at the priority of searches");
    }
    #[cfg(not(target_os = "linux"))]
    let _ = niceness;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn panic_in_a_worker_ends_only_its_own_job() {
        let executor = SearchExecutor::new(2, 8).expect("threads start");
        let admit = || {
            let due = Instant::now() + Duration::from_mins(1);
            executor.admit(&Client::Local, due).unwrap()
        };
        for _ in 0..8 {
            let bad = executor.run(admit(), |workers, _| {
                workers.in_turn(None, |pool| {
                    pool.in_place_scope(|scope| {
                        scope.spawn(|_| panic!("on purpose"));
                        scope.spawn(|_| {});
                    });
                });
            });
            let good = executor.run(admit(), |_, _| 7);
            assert_eq!(tokio::join!(bad, good), (Err(ServiceError::Panicked), Ok(7)));
        }
        let threads = executor
            .run(admit(), |workers, _| {
                workers.in_turn(None, |pool| {
                    pool.broadcast(|_| thread::current().name().map(str::to_owned))
                })
            })
            .await
            .unwrap();
        let names: Vec<_> = threads.into_iter().flatten().collect();
        assert_eq!(names, ["grasp-search-0", "grasp-search-1"]);
        while executor.places.taken() > 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }
}
