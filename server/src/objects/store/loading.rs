//! Loads saved objects: their records at the start, and each object when a call needs it.
//!
//! However many calls wait for an object, it is loaded once. Loading stops when none of them waits any more.

use std::sync::Arc;

use futures_util::{
    FutureExt as _,
    future::{BoxFuture, Shared, WeakShared},
};
use grasp_import::MeshLimits;
use grasp_proto::v1;
use tokio::sync::Semaphore;

use super::{Entry, ObjectStore};
use crate::{
    error::ServiceError,
    executor::run_stoppable,
    objects::{
        Body, Listed, Resting, Revision, StoredObject,
        build::build_object,
        change::change_request,
        name_of,
        saved::{SavedObject, SavedObjects},
    },
    saved::StoreError,
    validate::{ObjectChange, Violations, object_fields},
};

/// Bytes per permit of the pool that meshes being loaded share.
const BYTES_PER_PERMIT: usize = 1 << 10;

/// The object, or none if it was replaced or deleted meanwhile.
type Outcome = Result<Option<Revision>, ServiceError>;

/// An object that is being loaded, as long as a call waits for it.
#[derive(Debug)]
pub(super) struct Load {
    resting: Arc<Resting>,
    loading: WeakShared<BoxFuture<'static, Outcome>>,
}

/// How saved objects are loaded.
#[derive(Debug)]
pub(crate) struct Loading {
    /// Bounds on meshes.
    limits: MeshLimits,
    /// One permit per object that may be loaded at a time.
    objects: Arc<Semaphore>,
    /// Permits for the bytes of their mesh files.
    bytes: Arc<Semaphore>,
}

impl Loading {
    /// Loads so many objects at a time, with mesh files of `limits.bytes` together and thus each.
    pub(crate) fn new(limits: MeshLimits, at_a_time: usize) -> Self {
        Self {
            limits,
            objects: Arc::new(Semaphore::new(at_a_time)),
            bytes: Arc::new(Semaphore::new(limits.bytes.div_ceil(BYTES_PER_PERMIT))),
        }
    }
}

/// Where objects are saved, and how they are loaded from there.
#[derive(Debug)]
pub(crate) struct Durability {
    /// Where objects are saved.
    pub saved: SavedObjects,
    /// How they are loaded.
    pub loading: Loading,
}

impl ObjectStore {
    /// Reads the records of all saved objects, which are then at rest. Gives their number.
    ///
    /// # Errors
    /// They cannot be read.
    pub(crate) async fn read_saved(&self) -> Result<usize, StoreError> {
        let Some(Durability { saved, .. }) = &self.durability else {
            return Ok(0);
        };
        let found = saved.read_all().await?;
        let mut mesh_uses = self.changing();
        let mut created = self.created();
        *mesh_uses = found.mesh_uses;
        for (id, saved) in found.objects {
            if self.pinned.contains_key(&id) {
                tracing::warn!(
                    object = name_of(&id),
                    "a saved object is hidden by one of the same name that the server started with"
                );
            } else if let Some(entry) = resting_entry(id, saved) {
                created.add(entry);
            }
        }
        Ok(created.objects.len())
    }

    /// The request that would create an object at rest, without its mesh.
    ///
    /// # Errors
    /// [`ServiceError::ObjectDamaged`] and [`ServiceError::StoreFailed`].
    pub(crate) async fn saved_request(&self, id: &str) -> Result<v1::CreateObjectRequest, ServiceError> {
        let Some(Durability { saved, .. }) = &self.durability else {
            return Err(ServiceError::StoreFailed);
        };
        Ok(saved.record(id).await?.request)
    }

    /// The object with this id, loaded if necessary. It is not evicted while its `object` is held.
    ///
    /// # Errors
    /// - [`ServiceError::ObjectNotFound`].
    /// - [`ServiceError::ObjectDamaged`], [`ServiceError::ObjectUnloadable`] and [`ServiceError::StoreFailed`] if it
    ///   cannot be loaded.
    /// - [`ServiceError::Overloaded`] if the objects that would have to be evicted are in use.
    pub(crate) async fn loaded(self: &Arc<Self>, id: &str) -> Result<Revision, ServiceError> {
        loop {
            let state = self.get(id)?;
            let resting = match state.body {
                Body::Loaded(object) => {
                    return Ok(Revision {
                        object,
                        record: state.record,
                    });
                }
                Body::AtRest(resting) => resting,
            };
            if let Some(revision) = self.load(resting).await? {
                return Ok(revision);
            }
        }
    }

