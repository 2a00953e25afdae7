//! The threads that let atlases grow, one turn after the other.

use std::{
    cell::Cell,
    fmt,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, atomic::Ordering},
    thread,
    time::{Duration, Instant},
};

use grasp_assets::{atlases::atlas, hands::Hand};
use grasp_synthesis::{
    known::{
        codec::decode,
        growth::{Grown, Growth},
    },
    model::hand::Handedness,
    physical::grip::Gripper,
};

use super::{Job, Workshop};
use crate::objects::StoredObject;

/// How nice a builder is to other threads: 19 is as nice as Linux knows. Less takes more of a busy machine from searches.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 19;

/// Grips from which on an atlas is of use: most holdouts leave one of a hundred. Fewer are there sooner, and miss more.
const USEFUL: usize = 100;

/// By how much an atlas must have grown to be published again: a quarter. Less is more often, and each time sorts and
/// copies all of it.
const GROWN_BY: usize = 4;

/// How long an atlas is worked on before it is another one's turn. Longer keeps others waiting; shorter is spent on
/// taking up where it was left.
const TURN: Duration = Duration::from_secs(2);

/// While searches run, how long a builder waits for the time that it worked: nine times, so that it has a tenth.
const WAITS_PER_WORK: u32 = 9;

/// How often it looks whether searches still run.
const LOOKS_EVERY: Duration = Duration::from_millis(1);

/// Counts a builder for as long as it lives.
struct Present<'a>(&'a Workshop);

impl Drop for Present<'_> {
    fn drop(&mut self) {
        self.0.builders.fetch_sub(1, Ordering::Relaxed);
    }
}

/// How a turn ended.
enum Turn {
    /// There is more to be found, after so much work.
    More(Duration),
    /// All was found that there is room for.
    Finished,
    /// The object is gone, or the server ends.
    Dropped,
}

/// Starts a builder.
///
/// # Errors
/// The thread cannot be started.
pub(super) fn start(number: usize, workshop: &Arc<Workshop>) -> std::io::Result<()> {
    // Before the thread runs: whoever asks from now on finds it there.
    workshop.builders.fetch_add(1, Ordering::Relaxed);
    let of_thread = Arc::clone(workshop);
    let thread = thread::Builder::new()
        .name(format!("grasp-atlas-{number}"))
        .spawn(move || {
            let _present = Present(&of_thread);
            while let Some(job) = of_thread.next_job() {
                work(&of_thread, job);
            }
        });
    if thread.is_err() {
        workshop.builders.fetch_sub(1, Ordering::Relaxed);
    }
    thread.map(|_| ())
}

/// Lowers the priority of this thread alone, where the system has such a thing. For good: that needs no rights, and the
/// way back does.
fn be_nice() {
    thread_local! {
        static IS_NICE: Cell<bool> = const { Cell::new(false) };
    }
    if IS_NICE.replace(true) {
        return;
    }
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICENESS) {
        tracing::warn!(%error, "atlases are built at the priority of searches");
    }
}

/// Gives an atlas its turn.
fn work(workshop: &Workshop, job: Job) {
    let Some(object) = job.object.upgrade() else {
        return;
    };
    // A panic costs this atlas alone: all that it could leave half done is local to the turn.
    let turn = catch_unwind(AssertUnwindSafe(|| turn(workshop, &object, &job)));
    match turn {
        Ok(Turn::More(worked)) => workshop.enqueue(Job {
            worked: job.worked + worked,
            ..job
        }),
        Ok(Turn::Dropped) => {}
        Ok(Turn::Finished) => {
            object.shelf.finish(job.hand);
            let first = workshop.default_hand(Handedness::Right);
            if first.is_some_and(|first| std::ptr::eq(first, job.hand)) {
                workshop.ask(&object, workshop.default_hand(Handedness::Left));
            }
        }
        Err(_) => {
            tracing::error!(object = object.name(), hand = %told(job.hand), "building an atlas panicked");
            object.shelf.finish(job.hand);
        }
    }
}

