//! Loads saved objects: their records at the start, and each object when a call needs it.
//!
//! However many calls wait for an object, it is loaded once. Loading stops when none of them waits any more.

use std::{fmt, sync::Arc, time::UNIX_EPOCH};

use futures_util::{
    FutureExt as _,
    future::{BoxFuture, Shared, WeakShared},
};
use grasp_proto::v1;
use sha2::{Digest as _, Sha256};

use super::{Entry, Event, ObjectStore};
use crate::{
    access::Owner,
    error::ServiceError,
    executor::{run_blocking, run_stoppable},
    objects::{
        Body, Listed, Record, Revision, StoredObject,
        build::{build_object, change_given},
        id_of, name_of,
        saved::{MeshUses, SavedObject, SavedObjects, log_damage},
    },
    saved::StoreError,
    validate::{Labels, ObjectChange, Violations, saved_object_fields},
};

/// The object; `None` if it was replaced or deleted meanwhile.
type Outcome = Result<Option<Revision>, ServiceError>;

/// An object that is being loaded, as long as a call waits for it.
#[derive(Debug)]
pub(super) struct Load {
    resting: Arc<v1::GraspObject>,
    loading: WeakShared<BoxFuture<'static, Outcome>>,
}

impl ObjectStore {
    /// Reads the records of all saved objects, which are then at rest. Gives their number.
    pub(crate) async fn read_saved(&self) -> Result<usize, StoreError> {
        let Some(saved) = &self.saved else {
            return Ok(0);
        };
        let found = saved.read_all().await?;
        *self.changing() = found.mesh_uses;
        let mut created = self.created();
        for (id, saved) in found.objects {
            if self.pinned.contains_key(&id) {
                let object = name_of(&id);
                tracing::warn!(
                    object,
                    "a saved object is hidden by one of the same name that the server started with"
                );
            } else {
                created.add(resting_entry(&id, saved));
            }
        }
        Ok(created.objects.len())
    }

    /// The object with this id, loaded or at rest. If its record was damaged, it is read again: it may have been put back.
    pub(crate) async fn found(self: &Arc<Self>, id: &str) -> Result<Listed, ServiceError> {
        let got = self.get(id);
        let (Err(ServiceError::ObjectDamaged { .. }), Some(saved)) = (&got, &self.saved) else {
            return got;
        };
        match saved.record(id).await? {
            Ok(record) => self.revive(id, record).await?,
            Err(wrong) => log_damage(id, &wrong),
        }
        self.get(id)
    }

    /// Puts a record that is back in place of the damaged one.
    async fn revive(self: &Arc<Self>, id: &str, record: SavedObject) -> Result<(), ServiceError> {
        let id = id.to_owned();
        self.undisturbed(move |store, mesh_uses| {
            let mut created = store.created();
            if !created.objects.get(&id).is_some_and(|entry| entry.is_damaged) {
                return;
            }
            *mesh_uses.entry(record.mesh_hash()).or_default() += 1;
            tracing::info!(object = name_of(&id), "the record of an object is back");
            created.take(&id, Event::Updated);
            created.add(resting_entry(&id, Some(record.without_lists())));
        })
        .await
    }

    pub(crate) async fn saved_given(self: &Arc<Self>, id: &str) -> Result<v1::GraspObject, ServiceError> {
        Ok(self.whole_record(id).await?.given())
    }

    fn saved_objects(&self) -> Result<&SavedObjects, ServiceError> {
        self.saved.as_ref().ok_or(ServiceError::StoreFailed)
    }

    async fn whole_record(self: &Arc<Self>, id: &str) -> Result<SavedObject, ServiceError> {
        let saved = self.saved_objects()?;
        loop {
            let etag = self.get(id)?.record.etag.clone();
            match saved.record(id).await? {
                Ok(record) => return Ok(record),
                Err(wrong) => self.blame(id, etag, &wrong).await?,
            }
        }
    }

    /// The error of an object with this etag that could not be read. No error if the object was changed meanwhile.
    async fn blame(
        self: &Arc<Self>,
        id: &str,
        etag: String,
        wrong: &(dyn fmt::Display + Sync),
    ) -> Result<(), ServiceError> {
        let of = id.to_owned();
        let now = self.undisturbed(move |store, _| store.get(&of));
        if now.await??.record.etag != etag {
            return Ok(());
        }
        log_damage(id, wrong);
        Err(ServiceError::ObjectDamaged { name: name_of(id) })
    }