    /// Joins the loading of an object, or starts it.
    fn load(self: &Arc<Self>, resting: Arc<Resting>) -> Shared<BoxFuture<'static, Outcome>> {
        let mut created = self.created();
        created.loads.retain(|load| load.loading.upgrade().is_some());
        let same = created
            .loads
            .iter()
            .find(|load| Arc::ptr_eq(&load.resting, &resting));
        if let Some(loading) = same.and_then(|load| load.loading.upgrade()) {
            return loading;
        }
        let store = Arc::clone(self);
        let of = Arc::clone(&resting);
        let loading = async move { store.load_now(&of).await }.boxed().shared();
        // Only one that has ended cannot be downgraded, and this one has yet to start.
        if let Some(weak) = loading.downgrade() {
            created.loads.push(Load {
                resting,
                loading: weak,
            });
        }
        loading
    }

    async fn load_now(&self, resting: &Arc<Resting>) -> Outcome {
        let object = self.read_and_build(&resting.id, None).await;
        let mut created = self.created();
        let state = created.objects.get(&resting.id).map(|entry| entry.state.clone());
        let is_same = |state: &Listed| matches!(&state.body, Body::AtRest(now) if Arc::ptr_eq(now, resting));
        // What went wrong with a state that is no more is no error of the present one.
        let Some(state) = state.filter(is_same) else {
            return Ok(None);
        };
        let revision = Revision {
            object: Arc::new(object?),
            record: state.record,
        };
        let state = Listed::from(revision.clone());
        self.make_room(&mut created, None, state.bytes(), 1)?;
        created.set_state(&resting.id, state);
        Ok(Some(revision))
    }

    /// The object as it would be created with a change; none if its file is not saved.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`], and those of [`Self::loaded`] but for the first.
    pub(crate) async fn rebuilt(
        &self,
        id: &str,
        change: &ObjectChange,
    ) -> Result<Option<StoredObject>, ServiceError> {
        if self.durability.is_none() {
            return Ok(None);
        }
        self.read_and_build(id, Some(change)).await.map(Some)
    }

    async fn read_and_build(
        &self,
        id: &str,
        change: Option<&ObjectChange>,
    ) -> Result<StoredObject, ServiceError> {
        let Some(Durability { saved, loading }) = &self.durability else {
            return Err(ServiceError::StoreFailed);
        };
        let acquired = Arc::clone(&loading.objects).acquire_owned().await;
        let permit = acquired.map_err(|_| ServiceError::ShuttingDown)?;
        let mut record = saved.record(id).await?;
        if let Some(change) = change {
            change_request(&mut record.request, change);
        }
        let limits = loading.limits;
        if record.mesh_bytes > limits.bytes as u64 {
            return Err(ServiceError::ObjectUnloadable {
                name: name_of(id),
                reason: format!(
                    "its mesh has {} bytes; the limit is {}",
                    record.mesh_bytes, limits.bytes
                ),
            });
        }
        let permits = (record.mesh_bytes as usize).div_ceil(BYTES_PER_PERMIT) as u32;
        let acquired = Arc::clone(&loading.bytes).acquire_many_owned(permits).await;
        let room = acquired.map_err(|_| ServiceError::ShuttingDown)?;
        let mesh = saved.mesh(&record).await?;
        let hash = record.mesh_hash();
        let built = run_stoppable(None, move |stop| {
            // Moved into the work, which may go on for some milliseconds when nobody waits.
            let _permits = (permit, room);
            let mesh = mesh.filter(|mesh| SavedObjects::is_mesh(mesh, hash));
            let Some(mesh) = mesh else { return Ok(None) };
            let request = v1::CreateObjectRequest {
                mesh: mesh.into(),
                ..record.request
            };
            let mut violations = Violations::default();
            let fields = object_fields(request, limits.bytes, &mut violations);
            build_object(&fields, limits, violations, stop).map(Some)
        });
        match built.await? {
            Ok(Some(object)) => Ok(object),
            Ok(None) => {
                if let Some(hash) = hash {
                    saved.move_mesh_aside(&hash).await?;
                }
                Err(ServiceError::ObjectDamaged { name: name_of(id) })
            }
            // Its request was valid under the limits of its time.
            Err(error @ ServiceError::Invalid(_)) if change.is_none() => {
                Err(ServiceError::ObjectUnloadable {
                    name: name_of(id),
                    reason: error.to_string(),
                })
            }
            Err(error) => Err(error),
        }
    }
}

/// The entry of an object that was saved before; none if its record is incomplete.
fn resting_entry(id: String, saved: SavedObject) -> Option<Entry> {
    let record = Arc::new(saved.record()?);
    let (request, mesh) = (saved.request_key(), saved.mesh_hash());
    let resting = Resting {
        id,
        description: saved.description,
    };
    Some(Entry {
        state: Listed {
            body: Body::AtRest(Arc::new(resting)),
            record,
        },
        request,
        mesh,
        last_used: 0,
    })
}