/// Lets an atlas grow until it is published.
fn turn(workshop: &Workshop, object: &Arc<StoredObject>, job: &Job) -> Turn {
    let start = Instant::now();
    let hand = job.hand;
    let known = object.shelf.slot(hand).and_then(|slot| slot.grown);
    let known = match known {
        Some(known) => Some(known),
        None => match read(workshop, object, hand) {
            Some(read) if !workshop.publish(object, hand, Arc::clone(&read), start.elapsed()) => {
                return Turn::Finished;
            }
            read => read,
        },
    };
    let mut growth = match &known {
        Some(known) => Growth::resume(&object.object, &hand.rig, known),
        None => Growth::new(&object.object, &hand.rig),
    };
    let published = growth.len();
    if growth.is_complete() {
        return Turn::Finished;
    }
    // Not before: what comes with the server is there a moment after its start, however busy that is.
    be_nice();
    let enough = USEFUL.max(published + published / GROWN_BY);
    let mut gripper = Gripper::default();
    let mut worked = Duration::ZERO;
    while !growth.is_complete() && growth.len() < enough && worked < TURN {
        // Nobody else keeps an object that was evicted.
        if workshop.is_stopped() || Arc::strong_count(object) == 1 {
            return Turn::Dropped;
        }
        let round = Instant::now();
        growth.round(&mut gripper);
        let took = round.elapsed();
        worked += took;
        give_way(workshop, took);
        // What has had a turn makes room for what has not.
        if !job.worked.is_zero() && workshop.has_new_job() {
            break;
        }
    }
    let grown = Arc::new(growth.grown());
    if let Some(files) = &workshop.files
        && growth.len() > published
    {
        files.write(object, hand, &grown);
    }
    let has_room = workshop.publish(object, hand, Arc::clone(&grown), worked);
    if has_room {
        tell(object, hand, &grown, published);
    } else {
        tracing::debug!(
            object = object.name(),
            hand = %told(hand),
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

/// What comes with the server for an object and a hand, or else what is on disk.
fn read(workshop: &Workshop, object: &StoredObject, hand: &'static Hand) -> Option<Arc<Grown>> {
    let on_disk = || workshop.files.as_ref()?.read(object, hand);
    let read = Arc::new(shipped(object, hand).or_else(on_disk)?);
    tracing::info!(
        object = object.name(),
        hand = %told(hand),
        entries = read.atlas.entries().len(),
        complete = read.atlas.is_complete(),
        "read an atlas"
    );
    Some(read)
}

/// What comes with the server for an object and a hand.
fn shipped(object: &StoredObject, hand: &'static Hand) -> Option<Grown> {
    let bytes = object.built_in.then(|| atlas(&object.id, &hand.rig)).flatten()?;
    match decode(bytes, &object.object, &hand.rig) {
        Ok(grown) => Some(grown),
        Err(error) => {
            tracing::warn!(object = object.name(), hand = %told(hand), %error, "a built-in atlas is built again");
            None
        }
    }
}

/// While searches run, waits in proportion to the time that was just worked.
fn give_way(workshop: &Workshop, worked: Duration) {
    let until = Instant::now() + worked * WAITS_PER_WORK;
    while workshop.executor.jobs() > 0 && !workshop.is_stopped() && Instant::now() < until {
        thread::sleep(LOOKS_EVERY);
    }
}

/// Tells in the log when an atlas begins to be of use and when it is complete.
fn tell(object: &StoredObject, hand: &'static Hand, grown: &Grown, published: usize) {
    let entries = grown.atlas.entries().len();
    let what = if grown.atlas.is_complete() {
        "an atlas is complete"
    } else if published < USEFUL && entries >= USEFUL {
        "an atlas is of use"
    } else {
        return;
    };
    let slot = object.shelf.slot(hand).unwrap_or_default();
    tracing::info!(
        object = object.name(),
        hand = %told(hand),
        entries,
        bytes = slot.bytes,
        seconds = slot.build_time.as_secs_f32(),
        "{what}"
    );
}

/// A hand in the log.
pub(super) fn told(hand: &'static Hand) -> impl fmt::Display {
    let side = match hand.rig.handedness {
        Handedness::Left => "left",
        Handedness::Right => "right",
    };
    format!("{} {side}", hand.rig.name)
}
