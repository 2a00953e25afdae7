//! The handlers of the gRPC services.

mod grasp_service;
mod hand_rig_service;
mod object_service;
mod object_streams;
mod rig_builder;
mod rig_message;
mod streaming;
mod upload;

use std::{sync::Arc, time::Duration};

use grasp_import::MeshLimits;
use grasp_synthesis::base::mechanisms::Mechanisms;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

pub(crate) use grasp_service::GraspHandler;
pub(crate) use hand_rig_service::HandRigHandler;
pub(crate) use object_service::ObjectHandler;
pub(crate) use rig_builder::load_saved_rigs;
pub(crate) use upload::Uploads;

use crate::{
    atlases::Atlases,
    budget::BudgetLimits,
    call::CallContext,
    error::ServiceError,
    executor::{SearchExecutor, run_blocking},
    objects::{Revision, resized::Resizer, store::ObjectStore},
    reserve::DeadlineReserve,
    rigs::store::RigStore,
};

/// State shared by the handlers.
#[derive(Debug)]
pub(crate) struct Shared {
    /// The objects by name.
    pub objects: Arc<ObjectStore>,
    /// The rigs by name.
    pub rigs: RigStore,
    /// The atlases of the objects.
    pub atlases: Atlases,
    /// The search pool.
    pub executor: SearchExecutor,
    /// Prepares objects at other sizes.
    pub resizer: Resizer,
    /// Bounds on search times.
    pub budgets: BudgetLimits,
    /// How much longer searches go on after a first grasp that a person would not choose.
    pub improvement: Duration,
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
    /// Cancelled when the server begins to shut down, which ends streams without an end of their own.
    pub shutdown: CancellationToken,
    /// Rig of the receiving hand if a request names none.
    pub default_rig: String,
    /// The mechanisms that searches run.
    pub mechanisms: Mechanisms,
}

impl Shared {
    /// Deletes something when it is this deletion's turn.
    ///
    /// # Errors
    /// Those of `delete`.
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
    ///
    /// # Errors
    /// [`ServiceError::DeadlineExceeded`], and those of [`ObjectStore::loaded`].
    pub(crate) async fn object(&self, id: &str, call: &CallContext) -> Result<Revision, ServiceError> {
        if let Some(revision) = self.objects.get(id)?.loaded() {
            return Ok(revision);
        }
        let loading = self.objects.loaded(id);
        let revision = match call.answer_due() {
            None => loading.await,
            Some(due) => tokio::time::timeout_at(due.into(), loading)
                .await
                .unwrap_or(Err(ServiceError::DeadlineExceeded)),
        }?;
        self.atlases.register(&revision.object);
        Ok(revision)
    }
}
