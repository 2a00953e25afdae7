//! The threads that build atlases, and their queue.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use grasp_assets::hands::{Hand, hand};
use grasp_synthesis::{
    base::stop::Stop, known::growth::Grown, model::hand::Handedness, propose::prepared::PreparedObject,
};

use super::{files::AtlasFiles, growing::work};
use crate::{
    atlas_slots::Demand,
    executor::{SearchExecutor, lower_priority},
    objects::{
        StoredObject,
        store::{Need, ObjectStore},
    },
};

/// Niceness of a builder thread: 19 is the lowest priority on Linux. A lower value takes more CPU time from searches.
const NICENESS: i32 = 19;

/// State shared by the builder threads.
#[derive(Debug)]
pub(super) struct Builders {
    pub queue: BuildQueue,
    /// The objects, in whose cache atlases are.
    pub objects: Arc<ObjectStore>,
    pub executor: SearchExecutor,
    pub files: Option<AtlasFiles>,
    pub default_rig: String,
    /// Number of threads that grow atlases.
    pub threads: usize,
    /// The start of the clock of demands.
    pub started: Instant,
}

impl Builders {
    /// True if there are threads and they were not stopped.
    pub(super) fn are_running(&self) -> bool {
        !self.queue.is_stopped() && self.threads > 0
    }

    /// An object in the form that searches use, built if necessary. `None` if there is no room for it, or if the server stops. Holding
    /// it does not keep the object from being evicted.
    pub(super) fn prepared(&self, object: &Arc<StoredObject>) -> Option<Arc<PreparedObject>> {
        let is_stopped = || self.queue.is_stopped();
        let derived = self.objects.derived(object, Need::Ahead, Stop::when(&is_stopped));
        derived
            .inspect_err(|error| tracing::debug!(object = object.name(), %error, "no atlas grows"))
            .ok()
            .map(|derived| Arc::clone(&derived.object))
    }

    /// Puts an atlas in its slot; `spent` is the work done on it since the last time. False if there is no room.
    pub(super) fn publish(
        &self,
        object: &Arc<StoredObject>,
        hand: &Arc<Hand>,
        grown: Arc<Grown>,
        spent: Duration,
    ) -> bool {
        self.objects.change_atlas(object, hand, |slot| {
            slot.grown = Some(grown);
            slot.build_time += spent;
        })
    }

    pub(super) fn default_hand(&self, handedness: Handedness) -> Option<&'static Arc<Hand>> {
        hand(&self.default_rig, handedness)
    }

    /// Records a call for the atlases of one or two hands, as if at the same time, so that neither drops the other, and puts
    /// those that are absent in the queue.
    pub(super) fn request(&self, object: &Arc<StoredObject>, hands: [Option<&Arc<Hand>>; 2]) {
        let now = self.started.elapsed();
        let hands = hands.into_iter().flatten();
        for hand in hands.filter(|hand| object.atlas_slots.request(hand, now)) {
            self.queue.push(BuildJob {
                object: Arc::downgrade(object),
                hand: Arc::clone(hand),
                stage: Stage::Unread,
            });
        }
    }
}

/// Starts a thread that grows atlases, or one that reads them at the priority of other threads: requests wait for those.
pub(super) fn start_thread(builders: &Arc<Builders>, name: String, grows: bool) -> std::io::Result<()> {
    let builders = Arc::clone(builders);
    let thread = thread::Builder::new().name(name).spawn(move || {
        if grows {
            lower_priority(NICENESS);
        }
        while let Some(job) = builders.queue.next(grows) {
            work(&builders, job);
        }
    });
    thread.map(|_| ())
}

/// Worth of completing an atlas, relative to making another useful: a ninth of the calls, for six times the work.
const WORTH_OF_COMPLETING: f64 = 1.0 / 64.0;

/// How far an atlas in the queue has got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// It was not looked for among files and shipped grips.
    Unread,
    /// It has to become useful.
    Starting,
    /// It had its first slice of work.
    Completing,
}

#[derive(Debug)]
pub(super) struct BuildJob {
    /// The object; gone once it was evicted.
    pub object: Weak<StoredObject>,
    pub hand: Arc<Hand>,
    /// The next stage.
    pub stage: Stage,
}

impl BuildJob {
    /// Its worth per time of a builder, as a demand. `None` if its object or slot is gone.
    fn worth(&self) -> Option<Demand> {
        let demand = self.object.upgrade()?.atlas_slots.demand(&self.hand)?;
        Some(match self.stage {
            Stage::Completing => demand.share(WORTH_OF_COMPLETING),
            Stage::Unread | Stage::Starting => demand,
        })
    }
}

/// Jobs for the builder threads, and the flag that stops them.
#[derive(Debug, Default)]
pub(super) struct BuildQueue {
    jobs: Mutex<VecDeque<BuildJob>>,
    has_jobs: Condvar,
    stop: AtomicBool,
}

