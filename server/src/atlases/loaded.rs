//! Which atlases are in memory, and which are evicted when memory is short.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
    time::Duration,
};

use grasp_assets::hands::Hand;

use super::hand_label;
use crate::{
    atlas_slots::Update,
    objects::{StoredObject, store::ObjectStore},
};

/// The owner of an atlas: an object and a hand.
type Owner = (Weak<StoredObject>, Arc<Hand>);

/// The atlases in memory, which share `cache_bytes` with created objects.
#[derive(Debug)]
pub(super) struct LoadedAtlases {
    objects: Arc<ObjectStore>,
    /// Owners of atlases. The lock also guards adding and evicting.
    owners: Mutex<Vec<Owner>>,
}

impl LoadedAtlases {
    /// No atlases yet.
    pub(super) fn new(objects: Arc<ObjectStore>) -> Self {
        Self {
            objects,
            owners: Mutex::default(),
        }
    }

    /// Puts an atlas in its slot, evicting less recently used ones if there is no room. False if there still is none.
    pub(super) fn publish(
        &self,
        object: &Arc<StoredObject>,
        hand: &Arc<Hand>,
        update: Update,
        spent: Duration,
    ) -> bool {
        let bytes = update.bytes();
        let mut owners = self.owners();
        let is_same =
            |(other, its_hand): &Owner| std::ptr::eq(other.as_ptr(), Arc::as_ptr(object)) && its_hand == hand;
        let has_slot = |(object, hand): &Owner| {
            object
                .upgrade()
                .is_some_and(|object| object.atlas_slots.get(hand).is_some())
        };
        owners.retain(|owner| has_slot(owner) && !is_same(owner));
        let slot = object.atlas_slots.get(hand).unwrap_or_default();
        let room = self.objects.room();
        let fits = bytes <= room && make_room(&mut owners, room - bytes, slot.last_used);
        if fits {
            object.atlas_slots.publish(hand, update, spent);
        }
        if fits || slot.grown.is_some() {
            owners.push((Arc::downgrade(object), Arc::clone(hand)));
        }
        fits
    }

    /// Evicts atlases until the others fit in the room that created objects leave.
    pub(super) fn make_room_for_objects(&self) {
        self.shrink_to(self.objects.room());
    }

    /// Evicts atlases until the others take no more than `bytes`.
    pub(super) fn shrink_to(&self, bytes: usize) {
        make_room(&mut self.owners(), bytes, u64::MAX);
    }

    fn owners(&self) -> MutexGuard<'_, Vec<Owner>> {
        // No code panics while it holds the lock; if some did, the list would still be consistent.
        self.owners.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Evicts the least recently used atlases, of those last used before `before`, until the others take no more than
/// `room` bytes. False, and nothing is evicted, if that is not enough.
fn make_room(owners: &mut Vec<Owner>, room: usize, before: u64) -> bool {
    let mut slots: Vec<(u64, usize, usize)> = owners
        .iter()
        .enumerate()
        .filter_map(|(place, (object, hand))| {
            let slot = object.upgrade()?.atlas_slots.get(hand)?;
            Some((slot.last_used, slot.bytes, place))
        })
        .collect();
    slots.sort_unstable();
    let mut taken: usize = slots.iter().map(|(_, bytes, _)| bytes).sum();
    let evicted: Vec<usize> = slots
        .into_iter()
        .take_while(|(last_used, bytes, _)| {
            let is_evicted = taken > room && *last_used < before;
            taken -= if is_evicted { *bytes } else { 0 };
            is_evicted
        })
        .map(|(_, _, place)| place)
        .collect();
    if taken > room {
        return false;
    }
    for place in &evicted {
        let (object, hand) = &owners[*place];
        if let Some(object) = object.upgrade() {
            tracing::debug!(object = object.name(), hand = %hand_label(hand), "evicted an atlas");
            object.atlas_slots.evict(hand);
        }
    }
    let mut place = 0;
    owners.retain(|_| {
        place += 1;
        !evicted.contains(&(place - 1))
    });
    true
}
