//! The handlers of the gRPC services.

mod grasp_service;
mod hand_rig_service;
mod object_service;
mod object_streams;
mod packing;
mod rig_builder;
mod stream_grasps;
mod streaming;
mod tracks;
mod upload;

use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use grasp_import::MeshLimits;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

pub(crate) use grasp_service::GraspHandler;
pub(crate) use hand_rig_service::HandRigHandler;
pub(crate) use object_service::ObjectHandler;
pub(crate) use packing::Packing;
pub(crate) use rig_builder::load_saved_rigs;
pub(crate) use upload::Uploads;

use crate::{
    atlases::Atlases,
    budget::{BudgetLimits, DeadlineReserve},
    call::CallContext,
    error::ServiceError,
    executor::{SearchExecutor, before, run_blocking, run_stoppable},
    objects::{
        Derived, Revision, StoredObject,
        derived::Resizer,
        store::{Need, ObjectStore},
    },
    rigs::store::RigStore,
    track::OpenTracks,
};

/// New objects of which the latest are prepared for their first calls.
const MAX_PREPARED_AHEAD: u64 = 16;

/// Whose turn it is to be prepared ahead of calls.
#[derive(Debug)]
pub(crate) struct Ahead {
    /// Number of objects so far.
    next: AtomicU64,
    /// One at a time.
    turn: Semaphore,
}

impl Default for Ahead {
    fn default() -> Self {
        Self {
            next: AtomicU64::new(0),
            turn: Semaphore::new(1),
        }
    }
}

/// State shared by the handlers.
#[derive(Debug)]
pub(crate) struct Shared {
    /// The objects by name.
    pub objects: Arc<ObjectStore>,
    /// The rigs by name.
    pub rigs: Arc<RigStore>,
    /// The atlases of the objects.
    pub atlases: Atlases,
    /// The search pool.
    pub executor: SearchExecutor,
    /// Prepares objects at other sizes.
    pub resizer: Resizer,
    /// Bounds on search times.
    pub budgets: BudgetLimits,
    /// How much longer searches go on after a first grasp that a person would not choose.
    pub refinement: Duration,
    /// Most grips that are learned from searches per object and hand.
    pub learned_grips: usize,
    /// The part of deadlines kept for answers.
    pub reserve: Arc<DeadlineReserve>,
    /// Bounds on meshes.
    pub obj_limits: MeshLimits,
    /// One permit: deletions wait for their turn here, where they take no thread. Threads that wait for the disk could otherwise
    /// be all that there are, and the disk needs some, too.
    pub deletions: Arc<Semaphore>,
    /// Uploads in pieces.
    pub uploads: Uploads,
    /// Largest number of watchers of objects.
    pub maximum_watchers: usize,
    /// The tracks of moving givers.
    pub tracks: Arc<OpenTracks>,
    /// Longest time without a frame of a track.
    pub track_idle: Duration,
    /// Cancelled when the server begins to shut down, which ends streams without an end of their own.
    pub shutdown: CancellationToken,
    /// One permit per object that may be prepared for searches at a time.
    pub deriving: Arc<Semaphore>,
    /// Objects from which it is to be derived before a call asks for it.
    pub ahead: Ahead,
    /// Rig of the receiving hand if a request names none.
    pub default_rig: String,
}

impl Shared {
    /// Deletes something when it is this deletion's turn.
    async fn delete_in_turn(
        self: &Arc<Self>,
        delete: impl FnOnce(&Self) -> Result<(), ServiceError> + Send + 'static,
    ) -> Result<(), ServiceError> {
        let turn = Arc::clone(&self.deletions).acquire_owned().await;
        let turn = turn.map_err(|_| ServiceError::ShuttingDown)?;
        let shared = Arc::clone(self);
        run_blocking(move || {
            let _turn = turn;
            delete(&shared)
        })
        .await?
    }

    /// The object with this id, ready for searches: loaded, if it was at rest, before the call's deadline.
    pub(crate) async fn object(&self, id: &str, call: &CallContext) -> Result<Revision, ServiceError> {
        if let Some(revision) = self.objects.found(id).await?.loaded() {
            return Ok(revision);
        }
        let revision = before(call.answer_due(), self.objects.loaded(id)).await??;
        self.atlases.register(&revision.object);
        Ok(revision)
    }

    /// What is derived from an object, built before the call's deadline unless another call does so meanwhile, and prepared for the
    /// hands of the default rig.
    pub(crate) async fn derived(
        &self,
        object: &Arc<StoredObject>,
        call: &CallContext,
    ) -> Result<Arc<Derived>, ServiceError> {
        if let Some(kept) = self.objects.kept(object, Need::Call)
            && kept.is_prepared(&self.default_rig)
        {
            return Ok(kept);
        }
        let due = call.answer_due();
        let permit = before(due, Arc::clone(&self.deriving).acquire_owned()).await?;
        let permit = permit.map_err(|_| ServiceError::ShuttingDown)?;
        let (objects, object, rig) = (
            Arc::clone(&self.objects),
            Arc::clone(object),
            self.default_rig.clone(),
        );
        let derived = run_stoppable(due, move |stop| {
            let _permit = permit;
            let derived = objects.derived(&object, Need::Call, stop)?;
            derived.prepare(&rig, stop)?;
            Ok::<_, ServiceError>(derived)
        });
        derived.await?
    }

    /// Derives what calls need from a new object, once no other has to be and unless many newer ones wait.
    fn derive_ahead(self: &Arc<Self>, object: &Arc<StoredObject>) {
        let number = self.ahead.next.fetch_add(1, Ordering::Relaxed);
        let (shared, object) = (Arc::clone(self), Arc::downgrade(object));
        let shutdown = self.shutdown.clone();
        let derive = async move {
            let Ok(_turn) = shared.ahead.turn.acquire().await else {
                return;
            };
            let newer = shared.ahead.next.load(Ordering::Relaxed) - number;
            let Some(object) = object.upgrade().filter(|_| newer <= MAX_PREPARED_AHEAD) else {
                return;
            };
            let (objects, rig, of) = (
                Arc::clone(&shared.objects),
                shared.default_rig.clone(),
                Arc::clone(&object),
            );
            let derived = run_stoppable(None, move |stop| {
                // A copy, which shares all of it but does not keep the object from being evicted.
                let derived = Derived::clone(&*objects.derived(&of, Need::Ahead, stop)?);
                Ok::<_, ServiceError>(derived.prepare(&rig, stop)?)
            })
            .await;
            if let Err(error) = derived.flatten() {
                tracing::debug!(object = object.name(), %error, "nothing was derived ahead of calls");
            }
        };
        tokio::spawn(async move { shutdown.run_until_cancelled(derive).await });
    }
}
