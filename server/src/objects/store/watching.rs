//! Watchers of the store, and the events that have yet to be reported to each.
//!
//! A watcher has no queue of messages but, per object, the set of events since the last report: however slowly it
//! reads, it gets every object's latest state, and takes no more memory than its limit allows. Events are recorded, and reported
//! with the state that they led to, under the lock of the created objects: no watcher misses one or sees a state before its event.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    ops::Bound,
    sync::{Arc, Weak},
};

use grasp_synthesis::model::hand::Handedness;
use tokio::sync::Notify;

use super::{Created, ObjectStore};
use crate::{
    error::ServiceError,
    objects::{Listed, StoredObject},
    sync::{Mutex, MutexGuard, locked},
    validate::{Labels, ObjectFilter, WatchQuery},
};

/// Largest number of objects that have yet to be reported to a watcher. One that falls behind further is ended.
const MAX_PENDING: usize = 2048;

/// An event of an object, in the order of reports: a deleted object may be created again before the next report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Event {
    /// It was there when the watch began.
    Present,
    /// A client deleted it, or changed its labels so that they no longer match.
    Deleted,
    /// It made room for others.
    Evicted,
    /// A client created it, or changed its labels so that they match.
    Created,
    /// A client changed it.
    Updated,
    /// Its atlas for a hand became large enough to answer most requests.
    AtlasUseful(Handedness),
    /// Its atlas for a hand is complete.
    AtlasComplete(Handedness),
}

/// A report to a watcher.
#[derive(Debug)]
pub(crate) enum Report {
    /// All objects that were present have been reported.
    PresentEnd,
    Object {
        id: String,
        /// At least one event.
        events: BTreeSet<Event>,
        /// Its state. `None` if it is gone.
        state: Option<Listed>,
    },
}

#[derive(Debug)]
pub(crate) struct Watcher {
    filter: ObjectFilter,
    state: Mutex<State>,
    /// Notified when there may be something to report.
    pub news: Notify,
}

#[derive(Debug, Default)]
struct State {
    /// Id of the present object that was reported last, at first empty. `None` once all were, or if they were not requested.
    present: Option<String>,
    /// Ids in the order in which they are reported, each once.
    order: VecDeque<String>,
    /// Unreported events of the ids in `order`; empty if they cancelled each other out.
    events: BTreeMap<String, BTreeSet<Event>>,
    has_overflown: bool,
}

impl Watcher {
    fn new(query: WatchQuery) -> Self {
        Self {
            filter: query.filter,
            state: Mutex::new(State {
                present: query.wants_present.then(String::new),
                ..State::default()
            }),
            news: Notify::new(),
        }
    }

    /// Records an event of an object whose labels were `before` and are `after`. `None` if it did not or does not exist.
    fn record(&self, id: &str, event: Event, before: Option<&Labels>, after: Option<&Labels>) {
        let matches = |labels: Option<&Labels>| labels.is_some_and(|labels| self.filter.matches(id, labels));
        let event = match (matches(before), matches(after)) {
            (false, false) => return,
            (false, true) => Event::Created,
            (true, false) if after.is_some() => Event::Deleted,
            (true, _) => event,
        };
        self.state().record(id, event);
        self.news.notify_one();
    }

    fn state(&self) -> MutexGuard<'_, State> {
        locked(&self.state)
    }
}

impl State {
    fn record(&mut self, id: &str, event: Event) {
        // Objects that the list of present ones has yet to reach will be reported in their state then.
        let is_ahead = self.present.as_ref().is_some_and(|last| last.as_str() < id);
        if self.has_overflown || is_ahead {
            return;
        }
        if let Some(events) = self.events.get_mut(id) {
            combine(events, event);
            return;
        }
        if self.events.len() == MAX_PENDING {
            self.has_overflown = true;
            self.order = VecDeque::new();
            self.events = BTreeMap::new();
            return;
        }
        self.order.push_back(id.to_owned());
        self.events.insert(id.to_owned(), BTreeSet::from([event]));
    }

    /// The oldest unreported events.
    fn take(&mut self) -> Option<(String, BTreeSet<Event>)> {
        loop {
            let id = self.order.pop_front()?;
            let events = self.events.remove(&id).unwrap_or_default();
            if !events.is_empty() {
                return Some((id, events));
            }
        }
    }
}

/// Adds an event to those before it.
fn combine(events: &mut BTreeSet<Event>, event: Event) {
    if matches!(event, Event::Deleted | Event::Evicted) {
        // Unreported events are dropped, but for the deletion of an earlier object of this name.
        let is_new = events.contains(&Event::Created);
        events.retain(|before| is_new && matches!(before, Event::Deleted | Event::Evicted));
        if !is_new {
            events.insert(event);
        }
    } else {
        events.insert(event);
    }
}

