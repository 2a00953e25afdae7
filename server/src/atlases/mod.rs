//! The atlases: what is known of how hands hold the server's objects, found in the background.
//!
//! Every object has a [`shelf`] with an atlas for each hand that was asked for. A registered object gets one for the
//! default rig's right hand, then one for its left; other hands get theirs once a request has named them. The
//! [`builder`] lets them grow on threads of its own, at low priority and beside searches only a tenth of the time; what
//! it finds is kept in [`files`], if there is a folder for them.
//!
//! Atlases take what created objects leave of `cache_bytes`, and give way to them: those that were not used for longest
//! are dropped, and are built or read again when they are asked for.
//!
//! What a search found because no atlas had it is kept by [`recents`], as it is mostly asked for again: the giver's hand
//! moves less from one request to the next than from one person to another.

mod builder;
pub(crate) mod files;
mod recents;
pub(crate) mod shelf;
#[cfg(test)]
mod tests;

use std::{
    collections::VecDeque,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    },
    time::Duration,
};

use grasp_assets::hands::{Hand, hand};
use grasp_proto::v1;
use grasp_synthesis::{
    known::{atlas::Atlas, entry::Entry, growth::Grown, recent_grips::RecentGrips},
    model::hand::Handedness,
};

use self::{files::AtlasFiles, recents::Recents};
use crate::{
    objects::{StoredObject, store::ObjectStore},
    search::executor::SearchExecutor,
};

/// Waiting jobs from which on those of objects that are gone are looked for.
const MANY_JOBS: usize = 1024;

/// An atlas that is to be built.
#[derive(Debug)]
struct Job {
    object: Weak<StoredObject>,
    hand: &'static Hand,
    /// How long it has been worked on since it was asked for.
    worked: Duration,
}

/// What is known of how a hand holds an object.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    /// The atlas, if it has anything yet.
    pub atlas: Option<Arc<Atlas>>,
    /// What searches found lately.
    pub recent: RecentGrips,
}

/// All atlases and the threads that build them; dropped, the threads end.
#[derive(Debug)]
pub(crate) struct Atlases {
    workshop: Arc<Workshop>,
}

/// What the builders share.
#[derive(Debug)]
struct Workshop {
    store: Arc<ObjectStore>,
    executor: SearchExecutor,
    files: Option<AtlasFiles>,
    default_rig: String,
    recents: Recents,
    jobs: Mutex<VecDeque<Job>>,
    has_jobs: Condvar,
    stop: AtomicBool,
    builders: AtomicUsize,
    /// Counts uses; the largest is the latest.
    uses: AtomicU64,
    /// What may hold atlases, and the right to add and drop some.
    kept: Mutex<Vec<(Weak<StoredObject>, &'static Hand)>>,
}

/// Stops the builders when it is dropped.
#[derive(Debug)]
pub(crate) struct StopBuilders(Arc<Workshop>);

impl Drop for StopBuilders {
    fn drop(&mut self) {
        self.0.stop();
    }
}

impl Atlases {
    /// Starts `threads` builders for the objects of a store, which wait while `executor` searches; none keep no atlases.
    ///
    /// # Errors
    /// The threads cannot be started.
    pub(crate) fn start(
        threads: usize,
        store: Arc<ObjectStore>,
        executor: SearchExecutor,
        files: Option<AtlasFiles>,
        default_rig: String,
    ) -> std::io::Result<Self> {
        let workshop = Arc::new(Workshop {
            store,
            executor,
            files,
            default_rig,
            recents: Recents::default(),
            jobs: Mutex::default(),
            has_jobs: Condvar::new(),
            stop: AtomicBool::new(false),
            builders: AtomicUsize::new(0),
            uses: AtomicU64::new(0),
            kept: Mutex::default(),
        });
        let atlases = Self {
            workshop: Arc::clone(&workshop),
        };
        for number in 0..threads {
            builder::start(number, &workshop)?;
        }
        for object in workshop.store.pinned() {
            atlases.registered(object);
        }
        Ok(atlases)
    }

    /// Has the atlases of a new object built, after making room for the object itself.
    pub(crate) fn registered(&self, object: &Arc<StoredObject>) {
        if self.workshop.is_open() {
            self.workshop.fit(self.workshop.store.room());
            self.workshop
                .ask(object, self.workshop.default_hand(Handedness::Right));
        }
    }

    /// What is known of how a hand holds an object; its atlas is built from now on.
    pub(crate) fn get(&self, object: &Arc<StoredObject>, hand: &'static Hand) -> Known {
        if !self.workshop.is_open() {
            return Known::default();
        }
        self.workshop.ask(object, Some(hand));
        let slot = object.shelf.slot(hand).unwrap_or_default();
        let atlas = slot.grown.filter(|grown| !grown.atlas.entries().is_empty());
        Known {
            atlas: atlas.map(|grown| Arc::clone(&grown.atlas)),
            recent: slot.recent,
        }
    }

    /// Keeps a grip that a search found, under the object's own friction, for the requests that follow.
    pub(crate) fn remember(&self, object: &Arc<StoredObject>, hand: &'static Hand, grip: Entry) {
        if self.workshop.is_open() {
            self.workshop.recents.keep(object, hand, grip);
        }
    }

    /// The state of an object's atlas for the default rig's right hand; none if no atlases are kept.
    pub(crate) fn state(&self, object: &StoredObject) -> Option<v1::AtlasState> {
        if !self.workshop.is_open() {
            return None;
        }
        let slot = object
            .shelf
            .slot(self.workshop.default_hand(Handedness::Right)?)
            .unwrap_or_default();
        let atlas = slot
            .grown
            .map(|grown| Arc::clone(&grown.atlas))
            .unwrap_or_default();
        Some(v1::AtlasState {
            entries: u32::try_from(atlas.entries().len()).unwrap_or(u32::MAX),
            complete: slot.standing == shelf::Standing::Finished,
            stamp: stamp(&atlas),
            build_time: prost_types::Duration::try_from(slot.build_time).ok(),
        })
    }

