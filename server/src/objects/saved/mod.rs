//! Saved objects.
//!
//! Each object is a record `objects/{id}` and a mesh file `meshes/{SHA-256}`, which objects with the same mesh share. A mesh
//! is written before the first record that names it, and deleted after the last; each write replaces a file as a
//! whole. So a crash leaves every object whole or absent, and at worst a mesh without a record, which the next start removes.
//!
//! What is read is compared with its SHA-256. What does not match is never served, and stays where it is for people to look at or
//! to replace. The names of all objects are in a file of their own, so that a lost record is missed.

mod fields;
mod record;
#[cfg(test)]
mod tests;

use std::{
    collections::{HashMap, HashSet},
    fmt,
    num::NonZeroUsize,
    sync::Arc,
};

use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _};
use object_store::{Error, path::Path};
use sha2::{Digest as _, Sha256};

pub(crate) use self::record::{MeshHash, SavedObject};
use super::name_of;
use crate::{
    error::ServiceError,
    limits::BYTES_BESIDES_MESH,
    saved::{
        NotCreated, Records, SavedFiles, StoreError, Unreadable, failed,
        folders::{MESHES, OBJECTS},
        seal,
    },
    wire::hex,
};

/// Largest record in bytes: what a client gives, and what describes the object, which repeats none of the lists.
const MAX_RECORD: u64 = 4 * BYTES_BESIDES_MESH as u64;

/// Records that are read at a time at the start.
const READ_AT_A_TIME: usize = 16;

/// The saved objects. Every method that is async must run on the async runtime.
#[derive(Debug)]
pub(crate) struct SavedObjects {
    files: Arc<SavedFiles>,
    records: Records,
    maximum: usize,
}

/// What was found at the start.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// The records by id, without regions and known grips.
    pub objects: Vec<(String, SavedObject)>,
    /// Ids of the objects whose records are damaged or missing.
    pub damaged: Vec<String>,
    /// How many records name each mesh.
    pub mesh_uses: MeshUses,
}

/// How many records name each mesh.
pub(crate) type MeshUses = HashMap<MeshHash, usize>;

impl SavedObjects {
    /// The objects of these files, at most `maximum`.
    pub(crate) fn new(files: Arc<SavedFiles>, maximum: NonZeroUsize) -> Self {
        Self {
            records: Records::new(Arc::clone(&files), OBJECTS, MAX_RECORD),
            files,
            maximum: maximum.get(),
        }
    }

    /// Largest number of objects.
    pub(crate) fn maximum(&self) -> usize {
        self.maximum
    }

    /// Reads every record, and removes meshes that no record names.
    ///
    /// # Errors
    /// Something cannot be read, or all records or meshes are missing.
    pub(crate) async fn read_all(&self) -> Result<Found, StoreError> {
        let failed = |error| self.files.error(&error);
        let meshes: HashMap<String, u64> = self.files.list(MESHES).await.map_err(failed)?;
        let ids = self.records.ids().await?;
        if ids.files == 0 {
            self.check_lost(OBJECTS, ids.known.len(), "records").await?;
        }
        let read = ids
            .all
            .iter()
            .cloned()
            .map(|id| async move { Ok::<_, Error>((self.readable_record(&id).await?, id)) });
        let mut read = futures_util::stream::iter(read).buffer_unordered(READ_AT_A_TIME);
        let mut found = Found::default();
        while let Some((saved, id)) = read.try_next().await.map_err(failed)? {
            match saved {
                Ok(saved) => {
                    let hash = saved.mesh_hash().unwrap_or_default();
                    if meshes.get(&hex(&hash)) != Some(&saved.mesh_bytes) {
                        log_damage(&id, &"its mesh is missing or has another size");
                    }
                    *found.mesh_uses.entry(hash).or_default() += 1;
                    found.objects.push((id, saved.without_lists()));
                }
                Err(wrong) => {
                    log_damage(&id, &wrong);
                    found.damaged.push(id);
                }
            }
        }
        drop(read);
        let used: HashSet<String> = found.mesh_uses.keys().map(|hash| hex(hash)).collect();
        if !used.iter().any(|mesh| meshes.contains_key(mesh)) {
            self.check_lost(MESHES, used.len(), "meshes").await?;
        }
        // With its mesh, a damaged record may still be replaced.
        let unused = meshes
            .keys()
            .filter(|mesh| found.damaged.is_empty() && !used.contains(*mesh));
        for mesh in unused {
            let path = Path::from_iter([MESHES, mesh.as_str()]);
            self.files.delete(&path).await.map_err(failed)?;
        }
        self.records.adopt(&ids).await?;
        for folder in [OBJECTS, MESHES] {
            self.files.mark(folder).await.map_err(failed)?;
        }
        Ok(found)
    }