impl BuildQueue {
    pub(super) fn push(&self, job: BuildJob) {
        self.jobs().push_back(job);
        // Some threads wait for jobs of certain stages only.
        self.has_jobs.notify_all();
    }

    /// Waits for an atlas to grow or to read. `None` once the queue was stopped. The atlas in most demand comes first, the oldest
    /// of several; all others are useful before an atlas is completed, unless it is in far more demand.
    pub(super) fn next(&self, grows: bool) -> Option<BuildJob> {
        let mut jobs = self.jobs();
        loop {
            if self.is_stopped() {
                return None;
            }
            match first(&mut jobs, |job| (job.stage != Stage::Unread) == grows) {
                Some((place, _)) => return jobs.remove(place),
                None => jobs = self.has_jobs.wait(jobs).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    /// The first atlas to be made useful before `other` is completed. `None` if there is none.
    pub(super) fn next_before(&self, other: &BuildJob) -> Option<BuildJob> {
        let worth = other.worth()?;
        let mut jobs = self.jobs();
        let first = first(&mut jobs, |job| job.stage == Stage::Starting);
        let (place, _) = first.filter(|(_, first)| first.cmp(worth).is_gt())?;
        jobs.remove(place)
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
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The place and worth of the first of the jobs that count. Drops those whose objects are gone.
fn first(jobs: &mut VecDeque<BuildJob>, counts: impl Fn(&BuildJob) -> bool) -> Option<(usize, Demand)> {
    let mut first: Option<(usize, Demand)> = None;
    let mut place = 0;
    jobs.retain(|job| {
        let Some(worth) = job.worth() else { return false };
        if counts(job) && first.is_none_or(|(_, best)| worth.cmp(best).is_gt()) {
            first = Some((place, worth));
        }
        place += 1;
        true
    });
    first
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{atlases::tests::adult, objects::tests::tetrahedron};

    /// An object that was requested so often.
    fn asked_for(id: &str, calls: usize) -> Arc<StoredObject> {
        let object = Arc::new(tetrahedron(id, 0.1, &[]));
        for _ in 0..calls {
            object.atlas_slots.request(adult(), Duration::ZERO);
        }
        object
    }

    fn job(object: &Arc<StoredObject>, stage: Stage) -> BuildJob {
        BuildJob {
            object: Arc::downgrade(object),
            hand: Arc::clone(adult()),
            stage,
        }
    }

    fn id(job: &BuildJob) -> String {
        job.object.upgrade().expect("the test holds it").id.clone()
    }

    #[test]
    fn serves_the_job_in_most_demand_and_useful_slices_before_completions() {
        let queue = BuildQueue::default();
        let calls = [
            ("once", 1),
            ("often", 20),
            ("complete", 30),
            ("twice", 2),
            ("very often", 200),
            ("unread", 1),
        ];
        let objects = calls.map(|(id, calls)| asked_for(id, calls));
        for object in &objects {
            let stage = match object.id.as_str() {
                "complete" | "very often" => Stage::Completing,
                "unread" => Stage::Unread,
                _ => Stage::Starting,
            };
            queue.push(job(object, stage));
        }
        assert_eq!(id(&queue.next(false).expect("one is left")), "unread");
        // 200 calls are worth as much as three for an atlas that is not useful yet.
        let order: Vec<String> = objects[1..]
            .iter()
            .map(|_| id(&queue.next(true).expect("a job is left")))
            .collect();
        assert_eq!(order, ["often", "very often", "twice", "once", "complete"]);
    }

    #[test]
    fn serves_the_oldest_of_equals_and_drops_jobs_of_objects_that_are_gone() {
        let queue = BuildQueue::default();
        let [a, gone, b] = ["a", "gone", "b"].map(|id| asked_for(id, 1));
        for object in [&a, &gone, &b] {
            queue.push(job(object, Stage::Starting));
        }
        drop(gone);
        assert_eq!(
            [(); 2].map(|()| id(&queue.next(true).expect("two are left"))),
            ["a", "b"]
        );
        assert!(queue.jobs().is_empty());
    }

    #[test]
    fn only_slices_that_are_worth_more_precede_a_completion() {
        let queue = BuildQueue::default();
        let object = asked_for("completing", 100);
        let completing = job(&object, Stage::Completing);
        let others = [
            ("once", 1, Stage::Starting),
            ("twice", 2, Stage::Starting),
            ("as well", 900, Stage::Completing),
        ];
        let objects = others.map(|(id, calls, stage)| (asked_for(id, calls), stage));
        for (object, stage) in &objects {
            queue.push(job(object, *stage));
        }
        let next = || queue.next_before(&completing).map(|job| id(&job));
        assert_eq!([next(), next()], [Some("twice".to_owned()), None]);
    }
}
