//! The queue of atlases to build.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use grasp_assets::hands::Hand;

use crate::objects::StoredObject;

/// Length from which the queue drops jobs of evicted objects.
const MANY_JOBS: usize = 1024;

/// An atlas to build.
#[derive(Debug)]
pub(super) struct BuildJob {
    /// The object; gone once it was evicted.
    pub object: Weak<StoredObject>,
    /// The hand that holds it.
    pub hand: Arc<Hand>,
    /// Work done since the atlas was requested.
    pub worked: Duration,
}

/// Jobs for the builder threads, and the flag that stops them.
#[derive(Debug, Default)]
pub(super) struct BuildQueue {
    jobs: Mutex<VecDeque<BuildJob>>,
    has_jobs: Condvar,
    stop: AtomicBool,
}

impl BuildQueue {
    /// Adds a job.
    pub(super) fn push(&self, job: BuildJob) {
        let mut jobs = self.jobs();
        if jobs.len() >= MANY_JOBS {
            jobs.retain(|job| job.object.strong_count() > 0);
        }
        jobs.push_back(job);
        self.has_jobs.notify_one();
    }

    /// Waits for a job; none once the queue was stopped. The job with the least work done comes first, so that a new
    /// atlas is soon useful however long others can still grow; of several, the oldest.
    pub(super) fn next(&self) -> Option<BuildJob> {
        let mut jobs = self.jobs();
        loop {
            if self.is_stopped() {
                return None;
            }
            let least = (0..jobs.len()).min_by_key(|&place| jobs[place].worked);
            match least.and_then(|place| jobs.remove(place)) {
                Some(job) => return Some(job),
                None => jobs = self.has_jobs.wait(jobs).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    /// True if an atlas waits that was never worked on.
    pub(super) fn has_new_job(&self) -> bool {
        self.jobs().iter().any(|job| job.worked.is_zero())
    }

    /// Ends every wait for a job, now and later.
    pub(super) fn stop(&self) {
        // Under the lock, so that no builder goes to sleep between reading the flag and waiting.
        let _jobs = self.jobs();
        self.stop.store(true, Ordering::Relaxed);
        self.has_jobs.notify_all();
    }

    /// True after [`BuildQueue::stop`].
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn jobs(&self) -> MutexGuard<'_, VecDeque<BuildJob>> {
        // No code panics while it holds the lock; if some did, the queue would still be consistent.
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands::hand;
    use grasp_synthesis::model::hand::Handedness;

    use super::*;
    use crate::objects::tests::tetrahedron;

    #[test]
    fn serves_new_jobs_first_then_the_least_worked_on() {
        let queue = BuildQueue::default();
        let objects = ["a", "b", "c", "d"].map(|id| Arc::new(tetrahedron(id, 0.1, &[])));
        let milliseconds = [300, 0, 20, 0];
        for (object, worked) in objects.iter().zip(milliseconds) {
            queue.push(BuildJob {
                object: Arc::downgrade(object),
                hand: Arc::clone(hand("adult", Handedness::Right).expect("it is built in")),
                worked: Duration::from_millis(worked),
            });
        }
        let next = || {
            let is_new = queue.has_new_job();
            let job = queue.next().expect("a job is left");
            let object = job.object.upgrade().expect("the test holds it");
            (object.id.clone(), is_new)
        };
        let order = [next(), next(), next(), next()];
        let expected = [("b", true), ("d", true), ("c", false), ("a", false)];
        assert_eq!(order, expected.map(|(id, is_new)| (id.to_owned(), is_new)));
    }

    #[test]
    fn gives_no_job_after_stop() {
        let queue = BuildQueue::default();
        let object = Arc::new(tetrahedron("a", 0.1, &[]));
        queue.push(BuildJob {
            object: Arc::downgrade(&object),
            hand: Arc::clone(hand("adult", Handedness::Right).expect("it is built in")),
            worked: Duration::ZERO,
        });
        queue.stop();
        assert!(queue.next().is_none());
    }
}