    /// Threads that build.
    pub(crate) fn builders(&self) -> usize {
        self.workshop.builders.load(Ordering::Relaxed)
    }

    /// Something to stop the builders by.
    pub(crate) fn stopper(&self) -> StopBuilders {
        StopBuilders(Arc::clone(&self.workshop))
    }
}

impl Drop for Atlases {
    fn drop(&mut self) {
        self.workshop.stop();
    }
}

/// An atlas' stamp as the contract tells it; empty for an empty one.
pub(crate) fn stamp(atlas: &Atlas) -> String {
    if atlas.entries().is_empty() {
        String::new()
    } else {
        format!("{:016x}", atlas.stamp())
    }
}

impl Workshop {
    /// True if there are builders and they were not told to stop.
    fn is_open(&self) -> bool {
        !self.is_stopped() && self.builders.load(Ordering::Relaxed) > 0
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn stop(&self) {
        // Under the lock, so that no builder goes to sleep between looking at the flag and waiting.
        let _jobs = self.jobs();
        self.stop.store(true, Ordering::Relaxed);
        self.has_jobs.notify_all();
    }

    fn default_hand(&self, handedness: Handedness) -> Option<&'static Hand> {
        hand(&self.default_rig, handedness)
    }

    /// Notes that an atlas is wanted, and has it built if nobody has done so before.
    fn ask(&self, object: &Arc<StoredObject>, hand: Option<&'static Hand>) {
        let now = self.uses.fetch_add(1, Ordering::Relaxed) + 1;
        if let Some(hand) = hand.filter(|hand| object.shelf.ask(hand, now)) {
            self.enqueue(Job {
                object: Arc::downgrade(object),
                hand,
                worked: Duration::ZERO,
            });
        }
    }

    fn enqueue(&self, job: Job) {
        let mut jobs = self.jobs();
        if jobs.len() >= MANY_JOBS {
            jobs.retain(|job| job.object.strong_count() > 0);
        }
        jobs.push_back(job);
        self.has_jobs.notify_one();
    }

    /// The job that was worked on least, so that what is new is soon of use however much others can still grow; of several,
    /// the one that waits longest. None when it is time to stop.
    fn next_job(&self) -> Option<Job> {
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

    /// True if an atlas waits that was not worked on yet.
    fn has_new_job(&self) -> bool {
        self.jobs().iter().any(|job| job.worked.is_zero())
    }

    /// Puts what has grown on its shelf if there is room for it, or if there is after those were dropped that were used
    /// less lately. False if there is not.
    fn publish(
        &self,
        object: &Arc<StoredObject>,
        hand: &'static Hand,
        grown: Arc<Grown>,
        spent: Duration,
    ) -> bool {
        let bytes = grown.bytes();
        let mut kept = self.kept();
        kept.retain(|(object, _)| object.strong_count() > 0);
        let place = |(other, its_hand): &(Weak<StoredObject>, &'static Hand)| {
            std::ptr::eq(other.as_ptr(), Arc::as_ptr(object)) && std::ptr::eq(*its_hand, hand)
        };
        kept.retain(|other| !place(other));
        let last_used = object.shelf.slot(hand).map_or(0, |slot| slot.last_used);
        let room = self.store.room();
        if bytes > room || !make_room(&mut kept, room - bytes, last_used) {
            if object.shelf.slot(hand).is_some_and(|slot| slot.grown.is_some()) {
                kept.push((Arc::downgrade(object), hand));
            }
            return false;
        }
        object.shelf.put(hand, grown, bytes, spent);
        kept.push((Arc::downgrade(object), hand));
        true
    }

    /// Drops atlases until the others fit.
    fn fit(&self, room: usize) {
        make_room(&mut self.kept(), room, u64::MAX);
    }

    fn jobs(&self) -> MutexGuard<'_, VecDeque<Job>> {
        // No code panics while it holds the lock; were it to, the queue would still be whole.
        self.jobs.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn kept(&self) -> MutexGuard<'_, Vec<(Weak<StoredObject>, &'static Hand)>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Drops those that were not used for longest, and before `before`, until the others take no more than `room` bytes.
/// False, and nothing is dropped, if that is not enough.
fn make_room(kept: &mut Vec<(Weak<StoredObject>, &'static Hand)>, room: usize, before: u64) -> bool {
    let mut slots: Vec<(u64, usize, usize)> = kept
        .iter()
        .enumerate()
        .filter_map(|(place, (object, hand))| {
            let slot = object.upgrade()?.shelf.slot(hand)?;
            Some((slot.last_used, slot.bytes, place))
        })
        .collect();
    slots.sort_unstable();
    let mut taken: usize = slots.iter().map(|(_, bytes, _)| bytes).sum();
    let dropped: Vec<usize> = slots
        .into_iter()
        .take_while(|(last_used, bytes, _)| {
            let drops = taken > room && *last_used < before;
            taken -= if drops { *bytes } else { 0 };
            drops
        })
        .map(|(_, _, place)| place)
        .collect();
    if taken > room {
        return false;
    }
    for place in &dropped {
        let (object, hand) = &kept[*place];
        if let Some(object) = object.upgrade() {
            tracing::debug!(object = object.name(), hand = %builder::told(hand), "an atlas gave way");
            object.shelf.drop_grown(hand);
        }
    }
    let mut place = 0;
    kept.retain(|_| {
        place += 1;
        !dropped.contains(&(place - 1))
    });
    true
}
