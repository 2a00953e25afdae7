//! The threads that build atlases, one turn after the other.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use grasp_assets::{
    atlases::shipped_atlas,
    hands::{Hand, hand},
};
use grasp_synthesis::{
    base::stop::Stop,
    known::{
        codec::decode,
        growth::{CHOSEN, Grown, Growth},
    },
    model::hand::Handedness,
    physical::grip::Gripper,
    propose::{mirror::Mirror, prepared::PreparedObject},
};

use super::{
    build_queue::{BuildJob, BuildQueue, Stage},
    files::AtlasFiles,
    hand_label,
};
use crate::{
    atlas_slots::{BuildState, Slot},
    executor::SearchExecutor,
    objects::{
        StoredObject,
        store::{Event, Need, ObjectStore},
    },
};

/// Niceness of a builder thread: 19 is the lowest priority on Linux. A lower value takes more CPU time from searches.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 19;

/// Grips in an atlas that is useful: most givers leave one of them free.
const USEFUL: usize = 224;

/// Longest work on an atlas until it waits for its turn to be completed, useful or not.
const SLICE: Duration = Duration::from_secs(1);

/// Grips in an atlas when it is first published. With fewer, it answers few requests.
const FIRST: usize = 64;

/// During its first slice, an atlas is published again once it grew by one part in this many.
const GROWTH_PER_PUBLISH: usize = 2;

/// Memory that must be free, or held for what is in less demand, before an atlas is grown: that of a complete one.
const EXPECTED_BYTES: usize = 300_000;

/// Pause while searches run, in multiples of the time just worked: with 9, a builder works a tenth of the time.
const PAUSE_PER_WORK: u32 = 9;

/// How often a pausing builder checks whether searches still run.
const PAUSE_CHECK: Duration = Duration::from_millis(1);

/// What the builder threads share.
#[derive(Debug)]
pub(super) struct Builders {
    /// The atlases to build.
    pub queue: BuildQueue,
    /// The objects, in whose cache atlases are.
    pub objects: Arc<ObjectStore>,
    executor: SearchExecutor,
    files: Option<AtlasFiles>,
    default_rig: String,
    /// Number of running threads.
    running: AtomicUsize,
    /// The start of the clock of demands.
    started: Instant,
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
            objects,
            executor,
            files,
            default_rig,
            running: AtomicUsize::new(0),
            started: Instant::now(),
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

    /// An object in the form that searches use, built if necessary. `None` if there is no room for it, or if the server stops. Holding
    /// it does not keep the object from being evicted.
    fn prepared(&self, object: &Arc<StoredObject>) -> Option<Arc<PreparedObject>> {
        let is_stopped = || self.queue.is_stopped();
        let derived = self.objects.derived(object, Need::Ahead, Stop::when(&is_stopped));
        let derived =
            derived.inspect_err(|error| tracing::debug!(object = object.name(), %error, "no atlas grows"));
        Some(Arc::clone(&derived.ok()?.object))
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

    /// A hand of the default rig.
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

/// Counts a thread for as long as it lives.
struct RunningThread<'a>(&'a Builders);

impl Drop for RunningThread<'_> {
    fn drop(&mut self) {
        self.0.running.fetch_sub(1, Ordering::Relaxed);
    }
}

/// How a turn ended.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// The atlas can still grow.
    Next(Stage),
    /// The atlas does not grow.
    Ended(BuildState),
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
            lower_priority();
            while let Some(job) = of_thread.queue.next_to_grow() {
                work(&of_thread, job);
            }
        });
    if thread.is_err() {
        builders.running.fetch_sub(1, Ordering::Relaxed);
    }
    thread.map(|_| ())
}

/// Starts the thread that reads atlases, at the priority of other threads: reading takes a millisecond, and requests wait for
/// what was dropped from memory.
///
/// # Errors
/// The thread cannot be started.
pub(super) fn start_reader(builders: &Arc<Builders>) -> std::io::Result<()> {
    let of_thread = Arc::clone(builders);
    let thread = thread::Builder::new()
        .name("grasp-atlas-read".to_owned())
        .spawn(move || {
            while let Some(job) = of_thread.queue.next_to_read() {
                work(&of_thread, job);
            }
        });
    thread.map(|_| ())
}