    /// Checks a folder that has none of `count` files: one may be lost, but not several at once, nor the folder itself.
    async fn check_lost(&self, folder: &str, count: usize, what: &str) -> Result<(), StoreError> {
        let is_marked = self.files.is_marked(folder).await;
        if count == 0 || count == 1 && is_marked.map_err(|error| self.files.error(&error))? {
            return Ok(());
        }
        Err(self.files.error(&format_args!(
            "its folder {folder} has none of {count} {what}; mount the volume that has them, or remove {OBJECTS} and {OBJECTS}.names to \
             start without any object"
        )))
    }

    /// Writes a new object: its mesh, its record, and then the names of all.
    ///
    /// # Errors
    /// Something cannot be written.
    pub(crate) async fn create(
        &self,
        saved: &SavedObject,
        mesh: Bytes,
        names: Vec<String>,
    ) -> Result<(), NotCreated> {
        let path = mesh_path(&saved.mesh_hash().unwrap_or_default());
        let mesh = self.files.write(&path, mesh);
        self.records.create(saved.id(), seal(saved), names, mesh).await
    }

    /// Writes the record of an object that has one.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn write(&self, saved: &SavedObject) -> Result<(), ServiceError> {
        self.records.write(saved.id(), seal(saved)).await
    }

    /// Deletes a record, whose name is not among the `others`.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn delete_record(&self, id: &str, others: Vec<String>) -> Result<(), ServiceError> {
        self.records.delete(id, others).await
    }

    /// Deletes a mesh that no record names any more. If that fails, the next start does it.
    pub(crate) async fn delete_mesh(&self, hash: &MeshHash) {
        if let Err(error) = self.files.delete(&mesh_path(hash)).await {
            tracing::warn!(mesh = hex(hash), %error, "cannot delete the mesh of a deleted object");
        }
    }

    /// The record of an object.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`]; within, what is wrong with it.
    pub(crate) async fn record(&self, id: &str) -> Result<Result<SavedObject, Unreadable>, ServiceError> {
        let read = self.readable_record(id).await;
        read.map_err(|error| failed(&error))
    }

    /// The mesh file of an object, to be compared with its hash. `None` if it is missing.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn mesh(&self, saved: &SavedObject) -> Result<Option<Bytes>, ServiceError> {
        let path = mesh_path(&saved.mesh_hash().unwrap_or_default());
        let read = self.files.read(&path, saved.mesh_bytes).await;
        read.map_err(|error| failed(&error))
    }

    /// True if a mesh file has this hash. Takes milliseconds, up to a second for the largest.
    pub(crate) fn is_mesh(mesh: &[u8], hash: Option<MeshHash>) -> bool {
        hash.is_some_and(|hash| Sha256::digest(mesh).as_slice() == hash)
    }

    async fn readable_record(&self, id: &str) -> Result<Result<SavedObject, Unreadable>, Error> {
        let parse = |message: &[u8]| SavedObject::from_message(id, message);
        self.records.read(id, parse).await
    }
}

/// Logs what of an object cannot be read.
pub(crate) fn log_damage(id: &str, reason: &dyn fmt::Display) {
    tracing::error!(object = name_of(id), %reason, "what was saved of an object is damaged");
}

fn mesh_path(hash: &MeshHash) -> Path {
    Path::from_iter([MESHES, hex(hash).as_str()])
}
