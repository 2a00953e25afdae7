//! Where a search runs, and how long its call waits for it.

use std::{
    pin::pin,
    sync::{Arc, OnceLock, atomic::AtomicBool},
    time::{Duration, Instant},
};

use rayon::ThreadPool;

use super::{
    job::{Answered, FindJob, PreparedJob},
    progress::Progress,
};
use crate::{
    error::ServiceError,
    executor::{Admission, SearchExecutor},
};

/// How long after its budget a search may end before a call with a deadline is answered without it. Searches end within
/// half a millisecond unless their threads wait for a core, and then no time can be foreseen; shorter ones omit finished
/// work from more answers, longer ones leave less of the deadline.
const OVERDUE_AFTER: Duration = Duration::from_millis(2);

/// A search that runs on the executor, for the call that waits for it.
#[derive(Debug, Default)]
struct RunningSearch {
    job: OnceLock<PreparedJob>,
    progress: Progress,
}

/// Runs a job: looks known grips up on this thread if that is quick, else searches on the executor. If the search does
/// not end when it should, because its threads wait for a core, and the call has a deadline, the answer is what the
/// search has found so far.
///
/// # Errors
/// The giver's joints fold its skin, or the search was stopped or panicked.
pub(crate) async fn find(
    job: FindJob,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    let overdue = job.has_deadline.then(|| job.due() + OVERDUE_AFTER);
    if !job.is_quick_if_known() {
        return search(move || job.prepare(), overdue, executor, admission).await;
    }
    let mut job = job.prepare()?;
    match job.look_up() {
        Some(answered) => answered,
        None => search(move || Ok(job), overdue, executor, admission).await,
    }
}

/// Searches on the executor, and waits for the end or until the search is overdue.
async fn search(
    prepare: impl FnOnce() -> Result<PreparedJob, ServiceError> + Send + 'static,
    overdue: Option<Instant>,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    let running = Arc::new(RunningSearch::default());
    let end = {
        let running = Arc::clone(&running);
        executor.run(admission, move |pool, stop| running.run(prepare()?, pool, stop))
    };
    let Some(overdue) = overdue else {
        return end.await?;
    };
    let mut end = pin!(end);
    tokio::select! {
        biased;
        answered = &mut end => return answered?,
        () = tokio::time::sleep_until(overdue.into()) => {}
    }
    match running.job.get() {
        // Dropping `end` stops the search.
        Some(job) => job.answer_so_far(&running.progress),
        None => end.await?,
    }
}

impl RunningSearch {
    fn run(&self, job: PreparedJob, pool: &ThreadPool, stop: &AtomicBool) -> Result<Answered, ServiceError> {
        self.job.get_or_init(|| job).run(pool, stop, &self.progress)
    }
}
