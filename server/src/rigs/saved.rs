//! Saved rigs: what clients sent, from which the rigs are made again at the start.

use std::sync::Arc;

use bytes::Bytes;
use grasp_proto::v1;
use object_store::path::Path;
use prost::Message as _;

use crate::{
    error::ServiceError,
    saved::{SavedFiles, StoreError, Unreadable, failed, folders::RIGS},
};

/// Largest record in bytes: a model of the largest size that a server can be configured to take, and what is beside it.
const LARGEST_RECORD: u64 = 1 << 30;

/// The saved rigs: each is a file `rigs/{id}`.
#[derive(Debug)]
pub(crate) struct SavedRigs(Arc<SavedFiles>);

impl SavedRigs {
    /// The rigs of these files.
    pub(crate) fn new(files: Arc<SavedFiles>) -> Self {
        Self(files)
    }

    /// The ids of all, ascending.
    ///
    /// # Errors
    /// They cannot be read.
    pub(crate) async fn ids(&self) -> Result<Vec<String>, StoreError> {
        let files = self.0.list(RIGS).await.map_err(|error| self.error(&error))?;
        let mut ids: Vec<String> = files.into_keys().collect();
        ids.sort();
        Ok(ids)
    }

    /// The request that made a rig; none if the record is damaged, in which case it is moved aside.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) async fn request(&self, id: &str) -> Result<Option<v1::CreateRigRequest>, StoreError> {
        let parse = |message: &[u8]| {
            let request = v1::CreateRigRequest::decode(message).map_err(|_| Unreadable::Message)?;
            if request.rig_id == id {
                Ok(request)
            } else {
                Err(Unreadable::Name)
            }
        };
        let read = self.0.read_sealed(&path(id), LARGEST_RECORD, parse).await;
        read.map_err(|error| self.error(&error))
    }

    /// Writes the record of a rig: the sealed request.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`]; then the rig is absent, unless the place cannot be reached at all.
    pub(crate) async fn write(&self, id: &str, record: Bytes) -> Result<(), ServiceError> {
        let Err(error) = self.0.write(&path(id), record).await else {
            return Ok(());
        };
        // What a write that failed late left must not come back at the next start. If this fails, too, the log says so.
        let _ = self.delete(id).await;
        Err(failed(&error))
    }

    /// Deletes a rig.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn delete(&self, id: &str) -> Result<(), ServiceError> {
        let deleted = self.0.delete(&path(id)).await;
        deleted.map_err(|error| failed(&error))
    }

    /// An error of the start.
    pub(crate) fn error(&self, reason: &dyn std::fmt::Display) -> StoreError {
        self.0.error(reason)
    }
}

fn path(id: &str) -> Path {
    Path::from_iter([RIGS, id])
}