    /// Runs `work` once all changes in progress have ended.
    async fn undisturbed<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Self, &mut MeshUses) -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        let turn = Arc::clone(&self.saved_objects()?.turn).acquire_owned().await;
        let turn = turn.map_err(|_| ServiceError::ShuttingDown)?;
        let store = Arc::clone(self);
        run_blocking(move || {
            let _turn = turn;
            work(&store, &mut store.changing())
        })
        .await
    }

    /// The object with this id, loaded if necessary. It is not evicted while its `object` is held.
    ///
    /// # Errors
    /// [`ServiceError::ObjectNotFound`]; [`ServiceError::ObjectDamaged`], [`ServiceError::ObjectUnloadable`] and
    /// [`ServiceError::StoreFailed`] if it cannot be loaded; [`ServiceError::Overloaded`] if the full cache is in use.
    pub(crate) async fn loaded(self: &Arc<Self>, id: &str) -> Result<Revision, ServiceError> {
        loop {
            let loaded = match self.get(id)?.loaded() {
                Ok(loaded) => Some(loaded),
                Err(resting) => self.load(resting).await?,
            };
            if let Some(revision) = loaded {
                return Ok(revision);
            }
        }
    }

    /// Joins the loading of an object, or starts it.
    fn load(self: &Arc<Self>, resting: Arc<v1::GraspObject>) -> Shared<BoxFuture<'static, Outcome>> {
        let mut created = self.created();
        created.loads.retain(|load| load.loading.upgrade().is_some());
        let mut loads = created.loads.iter();
        let same = loads.find(|load| Arc::ptr_eq(&load.resting, &resting));
        if let Some(loading) = same.and_then(|load| load.loading.upgrade()) {
            return loading;
        }
        let store = Arc::clone(self);
        let of = Arc::clone(&resting);
        let loading = async move { store.load_now(&of).await }.boxed().shared();
        // Downgrading fails only once a future has ended, and this one has yet to start.
        if let Some(weak) = loading.downgrade() {
            created.loads.push(Load {
                resting,
                loading: weak,
            });
        }
        loading
    }

    async fn load_now(self: &Arc<Self>, resting: &Arc<v1::GraspObject>) -> Outcome {
        let id = id_of(&resting.name);
        let read = self.read_and_build(id, None).await;
        {
            let mut created = self.created();
            let state = created.objects.get(id).map(|entry| entry.state.clone());
            let is_same =
                |state: &Listed| matches!(&state.body, Body::AtRest(now) if Arc::ptr_eq(now, resting));
            // An error of a replaced state is not one of the present state.
            let Some(mut state) = state.filter(is_same) else {
                return Ok(None);
            };
            let (object, etag) = read?;
            if etag == state.record.etag || !self.is_changing() {
                state.body = Body::Loaded(Arc::new(object));
                let reserved = self.reserve(&mut created, None, state.bytes(), 1)?;
                reserved.release(&mut created);
                created.set_state(id, &state);
                return Ok(state.loaded().ok());
            }
        }
        // It was read from a change that is being saved, and may yet fail.
        self.undisturbed(|_, _| ()).await?;
        Ok(None)
    }

    /// The object as it would be created with a change. `None` if its file is not saved.
    pub(crate) async fn rebuilt(
        self: &Arc<Self>,
        id: &str,
        change: &ObjectChange,
    ) -> Result<Option<StoredObject>, ServiceError> {
        if self.saved.is_none() {
            return Ok(None);
        }
        let (object, _) = self.read_and_build(id, Some(change)).await?;
        Ok(Some(object))
    }

    /// The object as it is saved, or with a change, and the etag of what is saved.
    async fn read_and_build(
        self: &Arc<Self>,
        id: &str,
        change: Option<&ObjectChange>,
    ) -> Result<(StoredObject, String), ServiceError> {
        loop {
            let etag = self.get(id)?.record.etag.clone();
            if let Some(read) = self.try_read_and_build(id, change).await? {
                return Ok(read);
            }
            let wrong = "its mesh is missing, or its SHA-256 is wrong";
            self.blame(id, etag, &wrong).await?;
        }
    }

    /// One attempt at that. `None` if its mesh is missing or does not match its record.
    async fn try_read_and_build(
        self: &Arc<Self>,
        id: &str,
        change: Option<&ObjectChange>,
    ) -> Result<Option<(StoredObject, String)>, ServiceError> {
        let saved = self.saved_objects()?;
        let acquired = Arc::clone(&saved.loads).acquire_owned().await;
        let permit = acquired.map_err(|_| ServiceError::ShuttingDown)?;
        let record = self.whole_record(id).await?;
        let limits = saved.limits;
        let (mesh, room) = saved.mesh(&record).await?;
        let hash = record.mesh_hash();
        let mut given = record.given();
        let etag = std::mem::take(&mut given.etag);
        if let Some(change) = change {
            change_given(&mut given, change);
        }
        let built = run_stoppable(None, move |stop| {
            // Moved into the work, which may go on for some milliseconds when nobody waits.
            let _permits = (permit, room);
            let mesh = mesh.filter(|mesh| Sha256::digest(mesh).as_slice() == hash);
            let Some(mesh) = mesh else { return Ok(None) };
            let violations = Violations::default();
            let fields = saved_object_fields(given, mesh.into(), &violations);
            let object = build_object(&fields, limits, violations, stop)?;
            Ok(Some((object, etag)))
        });
        match built.await? {
            // Its request was valid under the limits at its creation.
            Err(error @ ServiceError::Invalid(_)) if change.is_none() => {
                let (name, reason) = (name_of(id), error.to_string());
                Err(ServiceError::ObjectUnloadable { name, reason })
            }
            built => built,
        }
    }
}

/// The entry of an object that was saved before. Without its record, which is damaged, all but its name is missing.
fn resting_entry(id: &str, saved: Option<SavedObject>) -> Entry {
    let record = saved.as_ref().and_then(SavedObject::record);
    let is_damaged = record.is_none();
    let record = record.unwrap_or_else(|| Record {
        labels: Labels::new(),
        // Nobody knows any more.
        owner: Owner::default(),
        etag: String::new(),
        created: UNIX_EPOCH,
        updated: UNIX_EPOCH,
    });
    let request = saved.as_ref().and_then(SavedObject::request_key);
    let mesh = saved.as_ref().map(SavedObject::mesh_hash);
    let mesh_bytes = saved.as_ref().map_or(0, SavedObject::mesh_bytes);
    let warning = "its record is damaged or missing; put the file back, or delete the object";
    let damaged = || v1::GraspObject {
        name: name_of(id),
        warnings: vec![warning.to_owned()],
        ..Default::default()
    };
    let description = saved.map_or_else(damaged, SavedObject::description);
    Entry {
        state: Listed {
            body: Body::AtRest(Arc::new(description)),
            record: Arc::new(record),
        },
        request,
        mesh,
        mesh_bytes,
        last_used: 0,
        is_damaged,
    }
}
