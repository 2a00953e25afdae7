//! Who watches the objects, and what has yet to be reported to each watcher.
//!
//! A watcher has no queue of messages but, per object, the set of what happened since the last report: however slowly it
//! reads, it gets every object's latest state, and takes no more memory than its limit allows.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Mutex, MutexGuard, PoisonError},
};

use grasp_synthesis::model::hand::Handedness;
use tokio::sync::Notify;

use super::Listed;
use crate::validate::{Labels, ObjectFilter};

/// Largest number of objects that have yet to be reported to a watcher. One that falls behind further is ended.
const MAX_PENDING: usize = 2048;

/// What happened to an object, in the order in which it is reported: what was deleted may be created again before the next
/// report.
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

/// What is reported to a watcher next.
#[derive(Debug)]
pub(crate) enum Report {
    /// All objects that were present have been reported.
    PresentEnd,
    /// What happened to an object.
    Object {
        /// Its id.
        id: String,
        /// What happened, at least one event.
        events: BTreeSet<Event>,
        /// Its state. `None` if it is gone.
        state: Option<Listed>,
    },
}

/// One watcher.
#[derive(Debug)]
pub(crate) struct Watcher {
    /// Which objects it watches.
    pub(super) filter: ObjectFilter,
    state: Mutex<State>,
    news: Notify,
}

#[derive(Debug)]
struct State {
    /// Where the list of present objects goes on. `None` if it has ended or was not requested.
    present: Option<Cursor>,
    /// Ids in the order in which they are reported, each once.
    order: VecDeque<String>,
    /// Unreported events of the ids in `order`; none are left if they cancelled each other out.
    events: BTreeMap<String, BTreeSet<Event>>,
    has_overflown: bool,
}

/// A place in the list of ids.
#[derive(Clone, Debug)]
pub(super) enum Cursor {
    /// Before all.
    Start,
    /// After this one.
    After(String),
}

impl Cursor {
    fn is_before(&self, id: &str) -> bool {
        match self {
            Self::Start => true,
            Self::After(report) => report.as_str() < id,
        }
    }
}

impl Watcher {
    /// A watcher of what happens from now on, and first of the present objects if it asks for them.
    pub(super) fn new(filter: ObjectFilter, wants_present: bool) -> Self {
        Self {
            filter,
            state: Mutex::new(State {
                present: wants_present.then_some(Cursor::Start),
                order: VecDeque::new(),
                events: BTreeMap::new(),
                has_overflown: false,
            }),
            news: Notify::new(),
        }
    }

    /// Waits until there may be something to tell.
    pub(crate) async fn news(&self) {
        self.news.notified().await;
    }

    /// Records an event of an object whose labels were `before` and are `after`. `None` if it was or is not there.
    pub(super) fn record(&self, id: &str, event: Event, before: Option<&Labels>, after: Option<&Labels>) {
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

    /// True if it fell too far behind.
    pub(super) fn has_overflown(&self) -> bool {
        self.state().has_overflown
    }

    /// Where the list of present objects goes on. `None` if it has ended.
    pub(super) fn present(&self) -> Option<Cursor> {
        self.state().present.clone()
    }

    /// Goes on in the list of present objects after this one.
    pub(super) fn reported_present(&self, id: &str) {
        self.state().present = Some(Cursor::After(id.to_owned()));
    }

    /// Ends the list of present objects.
    pub(super) fn end_present(&self) {
        self.state().present = None;
    }

    /// The oldest unreported events.
    pub(super) fn take(&self) -> Option<(String, BTreeSet<Event>)> {
        let mut state = self.state();
        loop {
            let id = state.order.pop_front()?;
            let events = state.events.remove(&id).unwrap_or_default();
            if !events.is_empty() {
                return Some((id, events));
            }
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // No code panics while it holds the lock; if some did, the state would still be consistent.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn record(&mut self, id: &str, event: Event) {
        // What the list of present objects has yet to come to will be reported as it is then.
        let is_ahead = self.present.as_ref().is_some_and(|cursor| cursor.is_before(id));
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
}

/// Adds an event to those before it.
fn combine(events: &mut BTreeSet<Event>, event: Event) {
    if matches!(event, Event::Deleted | Event::Evicted) {
        // What was not reported need not be, unless another object had the name before.
        let is_new = events.contains(&Event::Created);
        let before = events
            .iter()
            .copied()
            .find(|e| matches!(e, Event::Deleted | Event::Evicted));
        events.clear();
        events.extend(if is_new { before } else { Some(event) });
    } else {
        events.insert(event);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(value: &str) -> Labels {
        [("value".to_owned(), value.to_owned())].into()
    }

    fn report(watcher: &Watcher) -> Vec<(String, Vec<Event>)> {
        let taken = std::iter::from_fn(|| watcher.take());
        taken
            .map(|(id, events)| (id, events.into_iter().collect()))
            .collect()
    }

    #[test]
    fn events_of_an_object_become_one() {
        let all = labels("");
        let watcher = Watcher::new(ObjectFilter::default(), false);
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
    fn a_filter_makes_objects_come_and_go() {
        let request = grasp_proto::v1::ListObjectsRequest {
            filter: "labels.value = \"in\"".to_owned(),
            ..Default::default()
        };
        let filter = crate::validate::page_query(&request).unwrap().filter;
        let watcher = Watcher::new(filter, false);
        let (inside, outside) = (labels("in"), labels("out"));
        let expect = |before, after, expected: Option<Event>| {
            watcher.record("x", Event::Updated, before, after);
            let events = watcher.take().map(|(_, events)| events.into_iter().collect());
            assert_eq!(events, expected.map(|event| vec![event]));
        };
        expect(Some(&outside), Some(&inside), Some(Event::Created));
        expect(Some(&inside), Some(&inside), Some(Event::Updated));
        expect(Some(&inside), Some(&outside), Some(Event::Deleted));
        expect(Some(&outside), Some(&outside), None);
    }

    #[test]
    fn the_list_of_present_objects_comes_before_the_events_ahead_of_it() {
        let all = labels("");
        let watcher = Watcher::new(ObjectFilter::default(), true);
        watcher.record("b", Event::Updated, Some(&all), Some(&all));
        watcher.reported_present("b");
        for id in ["a", "b", "c"] {
            watcher.record(id, Event::Deleted, Some(&all), None);
        }
        watcher.end_present();
        let report: Vec<String> = report(&watcher).into_iter().map(|(id, _)| id).collect();
        assert_eq!(report, ["a", "b"]);
    }

    #[test]
    fn memory_is_bounded_however_much_happens() {
        let all = labels("");
        let watcher = Watcher::new(ObjectFilter::default(), false);
        for _ in 0..10 {
            for n in 0..MAX_PENDING {
                watcher.record(&n.to_string(), Event::Created, None, Some(&all));
                watcher.record(&n.to_string(), Event::Deleted, Some(&all), None);
            }
        }
        assert!(!watcher.has_overflown());
        assert_eq!(watcher.state().order.len(), MAX_PENDING);
        watcher.record("one more", Event::Deleted, Some(&all), None);
        assert!(watcher.has_overflown() && watcher.state().order.is_empty());
    }
}
