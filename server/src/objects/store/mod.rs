//! Objects by name. Built-in ones and those of the objects directory stay as they are; created ones can be changed and
//! deleted, and stay while they fit.
//!
//! When a new object does not fit, created objects that no call uses are evicted, the least recently used first. The
//! error for an evicted object says that it was evicted, so that its client creates it again.
//!
//! Labels and times are kept here, not in the object: a change of them leaves its atlases and its searches alone.

#[cfg(test)]
mod tests;
mod watching;

use std::{
    collections::{BTreeMap, HashMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use grasp_assets::objects::{object, objects};
use uuid::Uuid;

use super::{
    Record, Revision, StoredObject,
    changes::{Event, Watcher},
    directory::PinnedObject,
    name_of,
};
use crate::{
    error::{Limit, ServiceError},
    limits::StoreLimits,
    validate::{Labels, PageQuery, RequestKey},
};

/// Number of evicted ids that are remembered for error messages.
const REMEMBERED_EVICTIONS: usize = 1024;

/// When to retry if every object in the full cache is in use: searches end within seconds.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// All objects.
#[derive(Debug)]
pub(crate) struct ObjectStore {
    /// Objects that the server started with; never changed or evicted.
    pinned: BTreeMap<String, Revision>,
    created: Mutex<Created>,
    limits: StoreLimits,
}

#[derive(Debug)]
struct Created {
    objects: BTreeMap<String, Entry>,
    /// Ids of objects by the ids of the requests that created them.
    requests: HashMap<Uuid, String>,
    bytes: usize,
    /// Number of uses so far: the clock of `last_used`.
    uses: u64,
    evicted: VecDeque<String>,
    etags: Etags,
    watchers: Vec<Weak<Watcher>>,
}

#[derive(Debug)]
struct Entry {
    revision: Revision,
    request: Option<RequestKey>,
    last_used: u64,
}

/// Makes etags: none is made twice, not even by another run of the server.
#[derive(Debug)]
struct Etags {
    started: u128,
    made: u64,
}

impl Etags {
    fn next(&mut self) -> String {
        self.made += 1;
        format!("{:x}-{:x}", self.started, self.made)
    }
}

/// What a client gives a new object beside its mesh and physical properties.
#[derive(Clone, Debug, Default)]
pub(crate) struct Origin {
    /// Labels.
    pub labels: Labels,
    /// What identifies the request, if it may be repeated.
    pub request: Option<RequestKey>,
}

/// True if a built-in object has this id.
pub(crate) fn is_built_in(id: &str) -> bool {
    object(id).is_some()
}

impl ObjectStore {
    /// A store of the built-in objects and those of the objects directory, whose ids must all differ.
    pub(crate) fn new(limits: StoreLimits, directory: Vec<PinnedObject>) -> Self {
        let built_in = objects().iter().map(|built_in| PinnedObject {
            object: StoredObject::built_in(built_in.name.to_owned(), Arc::clone(&built_in.object)),
            labels: Labels::new(),
        });
        let now = SystemTime::now();
        let mut etags = Etags {
            started: now.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos(),
            made: 0,
        };
        let pinned = built_in.chain(directory).map(|pinned| {
            let revision = new_revision(pinned.object, pinned.labels, etags.next(), now);
            (revision.object.id.clone(), revision)
        });
        Self {
            pinned: pinned.collect(),
            created: Mutex::new(Created {
                objects: BTreeMap::new(),
                requests: HashMap::new(),
                bytes: 0,
                uses: 0,
                evicted: VecDeque::new(),
                etags,
                watchers: Vec::new(),
            }),
            limits,
        }
    }

    /// The objects that the server started with.
    pub(crate) fn pinned(&self) -> impl Iterator<Item = &Arc<StoredObject>> {
        self.pinned.values().map(|revision| &revision.object)
    }

    /// Bytes of the limit that created objects do not use.
    pub(crate) fn room(&self) -> usize {
        self.limits.bytes.saturating_sub(self.created().bytes)
    }

    /// True if an object has this id.
    pub(crate) fn contains(&self, id: &str) -> bool {
        self.pinned.contains_key(id) || self.created().objects.contains_key(id)
    }

    /// The object with this id. It is not evicted while its `object` is held.
    ///
    /// # Errors
    /// [`ServiceError::ObjectNotFound`].
    pub(crate) fn get(&self, id: &str) -> Result<Revision, ServiceError> {
        if let Some(revision) = self.pinned.get(id) {
            return Ok(revision.clone());
        }
        let mut created = self.created();
        created.uses += 1;
        let now = created.uses;
        let entry = created.entry(id)?;
        entry.last_used = now;
        Ok(entry.revision.clone())
    }

    /// The object that an earlier request with this key created; none if the id is free.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectExists`] if the id is taken.
    /// - [`ServiceError::RequestIdReused`] if a request with the same id and other content created an object.
    pub(crate) fn repeated(
        &self,
        id: &str,
        request: Option<&RequestKey>,
    ) -> Result<Option<Revision>, ServiceError> {
        self.repeated_in(&self.created(), id, request)
    }

    fn repeated_in(
        &self,
        created: &Created,
        id: &str,
        request: Option<&RequestKey>,
    ) -> Result<Option<Revision>, ServiceError> {
        if let Some(request) = request
            && let Some(of) = created.requests.get(&request.id)
        {
            let entry = created.objects.get(of);
            return match entry.filter(|entry| entry.request.as_ref() == Some(request)) {
                Some(entry) => Ok(Some(entry.revision.clone())),
                None => Err(ServiceError::RequestIdReused {
                    request_id: request.id.to_string(),
                    name: name_of(of),
                }),
            };
        }
        if self.pinned.contains_key(id) || created.objects.contains_key(id) {
            return Err(ServiceError::ObjectExists { name: name_of(id) });
        }
        Ok(None)
    }

    /// Adds an object, evicting others if necessary. If the request was repeated meanwhile, this returns the object that
    /// the other created.
    ///
    /// # Errors
    /// - Those of [`Self::repeated`].
    /// - [`ServiceError::Invalid`] if it is larger than the whole cache.
    /// - [`ServiceError::Overloaded`] if the objects that would have to be evicted are in use.
    pub(crate) fn insert(&self, object: StoredObject, origin: Origin) -> Result<Revision, ServiceError> {
        let mut created = self.created();
        if let Some(revision) = self.repeated_in(&created, &object.id, origin.request.as_ref())? {
            return Ok(revision);
        }
        let etag = created.etags.next();
        let revision = new_revision(object, origin.labels, etag, SystemTime::now());
        let bytes = revision.bytes();
        self.make_room(&mut created, None, bytes)?;
        let id = revision.object.id.clone();
        created.uses += 1;
        created.bytes += bytes;
        created.evicted.retain(|evicted| *evicted != id);
        if let Some(request) = &origin.request {
            created.requests.insert(request.id, id.clone());
        }
        let entry = Entry {
            revision: revision.clone(),
            request: origin.request,
            last_used: created.uses,
        };
        created.tell(&id, Event::Created, None, Some(&revision.record.labels));
        created.objects.insert(id, entry);
        Ok(revision)
    }

    /// The object with this id if a client may change it and it has the given etag.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectNotFound`].
    /// - [`ServiceError::ObjectReadOnly`] if the server started with it.
    /// - [`ServiceError::ObjectChanged`] if the etag is another one.
    pub(crate) fn changeable(&self, id: &str, etag: Option<&str>) -> Result<Revision, ServiceError> {
        self.check_changeable(id)?;
        let mut created = self.created();
        Ok(created.entry_with(id, etag)?.revision.clone())
    }

    /// Replaces the labels, and the object if there is a new one, of a state that [`Self::changeable`] returned. Evicts
    /// others if necessary.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectNotFound`] if it was deleted or evicted meanwhile.
    /// - [`ServiceError::ObjectChanged`] if it was changed meanwhile.
    /// - The errors of [`Self::insert`] about room.
    pub(crate) fn replace(
        &self,
        base: &Revision,
        labels: Labels,
        object: Option<StoredObject>,
    ) -> Result<Revision, ServiceError> {
        let id = &base.object.id;
        let mut created = self.created();
        let record = Arc::clone(&created.entry_with(id, Some(&base.record.etag))?.revision.record);
        let revision = Revision {
            object: object.map_or_else(|| Arc::clone(&base.object), Arc::new),
            record: Arc::new(Record {
                labels,
                etag: created.etags.next(),
                created: record.created,
                // The system's clock may have been set back.
                updated: SystemTime::now().max(record.updated),
            }),
        };
        let (old_bytes, bytes) = (base.bytes(), revision.bytes());
        self.make_room(&mut created, Some(id), bytes.saturating_sub(old_bytes))?;
        created.bytes = created.bytes - old_bytes + bytes;
        created.entry(id)?.revision = revision.clone();
        let (before, after) = (&record.labels, &revision.record.labels);
        created.tell(id, Event::Updated, Some(before), Some(after));
        Ok(revision)
    }

    /// Deletes an object.
    ///
    /// # Errors
    /// Those of [`Self::changeable`].
    pub(crate) fn remove(&self, id: &str, etag: Option<&str>) -> Result<(), ServiceError> {
        self.check_changeable(id)?;
        let mut created = self.created();
        created.entry_with(id, etag)?;
        created.take(id, Event::Deleted);
        Ok(())
    }

    /// Up to `query.size` objects, and whether there are more.
    pub(crate) fn page(&self, query: &PageQuery) -> (Vec<Revision>, bool) {
        let created = self.created();
        let all = self
            .pinned
            .values()
            .chain(created.objects.values().map(|entry| &entry.revision));
        let mut listed: Vec<_> = all
            .filter(|revision| query.filter.matches(&revision.record.labels))
            .map(|revision| (revision.place(), revision))
            .filter(|(place, _)| {
                let after = query.after.as_ref();
                after.is_none_or(|after| query.order.compare(after, place).is_lt())
            })
            .collect();
        let more = listed.len() > query.size;
        if more {
            listed.select_nth_unstable_by(query.size, |(a, _), (b, _)| query.order.compare(a, b));
            listed.truncate(query.size);
        }
        listed.sort_unstable_by(|(a, _), (b, _)| query.order.compare(a, b));
        let page = listed.into_iter().map(|(_, revision)| revision.clone());
        (page.collect(), more)
    }

    fn check_changeable(&self, id: &str) -> Result<(), ServiceError> {
        match self.pinned.get(id) {
            Some(pinned) => Err(ServiceError::ObjectReadOnly {
                name: pinned.object.name(),
            }),
            None => Ok(()),
        }
    }

    /// Evicts objects until so many more bytes fit: for a new object or, if there is one, for that which `grows`.
    fn make_room(
        &self,
        created: &mut Created,
        grows: Option<&str>,
        bytes: usize,
    ) -> Result<(), ServiceError> {
        let kept = grows.and_then(|id| created.objects.get(id));
        let whole = bytes + kept.map_or(0, |entry| entry.revision.bytes());
        if whole > self.limits.bytes {
            return Err(ServiceError::invalid(
                if grows.is_some() { "forbidden" } else { "mesh" },
                format!(
                    "takes about {whole} bytes with the object's search structures; the cache holds {}",
                    self.limits.bytes
                ),
            ));
        }
        let most = self.limits.objects - usize::from(grows.is_none());
        while created.objects.len() > most || created.bytes + bytes > self.limits.bytes {
            if !created.evict_one(grows) {
                return Err(ServiceError::Overloaded {
                    limit: Limit::ObjectCache,
                    maximum: self.limits.objects,
                    retry_after: RETRY_AFTER,
                });
            }
        }
        Ok(())
    }

    fn created(&self) -> MutexGuard<'_, Created> {
        // No code panics while it holds the lock; if some did, the map would still be consistent.
        self.created.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The first state of an object.
fn new_revision(object: StoredObject, labels: Labels, etag: String, now: SystemTime) -> Revision {
    Revision {
        object: Arc::new(object),
        record: Arc::new(Record {
            labels,
            etag,
            created: now,
            updated: now,
        }),
    }
}

impl Created {
    fn entry(&mut self, id: &str) -> Result<&mut Entry, ServiceError> {
        let evicted = &self.evicted;
        self.objects
            .get_mut(id)
            .ok_or_else(|| ServiceError::ObjectNotFound {
                name: name_of(id),
                evicted: evicted.iter().any(|evicted| evicted == id),
            })
    }

    /// The entry if it has the etag, or any if none is given.
    fn entry_with(&mut self, id: &str, etag: Option<&str>) -> Result<&mut Entry, ServiceError> {
        let entry = self.entry(id)?;
        let current = &entry.revision.record.etag;
        if let Some(etag) = etag.filter(|etag| etag != current) {
            return Err(ServiceError::ObjectChanged {
                name: name_of(id),
                etag: etag.to_owned(),
                current: current.clone(),
            });
        }
        Ok(entry)
    }

    /// Removes an object, if it exists.
    fn take(&mut self, id: &str, event: Event) {
        if let Some(entry) = self.objects.remove(id) {
            self.tell(id, event, Some(&entry.revision.record.labels), None);
            self.bytes -= entry.revision.bytes();
            if let Some(request) = entry.request {
                self.requests.remove(&request.id);
            }
        }
    }

    /// Evicts the least recently used object that no call uses, but not `kept`. False if there is none.
    fn evict_one(&mut self, kept: Option<&str>) -> bool {
        let oldest = self
            .objects
            .iter()
            .filter(|(id, entry)| kept != Some(id.as_str()) && !entry.revision.object.is_in_use())
            .min_by_key(|(_, entry)| entry.last_used)
            .map(|(id, _)| id.clone());
        let Some(id) = oldest else {
            return false;
        };
        self.take(&id, Event::Evicted);
        if self.evicted.len() == REMEMBERED_EVICTIONS {
            self.evicted.pop_front();
        }
        self.evicted.push_back(id);
        true
    }
}
