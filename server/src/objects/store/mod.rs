//! Objects by name. Built-in ones and those of the objects directory stay as they are; created ones can be changed and
//! deleted.
//!
//! Created objects make room in the [`cache`] for others. If objects are saved, they are put to rest: only their description stays
//! in memory, and they are loaded again when a call needs them. Otherwise they are evicted, and the error for an evicted object says
//! so, so that its client creates it again.
//!
//! Labels and times are kept here, not in the object: a change of them leaves its atlases and its searches alone.

mod cache;
mod created;
mod figures;
mod loading;
#[cfg(all(test, shuttle))]
mod orders;
#[cfg(test)]
mod tests;
mod watching;

use std::{
    collections::BTreeMap,
    sync::{Arc, TryLockError},
    time::{Duration, SystemTime},
};

use bytes::Bytes;
use grasp_assets::objects::{object, objects};
use sha2::{Digest as _, Sha256};

use self::created::{Created, Entry};
pub(crate) use self::{
    cache::{Need, SizeSlot},
    watching::{Event, Report},
};
use super::{
    Body, Listed, Record, StoredObject,
    directory::PinnedObject,
    name_of,
    saved::{MeshHash, MeshUses, SavedObject, SavedObjects, log_damage},
};
use crate::{
    access::{Caller, Owner},
    error::ServiceError,
    limits::StoreLimits,
    saved::CreateFailure,
    sync::{Mutex, MutexGuard, locked, wait_for},
    validate::{Labels, PageQuery, RequestKey},
};

/// When to retry if every object in the full cache is in use: searches end within seconds.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// If objects are saved, the methods that add, change or delete one wait for the disk or network. They are for threads that
/// may block, in the context of the async runtime.
#[derive(Debug)]
pub(crate) struct ObjectStore {
    /// Objects that the server started with; never changed or evicted.
    pinned: BTreeMap<String, Listed>,
    /// Held while an object is added, changed or deleted, so that saved objects and those in memory agree.
    mesh_uses: Mutex<MeshUses>,
    created: Mutex<Created>,
    limits: StoreLimits,
    /// `None` if objects are in memory only.
    saved: Option<SavedObjects>,
}

/// Data that comes with a new object.
#[derive(Clone, Debug, Default)]
pub(crate) struct Origin {
    pub labels: Labels,
    /// Identifies the request, if it may be repeated.
    pub request: Option<RequestKey>,
    /// The mesh file.
    pub mesh: Bytes,
    /// Who creates it, and owns it then.
    pub caller: Caller,
}

pub(crate) fn is_built_in(id: &str) -> bool {
    object(id).is_some()
}

impl ObjectStore {
    /// A store of the built-in objects and those of the objects directory, whose ids must all differ. Created objects
    /// outlast it if they are `saved`.
    pub(crate) fn new(
        limits: StoreLimits,
        directory: Vec<PinnedObject>,
        saved: Option<SavedObjects>,
    ) -> Self {
        let built_in = objects().iter().map(|built_in| PinnedObject {
            object: StoredObject::built_in(built_in.name.to_owned(), Arc::clone(&built_in.object)),
            labels: Labels::new(),
        });
        let now = SystemTime::now();
        let mut created = Created::new(now);
        let pinned = built_in.chain(directory).map(|pinned| {
            let state = new_state(
                pinned.object,
                pinned.labels,
                created.next_etag(),
                now,
                Owner::default(),
            );
            (state.id().to_owned(), state)
        });
        Self {
            pinned: pinned.collect(),
            mesh_uses: Mutex::default(),
            created: Mutex::new(created),
            limits,
            saved,
        }
    }

    pub(crate) fn pinned(&self) -> impl Iterator<Item = &Arc<StoredObject>> {
        self.pinned.values().filter_map(Listed::object)
    }

    pub(crate) fn contains(&self, id: &str) -> bool {
        self.pinned.contains_key(id) || self.created().objects.contains_key(id)
    }

    /// The object with this id, loaded or at rest.
    pub(crate) fn get(&self, id: &str) -> Result<Listed, ServiceError> {
        match self.pinned.get(id) {
            Some(state) => Ok(state.clone()),
            None => Ok(self.created().used_entry(id)?.state.clone()),
        }
    }

    /// The object that an earlier request with this key created. `None` if the id is free.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectExists`] if the id is taken.
    /// - [`ServiceError::RequestIdReused`] if a request of the same owner with the same id and other content created an object.
    /// - [`ServiceError::QuotaExceeded`].
    pub(crate) fn repeated(&self, id: &str, origin: &Origin) -> Result<Option<Listed>, ServiceError> {
        self.repeated_in(&self.created(), id, origin)
    }

