//! The threads that build atlases, one turn after the other.

use std::{
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use grasp_assets::{
    atlases::shipped_atlas,
    hands::{Hand, hand},
};
use grasp_synthesis::{
    known::{
        codec::decode,
        growth::{Grown, Growth},
    },
    model::hand::Handedness,
    physical::grip::Gripper,
};

use super::{
    build_queue::{BuildJob, BuildQueue},
    files::AtlasFiles,
    hand_label,
    loaded::LoadedAtlases,
    remembered::RememberedGrips,
};
use crate::{
    atlas_slots::{BuildState, Update},
    executor::SearchExecutor,
    objects::{StoredObject, changes::Event, store::ObjectStore},
};

/// Niceness of a builder thread: 19 is the lowest priority on Linux. A lower value takes more CPU time from searches.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 19;

/// Grips in an atlas when it is first published: enough for most holdouts, which leave one grip in a hundred free. With
/// fewer, an atlas is published sooner and answers fewer requests.
const USEFUL: usize = 100;

/// An atlas is published again once it grew by one part in this many. Publishing sorts and copies all of it.
const GROWTH_PER_PUBLISH: usize = 4;

/// Longest work on one atlas before the next in the queue has its turn. Longer turns delay new atlases; shorter ones
/// spend more time on resuming.
const TURN: Duration = Duration::from_secs(2);

/// Pause while searches run, in multiples of the time just worked: with 9, a builder works a tenth of the time.
const PAUSE_PER_WORK: u32 = 9;

/// Work that reading an atlas counts as. It is not zero, so that builders read all new atlases before they grow any.
const READ_WORK: Duration = Duration::from_millis(1);

/// How often a pausing builder checks whether searches still run.
const PAUSE_CHECK: Duration = Duration::from_millis(1);

/// What the builder threads share.
#[derive(Debug)]
pub(super) struct Builders {
    /// The atlases to build.
    pub queue: BuildQueue,
    /// The atlases in memory.
    pub loaded: LoadedAtlases,
    /// Grips that searches found.
    pub remembered: RememberedGrips,
    objects: Arc<ObjectStore>,
    executor: SearchExecutor,
    files: Option<AtlasFiles>,
    default_rig: String,
    /// Number of running threads.
    running: AtomicUsize,
    /// Requests for any atlas so far: the clock of [`Slot::last_used`](crate::atlas_slots::Slot::last_used).
    requests: AtomicU64,
}

impl Builders {
    /// Builders without threads.
    pub(super) fn new(
        objects: Arc<ObjectStore>,
        executor: SearchExecutor,
        files: Option<AtlasFiles>,
        default_rig: String,
    ) -> Self {
        Self {
            queue: BuildQueue::default(),
            loaded: LoadedAtlases::new(Arc::clone(&objects)),
            objects,
            remembered: RememberedGrips::default(),
            executor,
            files,
            default_rig,
            running: AtomicUsize::new(0),
            requests: AtomicU64::new(0),
        }
    }

    /// Number of running threads.
    pub(super) fn running(&self) -> usize {
        self.running.load(Ordering::Relaxed)
    }

    /// True if there are threads and they were not stopped.
    pub(super) fn are_running(&self) -> bool {
        !self.queue.is_stopped() && self.running() > 0
    }

    /// A hand of the default rig.
    pub(super) fn default_hand(&self, handedness: Handedness) -> Option<&'static Arc<Hand>> {
        hand(&self.default_rig, handedness)
    }

    /// Records a use of the atlases of one or two hands at the same time, so that neither evicts the other, and puts those that
    /// are absent in the queue.
    pub(super) fn request(&self, object: &Arc<StoredObject>, hands: [Option<&Arc<Hand>>; 2]) {
        let now = self.requests.fetch_add(1, Ordering::Relaxed) + 1;
        let hands = hands.into_iter().flatten();
        for hand in hands.filter(|hand| object.atlas_slots.request(hand, now)) {
            self.queue.push(BuildJob {
                object: Arc::downgrade(object),
                hand: Arc::clone(hand),
                worked: Duration::ZERO,
            });
        }
    }
}

/// Counts a thread for as long as it lives.
struct RunningThread<'a>(&'a Builders);

impl Drop for RunningThread<'_> {
    fn drop(&mut self) {
        self.0.running.fetch_sub(1, Ordering::Relaxed);
    }
}

/// How a turn ended.
pub(super) enum Turn {
    /// Grips were read that requests can use, and the atlas can still grow.
    Read,
    /// The atlas can still grow; with the work done in this turn.
    More(Duration),
    /// The atlas is complete or has no room to grow.
    Finished,
    /// The object or the hand's slot was evicted, or the server stops.
    Dropped,
}