impl ObjectStore {
    /// A watcher of events from this moment on.
    pub(crate) fn watch(&self, query: WatchQuery) -> Arc<Watcher> {
        let mut created = self.created();
        created.watchers.retain(|watcher| watcher.strong_count() > 0);
        let watcher = Arc::new(Watcher::new(query));
        created.watchers.push(Arc::downgrade(&watcher));
        watcher
    }

    /// The next report to the watcher. `None` if there is nothing yet.
    pub(crate) fn next_report(&self, watcher: &Watcher) -> Result<Option<Report>, ServiceError> {
        let created = self.created();
        let mut unreported = watcher.state();
        if unreported.has_overflown {
            return Err(ServiceError::WatcherTooSlow);
        }
        if let Some(last) = &unreported.present {
            let next = self.next_present(&created, &watcher.filter, last);
            unreported.present = next.map(|state| state.id().to_owned());
            return Ok(Some(next.map_or(Report::PresentEnd, |state| Report::Object {
                id: state.id().to_owned(),
                events: [Event::Present].into(),
                state: Some(state.clone()),
            })));
        }
        Ok(unreported.take().map(|(id, events)| Report::Object {
            state: self.state_in(&created, &id).cloned(),
            id,
            events,
        }))
    }

    /// The first object after this id that the filter lets through.
    fn next_present<'a>(
        &'a self,
        created: &'a Created,
        filter: &ObjectFilter,
        last: &str,
    ) -> Option<&'a Listed> {
        let range = (Bound::Excluded(last), Bound::Unbounded);
        let matches = |state: &&Listed| filter.matches(state.id(), &state.record.labels);
        let mut pinned = self.pinned.range::<str, _>(range).map(|(_, state)| state);
        let made = created.objects.range::<str, _>(range);
        let mut made = made.map(|(_, entry)| &entry.state);
        let nearest = [pinned.find(matches), made.find(matches)];
        nearest.into_iter().flatten().min_by_key(|state| state.id())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(value: &str) -> Labels {
        [("value".to_owned(), value.to_owned())].into()
    }

    fn watcher(filter: ObjectFilter, wants_present: bool) -> Watcher {
        Watcher::new(WatchQuery {
            filter,
            wants_present,
        })
    }

    fn report(watcher: &Watcher) -> Vec<(String, Vec<Event>)> {
        let taken = std::iter::from_fn(|| watcher.state().take());
        taken
            .map(|(id, events)| (id, events.into_iter().collect()))
            .collect()
    }

    #[test]
    fn events_of_an_object_become_one() {
        let all = labels("");
        let watcher = watcher(ObjectFilter::default(), false);
        let create = |id| watcher.record(id, Event::Created, None, Some(&all));
        let change = |id, event| watcher.record(id, event, Some(&all), Some(&all));
        let delete = |id, event| watcher.record(id, event, Some(&all), None);
        create("b");
        change("b", Event::Updated);
        change("b", Event::AtlasUseful(Handedness::Left));
        create("unseen");
        delete("unseen", Event::Deleted);
        change("a", Event::AtlasComplete(Handedness::Right));
        delete("a", Event::Evicted);
        delete("c", Event::Deleted);
        create("c");
        delete("d", Event::Deleted);
        create("d");
        delete("d", Event::Evicted);
        let expected = [
            (
                "b",
                &[
                    Event::Created,
                    Event::Updated,
                    Event::AtlasUseful(Handedness::Left),
                ][..],
            ),
            ("a", &[Event::Evicted]),
            ("c", &[Event::Deleted, Event::Created]),
            ("d", &[Event::Deleted]),
        ];
        let expected = expected.map(|(id, events)| (id.to_owned(), events.to_vec()));
        assert_eq!(report(&watcher), expected);
        assert_eq!(report(&watcher), []);
    }

    #[test]
    fn the_list_of_present_objects_comes_before_the_events_ahead_of_it() {
        let all = labels("");
        let watcher = watcher(ObjectFilter::default(), true);
        watcher.record("b", Event::Updated, Some(&all), Some(&all));
        watcher.state().present = Some("b".to_owned());
        for id in ["a", "b", "c"] {
            watcher.record(id, Event::Deleted, Some(&all), None);
        }
        watcher.state().present = None;
        let report: Vec<String> = report(&watcher).into_iter().map(|(id, _)| id).collect();
        assert_eq!(report, ["a", "b"]);
    }

    #[test]
    fn memory_is_bounded_however_much_happens() {
        let all = labels("");
        let watcher = watcher(ObjectFilter::default(), false);
        for _ in 0..10 {
            for n in 0..MAX_PENDING {
                watcher.record(&n.to_string(), Event::Created, None, Some(&all));
                watcher.record(&n.to_string(), Event::Deleted, Some(&all), None);
            }
        }
        assert!(!watcher.state().has_overflown);
        assert_eq!(watcher.state().order.len(), MAX_PENDING);
        watcher.record("one more", Event::Deleted, Some(&all), None);
        let state = watcher.state();
        assert!(state.has_overflown && state.order.is_empty());
    }
}
