//! Which atlases are in memory, and which are evicted when memory is short.

use std::{
    collections::HashSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
    time::Duration,
};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::{entry::Entry, growth::Grown};

use super::hand_label;
use crate::{
    atlas_slots::Slot,
    demand::Demand,
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

    /// Puts an atlas in its slot, evicting others that are asked for less if there is no room. False if there still is none.
    pub(super) fn publish(
        &self,
        object: &Arc<StoredObject>,
        hand: &Arc<Hand>,
        grown: Arc<Grown>,
        spent: Duration,
    ) -> bool {
        let mut owners = self.owners();
        let was_loaded = drop_owner(&mut owners, object, hand);
        let learned = object
            .atlas_slots
            .get(hand)
            .map_or(0, |slot| slot.learned.bytes());
        let fits = self.make_room(&mut owners, object, hand, grown.bytes() + learned);
        if fits {
            object.atlas_slots.publish(hand, grown, spent);
        }
        if fits || was_loaded {
            owners.push((Arc::downgrade(object), Arc::clone(hand)));
        }
        self.objects.leave(taken(&owners));
        fits
    }

    /// Adds a grip that a search found to those of a hand, at most `most`, if there is room as for an atlas.
    pub(super) fn learn(&self, object: &Arc<StoredObject>, hand: &Arc<Hand>, grip: Entry, most: usize) {
        let mut owners = self.owners();
        // Without a slot, other hands have taken its place.
        let Some(slot) = object.atlas_slots.get(hand) else {
            return;
        };
        let learned = slot.learned.with(&hand.rig, grip, most);
        let of_atlas = slot.grown.as_ref().map_or(0, |grown| grown.bytes());
        let was_loaded = drop_owner(&mut owners, object, hand);
        let fits = self.make_room(&mut owners, object, hand, of_atlas + learned.bytes());
        if fits {
            object.atlas_slots.learn(hand, Arc::new(learned));
        }
        if fits || was_loaded {
            owners.push((Arc::downgrade(object), Arc::clone(hand)));
        }
        self.objects.leave(taken(&owners));
    }

    /// Gives a changed object what is known of the object that it replaces.
    pub(super) fn hand_over(&self, object: &Arc<StoredObject>, hand: &Arc<Hand>, slot: Slot) {
        let mut owners = self.owners();
        if slot.bytes > 0 {
            owners.push((Arc::downgrade(object), Arc::clone(hand)));
        }
        object.atlas_slots.take_over(hand, slot);
    }

    /// True if an atlas of so many bytes would fit, after evicting others that are asked for less.
    pub(super) fn has_room(&self, object: &Arc<StoredObject>, hand: &Arc<Hand>, bytes: usize) -> bool {
        let others: Vec<Owner> = self
            .owners()
            .iter()
            .filter(|owner| !is(owner, object, hand))
            .cloned()
            .collect();
        let demand = object.atlas_slots.demand(hand).unwrap_or_default();
        let room = self.objects.room();
        bytes <= room && evictable(&others, room - bytes, demand).is_some()
    }

    fn make_room(
        &self,
        owners: &mut Vec<Owner>,
        object: &StoredObject,
        hand: &Arc<Hand>,
        bytes: usize,
    ) -> bool {
        let demand = object.atlas_slots.demand(hand).unwrap_or_default();
        let room = self.objects.room();
        bytes <= room && make_room(owners, room - bytes, demand)
    }

    /// Evicts atlases until the others fit in the room that created objects leave, and then what is derived from objects until it
    /// fits beside them.
    pub(super) fn make_room_for_objects(&self) {
        self.shrink_to(self.objects.room());
        self.objects.leave(taken(&self.owners()));
    }

    /// Evicts atlases until the others take no more than `bytes`.
    pub(super) fn shrink_to(&self, bytes: usize) {
        make_room(&mut self.owners(), bytes, Demand::MOST);
    }

    fn owners(&self) -> MutexGuard<'_, Vec<Owner>> {
        // No code panics while it holds the lock; if some did, the list would still be consistent.
        self.owners.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Bytes of atlases.
fn taken(owners: &[Owner]) -> usize {
    let slots = owners
        .iter()
        .filter_map(|(object, hand)| object.upgrade()?.atlas_slots.demand_and_bytes(hand));
    slots.map(|(_, bytes)| bytes).sum()
}

/// True for the owner that an object and a hand are.
fn is((of, with): &Owner, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> bool {
    std::ptr::eq(of.as_ptr(), Arc::as_ptr(object)) && with == hand
}

/// Drops an owner and those that are gone. True if anything is known of the owner.
fn drop_owner(owners: &mut Vec<Owner>, object: &Arc<StoredObject>, hand: &Arc<Hand>) -> bool {
    owners.retain(|owner| {
        let (of, with) = owner;
        let has_slot = of
            .upgrade()
            .is_some_and(|of| of.atlas_slots.demand(with).is_some());
        has_slot && !is(owner, object, hand)
    });
    object.atlas_slots.get(hand).is_some_and(|slot| slot.bytes > 0)
}

/// Evicts what is asked for least, of what is asked for less than `before`, until the others take no more than `room` bytes.
/// False, and nothing is evicted, if that is not enough.
fn make_room(owners: &mut Vec<Owner>, room: usize, before: Demand) -> bool {
    let Some(evicted) = evictable(owners, room, before) else {
        return false;
    };
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

/// The places of the owners whose atlases [`make_room`] evicts; none if that is not enough.
fn evictable(owners: &[Owner], room: usize, before: Demand) -> Option<HashSet<usize>> {
    let mut slots: Vec<(Demand, usize, usize)> = owners
        .iter()
        .enumerate()
        .filter_map(|(place, (object, hand))| {
            let (demand, bytes) = object.upgrade()?.atlas_slots.demand_and_bytes(hand)?;
            Some((demand, bytes, place))
        })
        .collect();
    let mut taken: usize = slots.iter().map(|(_, bytes, _)| bytes).sum();
    if taken <= room {
        return Some(HashSet::new());
    }
    slots.sort_unstable_by(|(a, ..), (b, ..)| a.cmp(*b));
    let mut evicted = HashSet::new();
    for (demand, bytes, place) in slots {
        if taken <= room || demand.cmp(before).is_ge() {
            break;
        }
        taken -= bytes;
        evicted.insert(place);
    }
    (taken <= room).then_some(evicted)
}