/// Lowers the priority of this thread, where the system supports that. Raising it again would need privileges.
fn lower_priority() {
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
        Ok(Turn::Next(stage)) => builders.queue.push(BuildJob { stage, ..job }),
        Ok(Turn::Dropped) => {}
        Ok(Turn::Ended(state)) => object.atlas_slots.end(&hand, state),
        Err(_) => {
            tracing::error!(object = object.name(), hand = %hand_label(&hand), "building an atlas panicked");
            object.atlas_slots.end(&hand, BuildState::Failed);
        }
    }
    // Only these hands' atlases are reported.
    let side = hand.rig.handedness;
    if builders.default_hand(side) != Some(&hand) {
        return;
    }
    let after = Progress::of(&object, &hand);
    let became_useful = after.is_useful && !before.is_useful;
    let became_complete = after.is_complete && !before.is_complete;
    let events = [
        became_useful.then_some(Event::AtlasUseful(side)),
        became_complete.then_some(Event::AtlasComplete(side)),
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

/// Reads an atlas or grows it by a stage, and publishes it.
pub(super) fn turn(builders: &Builders, object: &Arc<StoredObject>, job: &BuildJob) -> Turn {
    // Without a slot, other hands have taken its place.
    let Some(slot) = object.atlas_slots.get(&job.hand) else {
        return Turn::Dropped;
    };
    // What was dropped from memory since its first slice is read again.
    if job.stage == Stage::Completing && slot.grown.is_none() {
        return Turn::Next(Stage::Unread);
    }
    if job.stage == Stage::Unread {
        return read_turn(builders, object, &job.hand);
    }
    if !builders
        .objects
        .has_room_for_atlas(object, &job.hand, EXPECTED_BYTES)
    {
        return Turn::Ended(BuildState::NoRoom);
    }
    let Some(prepared) = builders.prepared(object) else {
        return Turn::Ended(BuildState::NoRoom);
    };
    let plan = Plan::of(&prepared, &job.hand);
    let growth = match &slot.grown {
        Some(grown) => Growth::resume(&prepared, &plan.grows.rig, grown.original()),
        None => Growth::new(&prepared, &plan.grows.rig),
    };
    let growing = Growing {
        builders,
        object,
        prepared: &prepared,
        job,
        plan: &plan,
        growth,
        gripper: Gripper::default(),
        unpublished_work: Duration::ZERO,
    };
    match job.stage {
        Stage::Unread | Stage::Starting => growing.become_useful(),
        Stage::Completing => growing.complete(),
    }
}

/// An atlas that a thread is growing.
struct Growing<'a> {
    builders: &'a Builders,
    object: &'a Arc<StoredObject>,
    prepared: &'a PreparedObject,
    job: &'a BuildJob,
    plan: &'a Plan,
    growth: Growth<'a>,
    gripper: Gripper,
    unpublished_work: Duration,
}

impl Growing<'_> {
    /// Grows until the atlas is useful or has had its slice of work.
    fn become_useful(mut self) -> Turn {
        let mut worked = Duration::ZERO;
        let mut next_publish = FIRST;
        while !self.growth.is_enough() && self.growth.len() < USEFUL && worked < SLICE {
            let Some(took) = self.round() else {
                return Turn::Dropped;
            };
            worked += took;
            let len = self.growth.len();
            if (next_publish..USEFUL).contains(&len) {
                next_publish = len + len / GROWTH_PER_PUBLISH;
                if !self.keep(self.growth.kept()) {
                    return Turn::Ended(BuildState::NoRoom);
                }
            }
        }
        if self.growth.is_enough() {
            return self.complete();
        }
        self.end(self.growth.kept(), Turn::Next(Stage::Completing))
    }

    /// Grows until there is enough to choose from. What is more urgent comes in between, so that no growth is given up.
    fn complete(mut self) -> Turn {
        while !self.growth.is_enough() {
            if self.round().is_none() {
                return Turn::Dropped;
            }
            while let Some(urgent) = self.builders.queue.next_before(self.job) {
                work(self.builders, urgent);
            }
        }
        self.end(self.growth.kept(), Turn::Ended(BuildState::Finished))
    }

    /// Runs a round; the processor time that it took, or none if nobody needs the atlas any more.
    fn round(&mut self) -> Option<Duration> {
        // If this thread holds the last reference, the object was evicted.
        if self.builders.queue.is_stopped() || Arc::strong_count(self.object) == 1 {
            return None;
        }
        let (start, start_of_work) = (Instant::now(), thread_time());
        self.growth.round(&mut self.gripper);
        let worked = thread_time().saturating_sub(start_of_work);
        self.unpublished_work += worked;
        pause_for_searches(self.builders, start.elapsed());
        Some(worked)
    }

    /// Keeps an atlas, after which the turn ends.
    fn end(&mut self, grown: Grown, turn: Turn) -> Turn {
        if self.keep(grown) {
            turn
        } else {
            Turn::Ended(BuildState::NoRoom)
        }
    }

    /// Writes and publishes an atlas. False if there is no room.
    fn keep(&mut self, grown: Grown) -> bool {
        if let Some(files) = &self.builders.files {
            files.write(self.object, self.prepared, &self.plan.grows, &grown);
        }
        let grown = self.plan.placed(grown, self.prepared, &self.job.hand);
        let (object, hand) = (self.object, &self.job.hand);
        let before = object.atlas_slots.get(hand).unwrap_or_default();
        let work = std::mem::take(&mut self.unpublished_work);
        let has_room = self.builders.publish(object, hand, Arc::new(grown), work);
        if has_room {
            log_progress(object, hand, &before);
        } else {
            tracing::debug!(object = object.name(), hand = %hand_label(hand), "no room for an atlas in cache_bytes");
        }
        has_room
    }
}

