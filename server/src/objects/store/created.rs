//! The objects that clients created, in memory or at rest.

use std::{
    collections::{BTreeMap, HashMap, VecDeque},
    sync::{Arc, Weak},
    time::{SystemTime, UNIX_EPOCH},
};

use uuid::Uuid;

use super::{Event, cache::Cache, loading::Load, watching::Watcher};
use crate::{
    access::{Caller, Owner},
    error::{Quota, ServiceError},
    objects::{Body, Listed, StoredObject, name_of, saved::MeshHash},
    validate::RequestKey,
};

/// Number of evicted ids that are remembered for error messages.
const REMEMBERED_EVICTIONS: usize = 1024;

#[derive(Debug, Default)]
pub(super) struct Created {
    pub objects: BTreeMap<String, Entry>,
    /// Ids of objects by the ids of the requests that created them, which are each owner's own.
    pub requests: HashMap<(Owner, Uuid), String>,
    pub cache: Cache,
    /// Number of objects that are not at rest, and of those about to be added.
    pub loaded: usize,
    /// Size of the same in bytes.
    pub bytes: usize,
    /// Number of uses so far: the clock of `last_used`.
    pub uses: u64,
    pub evicted: VecDeque<String>,
    /// When this run of the server started, in nanoseconds since 1970.
    started: u128,
    /// Number of etags that it made.
    etags: u64,
    pub watchers: Vec<Weak<Watcher>>,
    pub loads: Vec<Load>,
}

#[derive(Debug)]
pub(super) struct Entry {
    pub state: Listed,
    pub request: Option<RequestKey>,
    /// SHA-256 of its mesh file, if it is saved.
    pub mesh: Option<MeshHash>,
    /// Size of its mesh file in bytes.
    pub mesh_bytes: u64,
    pub last_used: u64,
    /// True if its record could not be read: of its state, only the id is right.
    pub is_damaged: bool,
}

impl Created {
    pub(super) fn new(now: SystemTime) -> Self {
        Self {
            started: now.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos(),
            ..Self::default()
        }
    }

    /// A new etag: none is made twice, not even by another run of the server.
    pub(super) fn next_etag(&mut self) -> String {
        self.etags += 1;
        format!("{:x}-{:x}", self.started, self.etags)
    }

    pub(super) fn entry(&mut self, id: &str) -> Result<&mut Entry, ServiceError> {
        let evicted = &self.evicted;
        let not_found = || ServiceError::ObjectNotFound {
            name: name_of(id),
            evicted: evicted.iter().any(|evicted| evicted == id),
        };
        self.objects.get_mut(id).ok_or_else(not_found)
    }

    /// Checks the quotas of a client that is about to create an object with a mesh file of so many bytes.
    pub(super) fn check_quotas(&self, caller: &Caller, more_bytes: u64) -> Result<(), ServiceError> {
        let (owner, quotas) = (caller.owner(), caller.quotas());
        let own = self
            .objects
            .values()
            .filter(|entry| entry.state.record.owner == owner);
        // Only clients with a quota pay for counting.
        let exceeded = |quota, maximum: u64| ServiceError::QuotaExceeded {
            quota,
            maximum,
            retry_after: None,
        };
        if let Some(most) = quotas.objects
            && own.clone().count() >= most
        {
            return Err(exceeded(Quota::Objects, most as u64));
        }
        if let Some(most) = quotas.bytes
            && own
                .map(|entry| entry.mesh_bytes)
                .sum::<u64>()
                .saturating_add(more_bytes)
                > most
        {
            return Err(exceeded(Quota::Bytes, most));
        }
        Ok(())
    }

    /// True if calls find this very object.
    pub(super) fn is_current(&self, object: &Arc<StoredObject>) -> bool {
        let entry = self.objects.get(&object.id);
        let current = entry.and_then(|entry| entry.state.object());
        current.is_some_and(|current| Arc::ptr_eq(current, object))
    }

    pub(super) fn tick(&mut self) -> u64 {
        self.uses += 1;
        self.uses
    }

