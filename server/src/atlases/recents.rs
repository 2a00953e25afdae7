//! What searches found lately: kept beside the atlases, for the requests that follow.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError, Weak},
};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::entry::Entry;

use crate::objects::StoredObject;

/// Grips that are kept of all objects and hands together: a megabyte, which nothing has to make room for. Where more are
/// found, those that were found first are forgotten.
pub(super) const MOST: usize = 1024;

/// Whose grips are kept, in the order in which they were found: an object and hand stands here as often as it has grips. The
/// grips themselves are on the objects' shelves, and end with these.
#[derive(Debug, Default)]
pub(super) struct Recents(Mutex<VecDeque<(Weak<StoredObject>, &'static Hand)>>);

impl Recents {
    /// Keeps a grip of an object and a hand.
    pub(super) fn keep(&self, object: &Arc<StoredObject>, hand: &'static Hand, grip: Entry) {
        // No code panics while it holds the lock; were it to, the queue would still be whole.
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let owner = Arc::downgrade(object);
        if !object.shelf.remember(hand, grip)
            && let Some(place) = kept
                .iter()
                .position(|(of, with)| of.ptr_eq(&owner) && std::ptr::eq(*with, hand))
        {
            kept.remove(place);
        }
        kept.push_back((owner, hand));
        if kept.len() > MOST
            && let Some((object, hand)) = kept.pop_front()
            && let Some(object) = object.upgrade()
        {
            object.shelf.forget_oldest(hand);
        }
    }
}
