//! Work that answers nothing before it is done, on the executor.

use std::time::{Duration, Instant};

use grasp_synthesis::base::stop::Stop;
use rayon::ThreadPool;

use crate::{
    error::ServiceError,
    executor::{Admission, SearchExecutor},
};

/// How long after its time work may end before its call is answered without it. As for searches, less omits more work, more takes
/// longer from the deadline.
const OVERDUE_AFTER: Duration = Duration::from_millis(2);

/// Runs work and waits for it, with a deadline only until it is overdue. The work gets the pool and is to stop once
/// nobody waits any more.
///
/// # Errors
/// [`ServiceError::DeadlineExceeded`], those of the work, and those of [`SearchExecutor::run`].
pub(super) async fn on_executor<T: Send + 'static>(
    due: Option<Instant>,
    executor: &SearchExecutor,
    admission: Admission,
    work: impl FnOnce(&ThreadPool, Stop<'_>) -> Result<T, ServiceError> + Send + 'static,
) -> Result<T, ServiceError> {
    let end = executor.run(admission, work);
    let Some(due) = due else {
        return end.await?;
    };
    tokio::select! {
        biased;
        done = end => done?,
        // Dropping `end` stops the work.
        () = tokio::time::sleep_until((due + OVERDUE_AFTER).into()) => Err(ServiceError::DeadlineExceeded),
    }
}