    fn repeated_in(
        &self,
        created: &Created,
        id: &str,
        origin: &Origin,
    ) -> Result<Option<Listed>, ServiceError> {
        if let Some(request) = &origin.request
            && let Some(of) = created.requests.get(&(origin.caller.owner(), request.id))
        {
            let entry = created.objects.get(of);
            return match entry.filter(|entry| entry.request.as_ref() == Some(request)) {
                Some(entry) => Ok(Some(entry.state.clone())),
                None => Err(ServiceError::RequestIdReused {
                    request_id: request.id.to_string(),
                    name: name_of(of),
                }),
            };
        }
        if self.pinned.contains_key(id) || created.objects.contains_key(id) {
            return Err(ServiceError::ObjectExists { name: name_of(id) });
        }
        created.check_quotas(&origin.caller, origin.mesh.len() as u64)?;
        Ok(None)
    }

    /// Saves and adds an object, making room if necessary. If the request was repeated meanwhile, this returns the object
    /// that the other created.
    ///
    /// # Errors
    /// Those of [`Self::repeated`], [`ServiceError::Invalid`] if it is larger than the whole cache, [`ServiceError::Overloaded`] if
    /// everything that could make room is in use, [`ServiceError::ObjectsFull`], and [`ServiceError::StoreFailed`].
    pub(crate) fn insert(&self, object: StoredObject, origin: Origin) -> Result<Listed, ServiceError> {
        let mut mesh_uses = self.changing();
        let reserved;
        let state = {
            let mut created = self.created();
            if let Some(state) = self.repeated_in(&created, &object.id, &origin)? {
                return Ok(state);
            }
            if let Some(&SavedObjects { maximum, .. }) = self.saved.as_ref()
                && created.objects.len() >= maximum
            {
                return Err(ServiceError::ObjectsFull { maximum });
            }
            let etag = created.next_etag();
            let state = new_state(
                object,
                origin.labels,
                etag,
                SystemTime::now(),
                origin.caller.owner(),
            );
            reserved = self.reserve(&mut created, None, state.bytes(), 1)?;
            state
        };
        let mesh_bytes = origin.mesh.len() as u64;
        let saved = self.save_new(&mut mesh_uses, &state, origin.request, origin.mesh);
        let mut created = self.created();
        reserved.release(&mut created);
        let mesh = saved?;
        let last_used = created.tick();
        created.tell(state.id(), Event::Created, None, Some(&state.record.labels));
        created.add(Entry {
            state: state.clone(),
            request: origin.request,
            mesh,
            mesh_bytes,
            last_used,
            is_damaged: false,
        });
        Ok(state)
    }

    /// Saves a new object if objects are saved; gives the hash of its mesh then.
    fn save_new(
        &self,
        mesh_uses: &mut MeshUses,
        state: &Listed,
        request: Option<RequestKey>,
        mesh: Bytes,
    ) -> Result<Option<MeshHash>, ServiceError> {
        let (Some(saved), Some(object)) = (&self.saved, state.object()) else {
            return Ok(None);
        };
        let hash: MeshHash = Sha256::digest(&mesh).into();
        let record = SavedObject::new(object, &state.record, request, hash, mesh.len());
        *mesh_uses.entry(hash).or_default() += 1;
        let mut ids = self.ids();
        ids.push(object.id.clone());
        let created = wait_for(saved.create(&record, mesh, ids));
        if let Err(CreateFailure { is_undone }) = created {
            if is_undone {
                self.forget_mesh(mesh_uses, &hash);
            }
            return Err(ServiceError::StoreFailed);
        }
        Ok(Some(hash))
    }

    fn ids(&self) -> Vec<String> {
        self.created().objects.keys().cloned().collect()
    }

    /// Ends a record's use of a mesh, and deletes the mesh if it was the last.
    fn forget_mesh(&self, mesh_uses: &mut MeshUses, hash: &MeshHash) {
        let Some(uses) = mesh_uses.get_mut(hash) else {
            return;
        };
        *uses -= 1;
        if *uses == 0 {
            mesh_uses.remove(hash);
            if let Some(saved) = &self.saved {
                wait_for(saved.delete_mesh(hash));
            }
        }
    }

    /// The object with this id if a client may change it and it has the given etag.
    ///
    /// # Errors
    /// [`ServiceError::ObjectNotFound`], [`ServiceError::ObjectReadOnly`] if the server started with it,
    /// [`ServiceError::ObjectChanged`] if the etag is another one, [`ServiceError::ObjectDamaged`].
    pub(crate) fn changeable(&self, id: &str, etag: Option<&str>) -> Result<Listed, ServiceError> {
        self.check_changeable(id)?;
        let mut created = self.created();
        created.entry_with(id, etag)?;
        Ok(created.used_entry(id)?.state.clone())
    }