    /// The entry, which is used now, unless its record is damaged.
    pub(super) fn used_entry(&mut self, id: &str) -> Result<&mut Entry, ServiceError> {
        let now = self.tick();
        let entry = self.entry(id)?;
        if entry.is_damaged {
            return Err(ServiceError::ObjectDamaged { name: name_of(id) });
        }
        entry.last_used = now;
        Ok(entry)
    }

    /// The entry if it has the etag, or any if none is given.
    pub(super) fn entry_with(&mut self, id: &str, etag: Option<&str>) -> Result<&mut Entry, ServiceError> {
        let entry = self.entry(id)?;
        if entry.is_damaged && etag.is_some() {
            return Err(ServiceError::ObjectDamaged { name: name_of(id) });
        }
        let current = &entry.state.record.etag;
        if let Some(etag) = etag.filter(|etag| etag != current) {
            return Err(ServiceError::ObjectChanged {
                name: name_of(id),
                etag: etag.to_owned(),
                current: current.clone(),
            });
        }
        Ok(entry)
    }

    pub(super) fn add(&mut self, entry: Entry) {
        let id = entry.state.id().to_owned();
        self.count(&entry.state);
        if let Some(request) = &entry.request {
            let owner = entry.state.record.owner.clone();
            self.requests.insert((owner, request.id), id.clone());
        }
        self.evicted.retain(|evicted| *evicted != id);
        self.objects.insert(id, entry);
    }

    /// Replaces the state of an object, if it exists.
    pub(super) fn set_state(&mut self, id: &str, state: &Listed) {
        let Some(entry) = self.objects.get_mut(id) else {
            return;
        };
        let before = std::mem::replace(&mut entry.state, state.clone());
        self.uncount(&before);
        self.count(state);
        match (before.object(), state.object()) {
            (Some(before), Some(after)) if Arc::ptr_eq(before, after) => {}
            (Some(before), after) => {
                self.cache.forget(before);
                // Before any call sees it.
                if let Some(after) = after {
                    self.cache.hand_over(before, after);
                }
            }
            (None, _) => {}
        }
    }

    /// Removes an object, if it exists.
    pub(super) fn take(&mut self, id: &str, event: Event) {
        if let Some(entry) = self.objects.remove(id) {
            self.tell(id, event, Some(&entry.state.record.labels), None);
            self.uncount(&entry.state);
            if let Some(object) = entry.state.object() {
                self.cache.forget(object);
            }
            if let Some(request) = entry.request {
                let owner = entry.state.record.owner.clone();
                self.requests.remove(&(owner, request.id));
            }
        }
    }

    /// Makes room by the least recently used object that no call uses, but not `kept`: a saved one is put to rest, any
    /// other removed. False if there is none.
    pub(super) fn evict_one(&mut self, kept: Option<&str>) -> bool {
        let unused = self.objects.iter().filter_map(|(id, entry)| {
            let object = entry.state.object()?;
            let is_unused = kept != Some(id.as_str()) && !object.is_in_use();
            is_unused.then_some((id, entry, object))
        });
        let Some((id, entry, object)) = unused.min_by_key(|(_, entry, _)| entry.last_used) else {
            return false;
        };
        let id = id.clone();
        if entry.mesh.is_some() {
            let state = Listed {
                body: Body::AtRest(Arc::new(object.description())),
                record: Arc::clone(&entry.state.record),
            };
            self.set_state(&id, &state);
            return true;
        }
        self.take(&id, Event::Evicted);
        if self.evicted.len() == REMEMBERED_EVICTIONS {
            self.evicted.pop_front();
        }
        self.evicted.push_back(id);
        true
    }

    fn count(&mut self, state: &Listed) {
        self.bytes += state.bytes();
        self.loaded += usize::from(state.object().is_some());
    }

    fn uncount(&mut self, state: &Listed) {
        self.bytes -= state.bytes();
        self.loaded -= usize::from(state.object().is_some());
    }
}
