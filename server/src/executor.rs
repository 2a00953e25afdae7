//! The search pool: admits jobs, runs them off the async runtime, stops them, and contains their panics.
//!
//! Each job has a coordinating thread that waits for the workers, so that no thread of the async runtime blocks. The
//! workers' threads are named `grasp-search-N` and shared by all jobs.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_synthesis::base::stop::Stop;
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::{
    error::{Limit, ServiceError},
    limits::{Place, Places},
};

/// How long after its time work may end before a call with a deadline is answered without it. Work ends within half a millisecond
/// unless its threads wait for a core.
pub(crate) const OVERDUE_AFTER: Duration = Duration::from_millis(2);

/// When a rejected client should retry: after about the time of a few searches.
const RETRY_AFTER: Duration = Duration::from_millis(50);

#[derive(Clone, Debug)]
pub(crate) struct SearchExecutor {
    pool: Arc<ThreadPool>,
    /// A place per running or waiting job.
    pub places: Places,
}

/// The right to run one job, returned when the job has ended, even if its call was dropped before.
pub(crate) type Admission = Place;

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
            places: Places::new(Limit::Searches, maximum, RETRY_AFTER),
        })
    }

    pub(crate) fn workers(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Runs work of microseconds on the pool, in its turn.
    pub(crate) fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        self.pool.spawn(work);
    }

    /// Runs a job and waits for it. The job gets the pool and is to stop when the returned future is dropped.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        admission: Admission,
        job: impl FnOnce(&ThreadPool, Stop<'_>) -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let pool = Arc::clone(&self.pool);
        run_stoppable(None, move |stop| {
            // Moved into the work: a dropped call frees its place only when its work has stopped.
            let _admission = admission;
            job(&pool, stop)
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

/// Runs blocking work away from the threads of the async runtime.
pub(crate) async fn run_blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ServiceError> {
    // The task catches the panic; the panic hook has logged it.
    tokio::task::spawn_blocking(work).await.map_err(|error| {
        if error.is_panic() {
            ServiceError::Panicked
        } else {
            ServiceError::Cancelled
        }
    })
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;
    use crate::client::Client;

    #[tokio::test]
    async fn panic_in_a_worker_ends_only_its_own_job() {
        let executor = SearchExecutor::new(2, 8).expect("threads start");
        for _ in 0..8 {
            let bad = executor.run(executor.places.take(&Client::Local).unwrap(), |pool, _| {
                pool.in_place_scope(|scope| {
                    scope.spawn(|_| panic!("on purpose"));
                    scope.spawn(|_| {});
                });
            });
            let good = executor.run(executor.places.take(&Client::Local).unwrap(), |_, _| 7);
            assert_eq!(tokio::join!(bad, good), (Err(ServiceError::Panicked), Ok(7)));
        }
        let threads = executor
            .run(executor.places.take(&Client::Local).unwrap(), |pool, _| {
                pool.broadcast(|_| thread::current().name().map(str::to_owned))
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
