//! Atlases: grips of the server's objects, found in the background.
//!
//! Every object has [`atlas slots`](crate::atlas_slots), one per requested hand. A registered object gets an atlas for each
//! hand of the default rig; other hands get theirs once a request names them. The [`builders`] take atlases from the
//! [`queue`](builders::BuildQueue), read them on a thread of its own, and grow them on low-priority threads, at a tenth of the
//! time while searches run. Atlases in most [`demand`](crate::atlas_slots::Demand) come first: each has a slice of work until it is
//! useful, then its turn to be completed. [`files`] keeps them on disk if there is a folder. Grips of searches are learned.
//!
//! For the built-in objects, a few hundred grips per hand ship with the server, and nothing grows.
//!
//! Atlases take what created objects leave of `cache_bytes`: those in least demand are dropped, and built or read again
//! when they are requested.

mod builders;
pub(crate) mod files;
mod growing;
#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, sync::Arc, time::Instant};

use grasp_assets::hands::Hand;
use grasp_proto::v1;
use grasp_synthesis::{
    known::{atlas::Atlas, entry::Entry},
    model::hand::Handedness,
};

use self::{
    builders::{BuildQueue, Builders, start_thread},
    files::AtlasFiles,
};
use crate::{
    answer::wire_atlas,
    atlas_slots::{BuildState, Slot},
    executor::SearchExecutor,
    objects::{StoredObject, store::ObjectStore},
};

/// All atlases and the threads that build them. Dropping it stops the threads.
#[derive(Debug)]
pub(crate) struct Atlases(Arc<Builders>);

/// The known grips of an object and a hand.
#[derive(Clone, Debug, Default)]
pub(crate) struct KnownGrips {
    /// The atlas, unless it is still empty.
    pub atlas: Option<Arc<Atlas>>,
    /// Grips that searches found and that the atlas lacks.
    pub learned: Arc<Atlas>,
}

impl KnownGrips {
    /// True if there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.atlas.is_none() && self.learned.is_empty()
    }
}

impl Atlases {
    /// Starts `threads` builders for the objects of a store, which slow down while `executor` searches. With 0 threads
    /// there are no atlases.
    pub(crate) fn start(
        threads: usize,
        objects: &Arc<ObjectStore>,
        executor: SearchExecutor,
        files: Option<AtlasFiles>,
        default_rig: String,
    ) -> std::io::Result<Self> {
        let builders = Arc::new(Builders {
            queue: BuildQueue::default(),
            objects: Arc::clone(objects),
            executor,
            files,
            default_rig,
            threads,
            started: Instant::now(),
        });
        let atlases = Self(Arc::clone(&builders));
        for number in 0..threads {
            start_thread(&builders, format!("grasp-atlas-{number}"), true)?;
        }
        if threads > 0 {
            start_thread(&builders, "grasp-atlas-read".to_owned(), false)?;
        }
        for object in objects.pinned() {
            atlases.register(object);
        }
        Ok(atlases)
    }

    /// Requests the atlases of a new or changed object and the default rig's hands.
    pub(crate) fn register(&self, object: &Arc<StoredObject>) {
        if self.0.are_running() {
            let hands = [Handedness::Right, Handedness::Left].map(|side| self.0.default_hand(side));
            self.0.request(object, hands);
        }
    }

    /// The known grips of an object and one or two hands; requests the atlases that are absent.
    pub(crate) fn get(&self, object: &Arc<StoredObject>, hands: [Option<&Arc<Hand>>; 2]) -> [KnownGrips; 2] {
        if !self.0.are_running() {
            return Default::default();
        }
        self.0.request(object, hands);
        hands.map(|hand| {
            let slot = hand.and_then(|hand| object.atlas_slots.get(hand));
            let slot = slot.unwrap_or_default();
            let grown = slot.grown.filter(|grown| !grown.atlas.entries().is_empty());
            KnownGrips {
                atlas: grown.map(|grown| Arc::clone(&grown.atlas)),
                learned: slot.learned,
            }
        })
    }

    /// Learns a grip that a search found under the object's own friction, up to `most` per object and hand, for later requests.
    pub(crate) fn learn(&self, object: &Arc<StoredObject>, hand: &Arc<Hand>, grip: Entry, most: usize) {
        if self.0.are_running() && most > 0 {
            self.0.objects.change_atlas(object, hand, |slot| {
                slot.learned = Arc::new(slot.learned.with(&hand.rig, grip, most));
            });
        }
    }

    /// The state of an object's atlas for a hand of the default rig. That of an object at rest is empty; without atlases, its growth is
    /// not known.
    pub(crate) fn state(&self, id: &str, object: Option<&StoredObject>, handedness: Handedness) -> v1::Atlas {
        let hand = self.0.default_hand(handedness).filter(|_| self.0.are_running());
        let Some(hand) = hand else {
            return wire_atlas(id, handedness, None, None);
        };
        let slot = object.and_then(|object| object.atlas_slots.get(hand));
        let slot = slot.unwrap_or_default();
        let atlas = slot.grown.as_deref().map(|grown| &*grown.atlas);
        v1::Atlas {
            growth: growth_of(&slot).into(),
            ..wire_atlas(id, handedness, atlas, Some(&slot.learned))
        }
    }

    /// Number of atlases of objects in memory, by their growth.
    pub(crate) fn growths(&self) -> Vec<(&'static str, usize)> {
        let mut counts: BTreeMap<v1::AtlasGrowth, usize> = BTreeMap::new();
        for object in self.0.objects.in_memory() {
            for (_, slot) in object.atlas_slots.all() {
                *counts.entry(growth_of(&slot)).or_default() += 1;
            }
        }
        let growths = (1..).map_while(|number| v1::AtlasGrowth::try_from(number).ok());
        let count = |growth| {
            let name = v1::AtlasGrowth::as_str_name(&growth);
            let name = name.strip_prefix("ATLAS_GROWTH_").unwrap_or(name);
            (name, counts.get(&growth).copied().unwrap_or(0))
        };
        growths.map(count).collect()
    }

    /// A guard that stops the builders, too.
    pub(crate) fn stopper(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl Drop for Atlases {
    fn drop(&mut self) {
        self.0.queue.stop();
    }
}

/// Whether an atlas grows, and why not.
fn growth_of(slot: &Slot) -> v1::AtlasGrowth {
    let is_empty = slot.entries() == 0;
    match slot.state {
        BuildState::Growing if is_empty => v1::AtlasGrowth::Waiting,
        BuildState::Growing if slot.is_complete() => v1::AtlasGrowth::Complete,
        BuildState::Growing => v1::AtlasGrowth::Growing,
        BuildState::Finished if is_empty => v1::AtlasGrowth::NothingFound,
        BuildState::Finished => v1::AtlasGrowth::Complete,
        BuildState::Absent => v1::AtlasGrowth::AtRest,
        BuildState::NoRoom => v1::AtlasGrowth::NoMemory,
        BuildState::Failed => v1::AtlasGrowth::Failed,
    }
}

/// A hand in the log: `adult right`.
fn hand_label(hand: &Hand) -> String {
    let side = match hand.rig.handedness {
        Handedness::Left => "left",
        Handedness::Right => "right",
    };
    format!("{} {side}", hand.rig.name)
}
