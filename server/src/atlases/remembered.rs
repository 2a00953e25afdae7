//! Grips that searches found because no atlas had them. The next request is likely to need the same grip: the giver's
//! hand moves less between two requests than it differs between two people.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError, Weak},
};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::entry::Entry;

use crate::objects::StoredObject;

/// Largest number of remembered grips of all objects and hands together: about a megabyte, outside `cache_bytes`.
pub(super) const CAPACITY: usize = 1024;

/// The owners of the remembered grips, oldest first; an object and hand is listed once per grip. The grips themselves
/// are in the object's atlas slots and are dropped with it.
#[derive(Debug, Default)]
pub(super) struct RememberedGrips(Mutex<VecDeque<(Weak<StoredObject>, Arc<Hand>)>>);

impl RememberedGrips {
    /// Remembers a grip; beyond [`CAPACITY`], the oldest grip is forgotten.
    pub(super) fn add(&self, object: &Arc<StoredObject>, hand: &Arc<Hand>, grip: Entry) {
        // No code panics while it holds the lock; if some did, the queue would still be consistent.
        let mut owners = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let owner = Arc::downgrade(object);
        if !object.atlas_slots.remember(hand, grip)
            && let Some(place) = owners
                .iter()
                .position(|(of, with)| of.ptr_eq(&owner) && with == hand)
        {
            owners.remove(place);
        }
        owners.push_back((owner, Arc::clone(hand)));
        if owners.len() > CAPACITY
            && let Some((object, hand)) = owners.pop_front()
            && let Some(object) = object.upgrade()
        {
            object.atlas_slots.forget_oldest(&hand);
        }
    }
}