/// Starts a builder thread.
///
/// # Errors
/// The thread cannot be started.
pub(super) fn start_thread(number: usize, builders: &Arc<Builders>) -> std::io::Result<()> {
    // Counted before the thread runs: requests that follow must find it.
    builders.running.fetch_add(1, Ordering::Relaxed);
    let of_thread = Arc::clone(builders);
    let thread = thread::Builder::new()
        .name(format!("grasp-atlas-{number}"))
        .spawn(move || {
            let _running = RunningThread(&of_thread);
            while let Some(job) = of_thread.queue.next() {
                work(&of_thread, job);
            }
        });
    if thread.is_err() {
        builders.running.fetch_sub(1, Ordering::Relaxed);
    }
    thread.map(|_| ())
}

/// Lowers the priority of this thread, where the system supports that. Raising it again would need privileges.
fn lower_priority() {
    thread_local! {
        static IS_LOWERED: Cell<bool> = const { Cell::new(false) };
    }
    if IS_LOWERED.replace(true) {
        return;
    }
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICENESS) {
        tracing::warn!(%error, "atlases are built at the priority of searches");
    }
}

/// Gives a job its turn and puts it back in the queue if the atlas can still grow.
fn work(builders: &Builders, job: BuildJob) {
    let Some(object) = job.object.upgrade() else {
        return;
    };
    let hand = Arc::clone(&job.hand);
    let before = Progress::of(&object, &hand);
    // A panic costs only this atlas: the state that it could leave inconsistent is local to the turn.
    let turn = catch_unwind(AssertUnwindSafe(|| turn(builders, &object, &job)));
    match turn {
        Ok(Turn::Read) => builders.queue.push(BuildJob {
            worked: job.worked + READ_WORK,
            ..job
        }),
        Ok(Turn::More(worked)) => builders.queue.push(BuildJob {
            worked: job.worked + worked,
            ..job
        }),
        Ok(Turn::Dropped) => {}
        Ok(Turn::Finished) => object.atlas_slots.finish(&job.hand),
        Err(_) => {
            tracing::error!(object = object.name(), hand = %hand_label(&job.hand), "building an atlas panicked");
            object.atlas_slots.finish(&job.hand);
        }
    }
    // Only these hands' atlases are part of an object's state.
    let is_default = |side| builders.default_hand(side) == Some(&hand);
    let (useful, complete) = if is_default(Handedness::Right) {
        (Some(Event::AtlasUseful), Event::AtlasComplete)
    } else if is_default(Handedness::Left) {
        (None, Event::LeftAtlasComplete)
    } else {
        return;
    };
    let after = Progress::of(&object, &hand);
    let became_useful = after.is_useful && !before.is_useful;
    let became_complete = after.is_complete && !before.is_complete;
    let events = [
        useful.filter(|_| became_useful),
        became_complete.then_some(complete),
    ];
    for event in events.into_iter().flatten() {
        builders.objects.tell_of_atlas(&object, event);
    }
}

/// What is reported of an atlas.
struct Progress {
    is_useful: bool,
    is_complete: bool,
}

impl Progress {
    fn of(object: &StoredObject, hand: &Arc<Hand>) -> Self {
        let slot = object.atlas_slots.get(hand).unwrap_or_default();
        let entries = slot.grown.map_or(0, |grown| grown.atlas.entries().len());
        Self {
            is_useful: entries >= USEFUL,
            is_complete: slot.state == BuildState::Finished,
        }
    }
}

