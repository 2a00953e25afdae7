//! A builder's turn: reads an atlas or grows it by a stage.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
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
        growth::{CHOSEN, Grown, Growth},
    },
    model::hand::Handedness,
    physical::grip::Gripper,
    propose::{both_hands::Mirror, prepared::PreparedObject},
};

use super::{
    builders::{BuildJob, Builders, Stage},
    hand_label,
};
use crate::{
    atlas_slots::{BuildState, Slot},
    objects::{StoredObject, store::Event},
};

/// Grips in an atlas that is useful: most givers leave one of them free.
const USEFUL: usize = 224;

/// Longest work on an atlas until it waits for its turn to be completed, useful or not.
const SLICE: Duration = Duration::from_secs(1);

/// Grips in an atlas when it is first published. With fewer, it answers few requests.
const FIRST: usize = 64;

/// During its first slice, an atlas is published again once it grew by one part in this many.
const GROWTH_PER_PUBLISH: usize = 2;

/// Memory that must be free, or held by atlases in less demand, before an atlas is grown: that of a complete one.
const EXPECTED_BYTES: usize = 300_000;

/// Pause while searches run, in multiples of the time just worked: with 9, a builder works a tenth of the time.
const PAUSE_PER_WORK: u32 = 9;

/// How often a pausing builder checks whether searches still run.
const PAUSE_CHECK: Duration = Duration::from_millis(1);

/// How a turn ended.
#[derive(Debug, PartialEq, Eq)]
enum Turn {
    /// The atlas can still grow.
    Next(Stage),
    /// The atlas does not grow.
    Ended(BuildState),
    /// The object or the hand's slot was evicted, or the server stops.
    Dropped,
}

/// Gives a job its turn and puts it back in the queue if the atlas can still grow.
pub(super) fn work(builders: &Builders, job: BuildJob) {
    let Some(object) = job.object.upgrade() else {
        return;
    };
    let hand = Arc::clone(&job.hand);
    let before = object.atlas_slots.get(&hand).unwrap_or_default();
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
    let after = object.atlas_slots.get(&hand).unwrap_or_default();
    let became = |is: fn(&Slot) -> bool| is(&after) && !is(&before);
    let objects = &builders.objects;
    if became(|slot| slot.entries() >= USEFUL) {
        objects.tell_of_atlas(&object, Event::AtlasUseful(side));
    }
    if became(|slot| slot.state == BuildState::Finished) {
        objects.tell_of_atlas(&object, Event::AtlasComplete(side));
    }
}

/// Reads an atlas or grows it by a stage, and publishes it.
fn turn(builders: &Builders, object: &Arc<StoredObject>, job: &BuildJob) -> Turn {
    // Without a slot, other hands have taken its place.
    let Some(slot) = object.atlas_slots.get(&job.hand) else {
        return Turn::Dropped;
    };
    // An atlas that was dropped from memory since its first slice is read again.
    if job.stage == Stage::Completing && slot.grown.is_none() {
        return Turn::Next(Stage::Unread);
    }
    if job.stage == Stage::Unread {
        return read_turn(builders, object, &job.hand);
    }
    let objects = &builders.objects;
    let has_room = objects.has_room_for_atlas(object, &job.hand, EXPECTED_BYTES);
    let prepared = has_room.then(|| builders.prepared(object)).flatten();
    let Some(prepared) = prepared else {
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
                if !self.keep() {
                    return Turn::Ended(BuildState::NoRoom);
                }
            }
        }
        if self.growth.is_enough() {
            return self.complete();
        }
        self.end(Turn::Next(Stage::Completing))
    }

    /// Grows until there is enough to choose from. More urgent jobs come in between, so that no growth is given up.
    fn complete(mut self) -> Turn {
        while !self.growth.is_enough() {
            if self.round().is_none() {
                return Turn::Dropped;
            }
            while let Some(urgent) = self.builders.queue.next_before(self.job) {
                work(self.builders, urgent);
            }
        }
        self.end(Turn::Ended(BuildState::Finished))
    }

    /// Runs a round, and returns its processor time; `None` if nobody needs the atlas.
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

    /// Keeps the grown grips and ends the turn.
    fn end(&mut self, turn: Turn) -> Turn {
        if self.keep() {
            turn
        } else {
            Turn::Ended(BuildState::NoRoom)
        }
    }

    /// Writes and publishes an atlas. False if there is no room.
    fn keep(&mut self) -> bool {
        let grown = self.growth.kept();
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
    while builders.executor.places.taken() > 0 && !builders.queue.is_stopped() && Instant::now() < until {
        thread::sleep(PAUSE_CHECK);
    }
}

/// Logs when an atlas becomes useful and when it is complete.
fn log_progress(object: &StoredObject, hand: &Arc<Hand>, before: &Slot) {
    let slot = object.atlas_slots.get(hand).unwrap_or_default();
    let entries = slot.entries();
    let message = if slot.grown.as_ref().is_some_and(|grown| grown.atlas.is_complete()) {
        "an atlas is complete"
    } else if before.entries() < USEFUL && entries >= USEFUL {
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

/// The hand whose growth is an atlas or, for the left hand on a symmetric object, becomes one as its mirror image.
#[derive(Debug)]
struct Plan {
    grows: Arc<Hand>,
    mirror: Option<Mirror>,
}

impl Plan {
    /// The plan for a hand's atlas of an object.
    fn of(object: &PreparedObject, of: &Arc<Hand>) -> Self {
        let right = right_of(of);
        let mirror = right.and_then(|_| Mirror::of_symmetric(object));
        Self {
            grows: Arc::clone(right.filter(|_| mirror.is_some()).unwrap_or(of)),
            mirror,
        }
    }

    /// The grown grips as an atlas of the hand.
    fn placed(&self, grown: Grown, object: &PreparedObject, of: &Hand) -> Grown {
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
fn read_turn(builders: &Builders, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> Turn {
    let start = thread_time();
    let read = shipped_grips(builders, object, hand).or_else(|| read_file(builders, object, hand));
    let Some(read) = read.map(Arc::new) else {
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
            tracing::warn!(object = object.name(), hand = %hand_label(hand), %error, "cannot read the shipped grips");
            None
        }
    }
}
