//! The handlers of the gRPC services.

mod grasps;
mod object_streams;
mod objects;
mod rigs;
mod streaming;
mod tracks;

use std::{
    ops::Deref,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Instant,
};

use tokio::sync::{Semaphore, watch};
use tokio_util::sync::CancellationToken;

#[cfg(fuzzing)]
pub(crate) use self::rigs::build_rig;
pub(crate) use self::{
    object_streams::{upload_places, watcher_places},
    rigs::load_saved_rigs,
};

use crate::{
    atlases::Atlases,
    budget::DeadlineReserve,
    call::CallContext,
    config::Config,
    error::ServiceError,
    executor::{SearchExecutor, before, run_blocking, run_stoppable},
    limits::{ClientPermits, Places},
    metrics::Metrics,
    net::Connections,
    objects::{
        Derived, Revision, StoredObject,
        derived::Resizer,
        store::{Need, ObjectStore},
    },
    rigs::store::RigStore,
    track::OpenTracks,
    validate::{Field, Violations},
};

/// Number of newest objects that are prepared for their first calls.
const MAX_PREPARED_AHEAD: u64 = 16;

/// State shared by the handlers.
#[derive(Debug)]
pub(crate) struct Shared {
    pub config: Config,
    pub objects: Arc<ObjectStore>,
    pub rigs: Arc<RigStore>,
    pub atlases: Atlases,
    pub executor: SearchExecutor,
    pub metrics: Arc<Metrics>,
    pub resizer: Resizer,
    /// The part of deadlines kept for answers.
    pub reserve: Arc<DeadlineReserve>,
    /// One permit: deletions queue here without holding a thread, or they could take all threads that wait for the disk.
    pub deletions: Arc<Semaphore>,
    /// A place per byte of all uploads in pieces together.
    pub upload_bytes: Places,
    pub watchers: Places,
    pub tracks: Arc<OpenTracks>,
    /// Has a receiver per call in flight.
    pub calls: watch::Sender<()>,
    /// Answers that wait for clients to read them.
    pub connections: Arc<Connections>,
    /// Cancelled when the server begins to shut down, which ends streams without an end of their own.
    pub shutdown: CancellationToken,
    /// One permit per object that may be prepared for searches at a time.
    pub deriving: Arc<Semaphore>,
    /// Permits of each client to build or prepare something: the rest of its work waits without delaying that of others.
    pub heavy: Arc<ClientPermits>,
    /// Permits of each client to judge grasps or rate holdouts.
    pub examining: ClientPermits,
    /// One permit: new objects are prepared ahead of calls one at a time.
    pub ahead: Semaphore,
    pub created: AtomicU64,
}

/// Implements the services.
#[derive(Clone, Debug)]
pub(crate) struct Handler(pub(crate) Arc<Shared>);

impl Deref for Handler {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}

impl Shared {
    /// The default rig's name and the rigs.
    fn known_rigs(&self) -> (&str, &RigStore) {
        (&self.config.default_rig, &self.rigs)
    }

    /// Whether there is an object with an id, for checks of requests.
    fn exists(&self) -> impl Fn(&str) -> bool {
        |id| self.objects.contains(id)
    }

    /// The object with this id, ready for searches: loaded, if it was at rest, before the call's deadline.
    async fn object(&self, id: &str, call: &CallContext) -> Result<Revision, ServiceError> {
        if let Ok(revision) = self.objects.found(id).await?.loaded() {
            return Ok(revision);
        }
        let revision = before(call.answer_due(), self.objects.loaded(id)).await??;
        self.atlases.register(&revision.object);
        Ok(revision)
    }

    /// The data derived from an object, built before the call's deadline unless another call is building it, and prepared for the
    /// hands of the default rig.
    async fn derived(
        &self,
        object: &Arc<StoredObject>,
        call: &CallContext,
    ) -> Result<Arc<Derived>, ServiceError> {
        let rig = &self.config.default_rig;
        if let Some(kept) = self.objects.kept(object, Need::Call)
            && kept.is_prepared(rig)
        {
            return Ok(kept);
        }
        let due = call.answer_due();
        let turn = before(due, self.heavy.acquire(&call.client)).await?;
        let permit = before(due, Arc::clone(&self.deriving).acquire_owned()).await?;
        let permit = permit.map_err(|_| ServiceError::ShuttingDown)?;
        let start = Instant::now();
        let (objects, object, rig) = (Arc::clone(&self.objects), Arc::clone(object), rig.clone());
        let derived = run_stoppable(due, move |stop| {
            let _permits = (turn, permit);
            let derived = objects.derived(&object, Need::Call, stop)?;
            derived.prepare(&rig, stop)?;
            Ok::<_, ServiceError>(derived)
        });
        let derived = derived.await?;
        call.prepared_since(start);
        derived
    }
}

impl Handler {
    /// Deletes something when it is this deletion's turn.
    async fn delete_in_turn(
        &self,
        delete: impl FnOnce(&Shared) -> Result<(), ServiceError> + Send + 'static,
    ) -> Result<(), ServiceError> {
        let turn = Arc::clone(&self.deletions).acquire_owned().await;
        let turn = turn.map_err(|_| ServiceError::ShuttingDown)?;
        let handler = self.clone();
        run_blocking(move || {
            let _turn = turn;
            delete(&handler)
        })
        .await?
    }

    /// Prepares a new object for calls when its turn comes, unless many newer ones wait.
    fn derive_ahead(&self, object: &Arc<StoredObject>) {
        let number = self.created.fetch_add(1, Ordering::Relaxed);
        let (handler, object) = (self.clone(), Arc::downgrade(object));
        let shutdown = self.shutdown.clone();
        let derive = async move {
            let Ok(_turn) = handler.ahead.acquire().await else {
                return;
            };
            let newer = handler.created.load(Ordering::Relaxed) - number;
            let Some(object) = object.upgrade().filter(|_| newer <= MAX_PREPARED_AHEAD) else {
                return;
            };
            let (deriver, of) = (handler.clone(), Arc::clone(&object));
            let derived = run_stoppable(None, move |stop| {
                // A copy, which shares all of it but does not keep the object from being evicted.
                let derived = Derived::clone(&*deriver.objects.derived(&of, Need::Ahead, stop)?);
                Ok::<_, ServiceError>(derived.prepare(&deriver.config.default_rig, stop)?)
            })
            .await;
            if let Err(error) = derived.flatten() {
                tracing::debug!(object = object.name(), %error, "nothing was derived ahead of calls");
            }
        };
        tokio::spawn(async move { shutdown.run_until_cancelled(derive).await });
    }
}

/// The id in the field `name`, read by `read`; the request has no other field to check.
fn checked_id(
    name: &str,
    read: impl FnOnce(Field<'_>, &str) -> Option<String>,
) -> Result<String, ServiceError> {
    let violations = Violations::default();
    let id = read(violations.field("name"), name);
    id.ok_or_else(|| violations.into_error())
}
