//! Watchers of the store.
//!
//! Events are recorded, and reported with the state that they led to, under the lock of the created objects: no watcher misses one
//! or sees a state before its event.

use std::{
    ops::Bound,
    sync::{Arc, Weak},
};

use super::{Created, ObjectStore};
use crate::{
    error::{Limit, ServiceError},
    objects::{
        Listed, StoredObject,
        changes::{Cursor, Event, Report, Watcher},
    },
    validate::{Labels, WatchQuery},
};

use super::RETRY_AFTER;

impl ObjectStore {
    /// A watcher of what happens from now on.
    ///
    /// # Errors
    /// [`ServiceError::Overloaded`] if there are `most` already.
    pub(crate) fn watch(&self, query: WatchQuery, most: usize) -> Result<Arc<Watcher>, ServiceError> {
        let mut created = self.created();
        created.watchers.retain(|watcher| watcher.strong_count() > 0);
        if created.watchers.len() >= most {
            return Err(ServiceError::Overloaded {
                limit: Limit::Watchers,
                maximum: most,
                retry_after: RETRY_AFTER,
            });
        }
        let watcher = Arc::new(Watcher::new(query.filter, query.wants_present));
        created.watchers.push(Arc::downgrade(&watcher));
        Ok(watcher)
    }

    /// What is reported to the watcher next. `None` if there is nothing yet.
    ///
    /// # Errors
    /// [`ServiceError::WatcherTooSlow`].
    pub(crate) fn next_report(&self, watcher: &Watcher) -> Result<Option<Report>, ServiceError> {
        let created = self.created();
        if watcher.has_overflown() {
            return Err(ServiceError::WatcherTooSlow);
        }
        if let Some(cursor) = watcher.present() {
            return Ok(Some(self.next_present(&created, watcher, &cursor)));
        }
        Ok(watcher.take().map(|(id, events)| Report::Object {
            state: self.state_in(&created, &id).cloned(),
            id,
            events,
        }))
    }

    /// The next present object, or the end of them.
    fn next_present(&self, created: &Created, watcher: &Watcher, cursor: &Cursor) -> Report {
        let start = match cursor {
            Cursor::Start => Bound::Unbounded,
            Cursor::After(id) => Bound::Excluded(id.as_str()),
        };
        let range = (start, Bound::Unbounded);
        let matches = |state: &&Listed| watcher.filter.matches(state.id(), &state.record.labels);
        let pinned = self.pinned.range::<str, _>(range).map(|(_, state)| state);
        let made = created
            .objects
            .range::<str, _>(range)
            .map(|(_, entry)| &entry.state);
        let nearest = [pinned.clone().find(matches), made.clone().find(matches)];
        match nearest.into_iter().flatten().min_by_key(|state| state.id()) {
            None => {
                watcher.end_present();
                Report::PresentEnd
            }
            Some(state) => {
                let id = state.id();
                watcher.reported_present(id);
                Report::Object {
                    id: id.to_owned(),
                    events: [Event::Present].into(),
                    state: Some(state.clone()),
                }
            }
        }
    }

    /// Tells watchers of an event of an object's atlas, unless the object was replaced or is gone.
    pub(crate) fn tell_of_atlas(&self, object: &Arc<StoredObject>, event: Event) {
        let mut created = self.created();
        let current = self.state_in(&created, &object.id);
        let is_same = |state: &&Listed| state.object().is_some_and(|now| Arc::ptr_eq(now, object));
        if let Some(record) = current.filter(is_same).map(|state| Arc::clone(&state.record)) {
            let labels = Some(&record.labels);
            created.tell(&object.id, event, labels, labels);
        }
    }

    fn state_in<'a>(&'a self, created: &'a Created, id: &str) -> Option<&'a Listed> {
        let made = || created.objects.get(id).map(|entry| &entry.state);
        self.pinned.get(id).or_else(made)
    }
}

impl Created {
    /// Records an event for every watcher of the labels before or after it.
    pub(super) fn tell(&mut self, id: &str, event: Event, before: Option<&Labels>, after: Option<&Labels>) {
        self.watchers.retain(|watcher| watcher.strong_count() > 0);
        for watcher in self.watchers.iter().filter_map(Weak::upgrade) {
            watcher.record(id, event, before, after);
        }
    }
}