/// Reads an atlas or grows it, and publishes it.
pub(super) fn turn(builders: &Builders, object: &Arc<StoredObject>, job: &BuildJob) -> Turn {
    let start = Instant::now();
    let hand = &job.hand;
    // Without a slot, other hands have taken its place.
    let Some(slot) = object.atlas_slots.get(hand) else {
        return Turn::Dropped;
    };
    if slot.grown.is_none()
        && let Some(read) = read(builders, object, hand)
    {
        let is_complete = read.grown.atlas.is_complete();
        let has_room = builders.loaded.publish(object, hand, read, start.elapsed());
        return if is_complete || !has_room {
            Turn::Finished
        } else {
            Turn::Read
        };
    }
    let shipped = slot.grown.filter(|grown| is_shipped(grown));
    let mut growth = match &slot.growing {
        Some(growing) => Growth::resume(&object.object, &hand.rig, growing),
        None => Growth::new(&object.object, &hand.rig),
    };
    let published = growth.len();
    if growth.is_complete() {
        return Turn::Finished;
    }
    // Not before reading: shipped grips must be there soon after the start, however busy the machine is.
    lower_priority();
    let enough = USEFUL.max(published + published / GROWTH_PER_PUBLISH);
    let mut gripper = Gripper::default();
    let mut worked = Duration::ZERO;
    while !growth.is_complete() && growth.len() < enough && worked < TURN {
        // If this thread holds the last reference, the object was evicted.
        if builders.queue.is_stopped() || Arc::strong_count(object) == 1 {
            return Turn::Dropped;
        }
        let round = Instant::now();
        growth.round(&mut gripper);
        let took = round.elapsed();
        worked += took;
        pause_for_searches(builders, took);
        // A new atlas goes before one that already had a turn.
        if !job.worked.is_zero() && builders.queue.has_new_job() {
            break;
        }
    }
    let grown = Arc::new(growth.grown());
    if let Some(files) = &builders.files
        && (growth.len() > published || growth.is_complete())
    {
        files.write(object, hand, &grown);
    }
    let update = match shipped {
        Some(shipped) if !grown.atlas.is_complete() => Update {
            grown: shipped,
            growing: Some(Arc::clone(&grown)),
        },
        _ => Update::of(Arc::clone(&grown)),
    };
    let is_used = Arc::ptr_eq(&update.grown, &grown);
    let has_room = builders.loaded.publish(object, hand, update, worked);
    if has_room && is_used {
        log_progress(object, hand, &grown, published);
    } else if has_room {
        tracing::debug!(
            object = object.name(),
            hand = %hand_label(hand),
            entries = growth.len(),
            "an atlas grows while shipped grips answer"
        );
    } else {
        tracing::debug!(
            object = object.name(),
            hand = %hand_label(hand),
            entries = published,
            "an atlas cannot grow: cache_bytes has no room"
        );
    }
    if growth.is_complete() || !has_room {
        Turn::Finished
    } else {
        Turn::More(worked)
    }
}

/// The atlas on disk. Unless it is complete, shipped grips answer requests and growth resumes from it.
fn read(builders: &Builders, object: &StoredObject, hand: &Arc<Hand>) -> Option<Update> {
    let on_disk = builders.files.as_ref().and_then(|files| files.read(object, hand));
    let on_disk = on_disk.map(Arc::new);
    let is_complete = on_disk.as_ref().is_some_and(|read| read.atlas.is_complete());
    let shipped = if is_complete {
        None
    } else {
        shipped_grips(object, hand)
    };
    let read = match (shipped, on_disk) {
        (Some(shipped), growing) => Update {
            grown: Arc::new(shipped),
            growing,
        },
        (None, Some(on_disk)) => Update::of(on_disk),
        (None, None) => return None,
    };
    tracing::info!(
        object = object.name(),
        hand = %hand_label(hand),
        entries = read.grown.atlas.entries().len(),
        complete = read.grown.atlas.is_complete(),
        "read an atlas"
    );
    Some(read)
}

/// True for shipped grips: no proposals were tried for them, and no atlas can grow from them.
fn is_shipped(grown: &Grown) -> bool {
    grown.proposed() == 0
}

/// The grips that ship with the server for an object and a hand.
fn shipped_grips(object: &StoredObject, hand: &Arc<Hand>) -> Option<Grown> {
    let bytes = object
        .built_in
        .then(|| shipped_atlas(&object.id, &hand.rig))
        .flatten()?;
    match decode(bytes, &object.object, &hand.rig) {
        Ok(grown) => Some(grown),
        Err(error) => {
            tracing::warn!(
                object = object.name(),
                hand = %hand_label(hand),
                %error,
                "cannot read the shipped grips"
            );
            None
        }
    }
}

/// While searches run, pauses in proportion to the time just worked.
fn pause_for_searches(builders: &Builders, worked: Duration) {
    let until = Instant::now() + worked * PAUSE_PER_WORK;
    while builders.executor.jobs() > 0 && !builders.queue.is_stopped() && Instant::now() < until {
        thread::sleep(PAUSE_CHECK);
    }
}

/// Logs when an atlas becomes useful and when it is complete.
fn log_progress(object: &StoredObject, hand: &Arc<Hand>, grown: &Grown, published: usize) {
    let entries = grown.atlas.entries().len();
    let message = if grown.atlas.is_complete() {
        "an atlas is complete"
    } else if published < USEFUL && entries >= USEFUL {
        "an atlas is useful"
    } else {
        return;
    };
    let slot = object.atlas_slots.get(hand).unwrap_or_default();
    tracing::info!(
        object = object.name(),
        hand = %hand_label(hand),
        entries,
        bytes = slot.bytes,
        seconds = slot.build_time.as_secs_f32(),
        "{message}"
    );
}