/// Processor time of this thread.
#[cfg(target_os = "linux")]
fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(time).unwrap_or_default()
}

/// Wall time, on systems without a clock per thread.
#[cfg(not(target_os = "linux"))]
fn thread_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}

/// While searches run, pauses in proportion to the time just worked.
fn pause_for_searches(builders: &Builders, worked: Duration) {
    let until = Instant::now() + worked * PAUSE_PER_WORK;
    while builders.executor.jobs() > 0 && !builders.queue.is_stopped() && Instant::now() < until {
        thread::sleep(PAUSE_CHECK);
    }
}

/// Logs when an atlas becomes useful and when it is complete.
fn log_progress(object: &StoredObject, hand: &Arc<Hand>, before: &Slot) {
    let slot = object.atlas_slots.get(hand).unwrap_or_default();
    let Some(grown) = &slot.grown else { return };
    let entries = grown.atlas.entries().len();
    let before = before
        .grown
        .as_ref()
        .map_or(0, |grown| grown.atlas.entries().len());
    let message = if grown.atlas.is_complete() {
        "an atlas is complete"
    } else if before < USEFUL && entries >= USEFUL {
        "an atlas is useful"
    } else {
        return;
    };
    tracing::info!(
        object = object.name(),
        hand = %hand_label(hand),
        entries,
        bytes = slot.bytes(),
        seconds = slot.build_time.as_secs_f32(),
        "{message}"
    );
}

/// The hand whose growth is an atlas, or becomes one as its mirror image.
///
/// On a symmetric object, what one hand can do, the other can. The left hand's grips are therefore the mirror images of the right
/// hand's: mirrored holdouts have mirrored answers, and both hands share a file.
#[derive(Debug)]
pub(super) struct Plan {
    /// The hand that grows.
    pub(super) grows: Arc<Hand>,
    mirror: Option<Mirror>,
}

impl Plan {
    /// The plan for a hand's atlas of an object.
    pub(super) fn of(object: &PreparedObject, of: &Arc<Hand>) -> Self {
        let right = right_of(of);
        let mirror = right.and_then(|_| Mirror::of_symmetric(object));
        Self {
            grows: Arc::clone(right.filter(|_| mirror.is_some()).unwrap_or(of)),
            mirror,
        }
    }

    /// What has grown as an atlas of the hand.
    pub(super) fn placed(&self, grown: Grown, object: &PreparedObject, of: &Hand) -> Grown {
        match self.mirror {
            Some(mirror) => grown.mirrored(mirror, object.object(), &of.rig),
            None => grown,
        }
    }
}

/// The right hand of which a left one is the mirror image, if both are built in.
fn right_of(left: &Hand) -> Option<&'static Arc<Hand>> {
    let right = hand(&left.rig.name, Handedness::Right)?;
    let is_image = left.rig.handedness == Handedness::Left && right.rig.mirrored() == *left.rig;
    is_image.then_some(right)
}

/// Publishes the atlas on disk or the shipped grips, if there are any.
pub(super) fn read_turn(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Turn {
    let start = thread_time();
    let on_disk = || read_file(builders, object, hand);
    let Some(read) = shipped_grips(builders, object, hand)
        .or_else(on_disk)
        .map(Arc::new)
    else {
        return Turn::Next(Stage::Starting);
    };
    let entries = read.atlas.entries().len();
    let complete = read.atlas.is_complete();
    if !builders.publish(object, hand, read, thread_time().saturating_sub(start)) {
        return Turn::Ended(BuildState::NoRoom);
    }
    tracing::info!(object = object.name(), hand = %hand_label(hand), entries, complete, "read an atlas");
    if complete {
        Turn::Ended(BuildState::Finished)
    } else if entries >= USEFUL {
        Turn::Next(Stage::Completing)
    } else {
        Turn::Next(Stage::Starting)
    }
}

/// The atlas on disk. If another server has grown more than is kept, the file is replaced by an excerpt.
fn read_file(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Option<Grown> {
    let files = builders.files.as_ref()?;
    if !files.may_have(object, hand) {
        return None;
    }
    let prepared = builders.prepared(object)?;
    let plan = Plan::of(&prepared, hand);
    let read = files.read(object, &prepared, &plan.grows)?;
    if !read.atlas.is_complete() || read.atlas.entries().len() <= CHOSEN {
        return Some(plan.placed(read, &prepared, hand));
    }
    let kept = Growth::resume(&prepared, &plan.grows.rig, &read).kept();
    files.write(object, &prepared, &plan.grows, &kept);
    Some(plan.placed(kept, &prepared, hand))
}

/// The grips that ship with the server for an object and a hand: chosen from more than a server grows, hence complete.
fn shipped_grips(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Option<Grown> {
    if !object.built_in {
        return None;
    }
    let prepared = builders.prepared(object)?;
    let bytes = shipped_atlas(&object.id, &hand.rig)?;
    match decode(bytes, &prepared, &hand.rig) {
        Ok(grown) => Some(grown.completed()),
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
