//! Saved rigs: what clients sent, from which the rigs are made again at the start.

mod record;

use std::{collections::BTreeSet, sync::Arc};

use bytes::Bytes;
use grasp_proto::v1;
use object_store::path::Path;

pub(crate) use self::record::SavedRig;
use crate::{
    error::ServiceError,
    saved::{SavedFiles, StoreError, Unreadable, failed, folders::RIGS},
};

/// Largest record in bytes: a model of the largest size that a server can be configured to take, and what is beside it.
const MAX_RECORD: u64 = 1 << 30;

/// The saved rigs: each is a file `rigs/{id}`.
#[derive(Debug)]
pub(crate) struct SavedRigs(Arc<SavedFiles>);

impl SavedRigs {
    /// The rigs of these files.
    pub(crate) fn new(files: Arc<SavedFiles>) -> Self {
        Self(files)
    }

    /// The ids of all, those of lost records included.
    ///
    /// # Errors
    /// They cannot be read.
    pub(crate) async fn ids(&self) -> Result<BTreeSet<String>, StoreError> {
        let failed = |error| self.error(&error);
        let known = self.0.names(RIGS).await.map_err(failed)?.unwrap_or_default();
        let files = self.0.list(RIGS).await.map_err(failed)?;
        let ids: BTreeSet<String> = files.into_keys().chain(known.iter().cloned()).collect();
        if ids != known {
            let written = self.0.write_names(RIGS, ids.iter().cloned().collect());
            written.await.map_err(failed)?;
        }
        Ok(ids)
    }

    /// The request that made a rig.
    ///
    /// # Errors
    /// It cannot be read; within, what is wrong with the record.
    pub(crate) async fn request(
        &self,
        id: &str,
    ) -> Result<Result<v1::CreateRigRequest, Unreadable>, StoreError> {
        let parse = |message: &[u8]| SavedRig::from_message(id, message).map(Into::into);
        let read = self.0.read_sealed(&path(id), MAX_RECORD, parse).await;
        read.map_err(|error| self.error(&error))
    }

    /// Writes the sealed record of a rig, and then the names of all rigs.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`]; then the rig is absent, unless the place cannot be reached at all.
    pub(crate) async fn write(
        &self,
        id: &str,
        record: Bytes,
        names: Vec<String>,
    ) -> Result<(), ServiceError> {
        let written = async {
            self.0.write(&path(id), record).await?;
            self.0.write_names(RIGS, names).await
        };
        let Err(error) = written.await else {
            return Ok(());
        };
        // What a write that failed late left must not come back at the next start. If this fails, too, the log says so.
        let _ = self.0.delete(&path(id)).await;
        Err(failed(&error))
    }

    /// Writes the names of all other rigs, and then deletes the record of this one.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`]. Then a record that is left is adopted at the next start.
    pub(crate) async fn delete(&self, id: &str, others: Vec<String>) -> Result<(), ServiceError> {
        let deleted = async {
            self.0.write_names(RIGS, others).await?;
            self.0.delete(&path(id)).await
        };
        deleted.await.map_err(|error| failed(&error))
    }

    /// An error of the start.
    pub(crate) fn error(&self, reason: &dyn std::fmt::Display) -> StoreError {
        self.0.error(reason)
    }
}

fn path(id: &str) -> Path {
    Path::from_iter([RIGS, id])
}
