//! Where a search runs, and how long its call waits for it.

use std::{sync::Arc, time::Instant};

use grasp_synthesis::search::SearchEnd;
use tokio::sync::SetOnce;

use super::{
    job::{Answered, FindJob, PreparedJob},
    progress::Progress,
};
use crate::{
    error::ServiceError,
    executor::{Admission, OVERDUE_AFTER, SearchExecutor},
};

/// A search on the executor, as the call that waits for it sees it.
#[derive(Debug, Default)]
pub(super) struct RunningSearch {
    /// Set when the search starts.
    pub(super) job: SetOnce<Arc<PreparedJob>>,
    progress: Progress,
}

/// Runs a job: looks known grips up on this thread if that is quick, else searches on the executor. If the call has a
/// deadline and the search does not end in time, because its threads wait for a core, the answer is what the search has
/// found so far.
///
/// # Errors
/// The giver's joints fold its skin, or the search was stopped or panicked.
pub(crate) async fn find(
    job: FindJob,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    let overdue = overdue(&job);
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
        Some(answered) => answered,
        None => search(running, move || Ok(Arc::from(job)), overdue, executor, admission).await,
    }
}

/// When the call of a job is answered without its end, if ever.
pub(super) fn overdue(job: &FindJob) -> Option<Instant> {
    job.has_deadline.then(|| job.due() + OVERDUE_AFTER)
}

/// Searches on the executor, and waits for the end or until the search is overdue.
pub(super) async fn search(
    running: Arc<RunningSearch>,
    prepare: impl FnOnce() -> Result<Arc<PreparedJob>, ServiceError> + Send + 'static,
    overdue: Option<Instant>,
    executor: &SearchExecutor,
    admission: Admission,
) -> Result<Answered, ServiceError> {
    let end = {
        let running = Arc::clone(&running);
        executor.run(admission, move |pool, stop| {
            let job = prepare()?;
            // Fails only if it is set, which happens here only.
            let _ = running.job.set(Arc::clone(&job));
            job.run(pool, stop, &running.progress)
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
        job = overdue => job.answer(running.progress.outcome(SearchEnd::DeadlinePassed)),
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, time::Duration};

    use grasp_proto::v1;
    use grasp_synthesis::base::stop::unstopped;

    use super::*;
    use crate::{objects::tests::tetrahedron, rigs::store::RigStore, validate::find_query};

    /// A search whose time has passed.
    fn late_job(has_deadline: bool) -> FindJob {
        let stored = Arc::new(tetrahedron("any", 0.05, &[]));
        let request = v1::FindGraspRequest::new("objects/any");
        FindJob {
            query: find_query(request, ("adult", &RigStore::new(0, None)), |_| true)
                .expect("the request is valid"),
            derived: unstopped(|stop| stored.derived_until(stop)),
            stored,
            resized: None,
            seed: 3,
            arrived: Instant::now(),
            budget: Duration::ZERO,
            patience: Duration::ZERO,
            has_deadline,
            workers: 1,
            refinement: Duration::ZERO,
            known: Default::default(),
        }
    }

    #[tokio::test]
    async fn only_a_call_with_a_deadline_is_answered_before_its_search_has_ended() {
        let executor = SearchExecutor::new(1, 3).expect("threads start");
        // Occupies the only worker, as if it waited for a core.
        let (release, released) = mpsc::channel::<()>();
        let (started, has_started) = tokio::sync::oneshot::channel();
        let occupied = {
            let (executor, admission) = (executor.clone(), executor.admit().unwrap());
            tokio::spawn(async move {
                let occupy = move || {
                    started.send(()).unwrap();
                    released.recv().unwrap();
                };
                executor.run(admission, |pool, _| pool.install(occupy)).await
            })
        };
        has_started.await.unwrap();
        let patient = {
            let (executor, admission) = (executor.clone(), executor.admit().unwrap());
            tokio::spawn(async move { find(late_job(false), &executor, admission).await })
        };
        let urgent = find(late_job(true), &executor, executor.admit().unwrap()).await;
        let answer = urgent.unwrap().response;
        assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
        assert_eq!(answer.attempts(), 0);
        // The search of the answered call keeps its place until it has stopped.
        assert!(!patient.is_finished() && executor.jobs() == 3);
        release.send(()).unwrap();
        occupied.await.unwrap().unwrap();
        let answer = patient.await.unwrap().unwrap().response;
        assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    }
}