    /// Replaces the labels of a state that [`Self::changeable`] returned, and the object if there is a changed one. Makes
    /// room if necessary.
    ///
    /// # Errors
    /// Those of [`Self::changeable`] if it was deleted, evicted or changed meanwhile, and those of [`Self::insert`] about room and saving.
    pub(crate) fn replace(
        &self,
        base: &Listed,
        labels: Labels,
        changed: Option<StoredObject>,
    ) -> Result<Listed, ServiceError> {
        let id = base.id();
        let _changing = self.changing();
        let changed = changed.map(Arc::new);
        let (reserved, _held);
        let (before, record) = {
            let mut created = self.created();
            let etag = created.next_etag();
            let before = created.entry_with(id, Some(&base.record.etag))?.state.clone();
            // It keeps its room until it is replaced.
            _held = before.object().map(|object| object.hold());
            let record = Arc::new(Record {
                labels,
                owner: before.record.owner.clone(),
                etag,
                created: before.record.created,
                // The system's clock may have been set back.
                updated: SystemTime::now().max(before.record.updated),
            });
            let after = with(&before, changed.as_ref(), &record);
            let more = after.bytes().saturating_sub(before.bytes());
            let more_objects = usize::from(before.object().is_none() && changed.is_some());
            reserved = self.reserve(&mut created, Some(id), more, more_objects)?;
            (before.record, record)
        };
        let saved = self.save_change(id, &record, changed.as_deref());
        let mut created = self.created();
        reserved.release(&mut created);
        saved?;
        // It may have been loaded meanwhile.
        let after = with(&created.used_entry(id)?.state, changed.as_ref(), &record);
        created.set_state(id, &after);
        created.tell(id, Event::Updated, Some(&before.labels), Some(&record.labels));
        Ok(after)
    }

    fn save_change(
        &self,
        id: &str,
        record: &Record,
        changed: Option<&StoredObject>,
    ) -> Result<(), ServiceError> {
        let Some(saved) = &self.saved else {
            return Ok(());
        };
        let before = wait_for(saved.record(id))?.map_err(|wrong| {
            log_damage(id, &wrong);
            ServiceError::ObjectDamaged { name: name_of(id) }
        })?;
        let mut object = before.clone();
        object.set(changed, record);
        let written = wait_for(saved.write(&object)).map_err(ServiceError::from);
        written.inspect_err(|_| {
            // A write that failed late may have changed the record. If this fails too, the log says so.
            let _ = wait_for(saved.write(&before)).map_err(ServiceError::from);
        })
    }

    /// Removes an object of the caller or of everybody.
    ///
    /// # Errors
    /// Those of [`Self::changeable`], and [`ServiceError::NotOwner`].
    pub(crate) fn remove(&self, id: &str, etag: Option<&str>, caller: &Caller) -> Result<(), ServiceError> {
        self.check_changeable(id)?;
        let mut mesh_uses = self.changing();
        let mesh = {
            let mut created = self.created();
            caller.check_owns(&name_of(id), &created.entry(id)?.state.record.owner)?;
            created.entry_with(id, etag)?.mesh
        };
        if let Some(saved) = &self.saved {
            let mut others = self.ids();
            others.retain(|other| other != id);
            wait_for(saved.records.delete(id, others))?;
            if let Some(hash) = mesh {
                self.forget_mesh(&mut mesh_uses, &hash);
            }
        }
        self.created().take(id, Event::Deleted);
        Ok(())
    }

    /// Up to `query.size` objects, and whether there are more.
    pub(crate) fn page(&self, query: &PageQuery) -> (Vec<Listed>, bool) {
        let created = self.created();
        let made = created.objects.values().map(|entry| &entry.state);
        let all = self.pinned.values().chain(made);
        let mut listed: Vec<_> = all
            .filter(|state| query.filter.matches(state.id(), &state.record.labels))
            .map(|state| (state.place(), state))
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
        (listed.into_iter().map(|(_, state)| state.clone()).collect(), more)
    }

    fn check_changeable(&self, id: &str) -> Result<(), ServiceError> {
        if self.pinned.contains_key(id) {
            return Err(ServiceError::ObjectReadOnly { name: name_of(id) });
        }
        Ok(())
    }

    fn created(&self) -> MutexGuard<'_, Created> {
        locked(&self.created)
    }

    fn is_changing(&self) -> bool {
        matches!(self.mesh_uses.try_lock(), Err(TryLockError::WouldBlock))
    }

    /// Waits until no other call adds, changes or deletes an object, and keeps them waiting.
    fn changing(&self) -> MutexGuard<'_, MeshUses> {
        locked(&self.mesh_uses)
    }
}

fn new_state(object: StoredObject, labels: Labels, etag: String, now: SystemTime, owner: Owner) -> Listed {
    Listed {
        body: Body::Loaded(Arc::new(object)),
        record: Arc::new(Record {
            labels,
            owner,
            etag,
            created: now,
            updated: now,
        }),
    }
}

/// A state with another record, and another object if there is one.
fn with(state: &Listed, object: Option<&Arc<StoredObject>>, record: &Arc<Record>) -> Listed {
    let body = object.map(|object| Body::Loaded(Arc::clone(object)));
    Listed {
        body: body.unwrap_or_else(|| state.body.clone()),
        record: Arc::clone(record),
    }
}
