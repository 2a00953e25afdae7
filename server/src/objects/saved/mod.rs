//! Created objects in a folder or bucket, where they outlast the server.
//!
//! Each object is a record `objects/{id}` and a mesh file `meshes/{SHA-256}`, which objects with the same mesh share. A mesh
//! is written before the first record that names it, and deleted after the last; each write replaces a file as a
//! whole. So a crash leaves every object whole or absent, and at worst a mesh without a record, which the next start removes.
//!
//! What is read is compared with its SHA-256. What does not match is moved to `damaged/`, for people to look at, and never
//! served.

mod folder;
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
use object_store::{
    Error, ObjectMeta, ObjectStore, ObjectStoreExt as _, PutPayload, local::LocalFileSystem, path::Path,
};
use sha2::{Digest as _, Sha256};

use self::folder::OwnedFolder;
pub(crate) use self::record::{MeshHash, SavedObject};
use super::{hex, name_of};
use crate::{config::StorePlace, error::ServiceError, limits::BYTES_BESIDES_MESH};

/// What a folder must be.
const NEEDED: &str = "it must be a folder that only this server writes to, or memory, with which created objects end with the server";

/// Where records are.
const RECORDS: &str = "objects";

/// Where mesh files are.
const MESHES: &str = "meshes";

/// Where damaged files are moved.
const DAMAGED: &str = "damaged";

/// Largest record in bytes: a request without its mesh, and the description, which repeats none of its lists but the warnings.
const LARGEST_RECORD: u64 = 4 * BYTES_BESIDES_MESH as u64;

/// Records that are read at a time at the start.
const READ_AT_A_TIME: usize = 16;

/// The folder or bucket of saved objects. Every method that is async must run on the async runtime.
#[derive(Debug)]
pub(crate) struct SavedObjects {
    files: Arc<dyn ObjectStore>,
    folder: Option<OwnedFolder>,
    /// As in the configuration, for messages.
    place: String,
    maximum: usize,
}

/// Saved objects cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("store is {place}; {reason}")]
pub struct StoreError {
    /// The folder or bucket.
    pub place: String,
    /// What is wrong.
    pub reason: String,
}

/// What was found at the start.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// The records by id, of whose requests only ids and labels are kept.
    pub objects: Vec<(String, SavedObject)>,
    /// How many records name each mesh.
    pub mesh_uses: MeshUses,
}

/// How many records name each mesh.
pub(crate) type MeshUses = HashMap<MeshHash, usize>;

impl SavedObjects {
    /// Opens the place that the configuration names; none if objects are in memory only. `maximum` is the largest
    /// number of objects.
    ///
    /// # Errors
    /// The place cannot be used.
    pub(crate) fn open(place: &StorePlace, maximum: NonZeroUsize) -> Result<Option<Self>, StoreError> {
        let error = |reason: &dyn fmt::Display| StoreError {
            place: place.to_string(),
            reason: reason.to_string(),
        };
        let (files, folder): (Arc<dyn ObjectStore>, _) = match place {
            StorePlace::Memory => return Ok(None),
            StorePlace::Folder(path) => {
                let folder = OwnedFolder::open(path, &[RECORDS, MESHES, DAMAGED]);
                let folder = folder.map_err(|source| error(&format!("{NEEDED}: {source}")))?;
                let files = LocalFileSystem::new_with_prefix(path).map_err(|source| error(&source))?;
                (Arc::new(files.with_fsync(true)), Some(folder))
            }
            #[cfg(feature = "s3")]
            StorePlace::S3 { bucket, prefix } => {
                let files = object_store::aws::AmazonS3Builder::from_env()
                    .with_bucket_name(bucket)
                    .build()
                    .map_err(|source| error(&source))?;
                let files = object_store::prefix::PrefixStore::new(files, prefix.as_str());
                (Arc::new(files), None)
            }
        };
        Ok(Some(Self {
            files,
            folder,
            place: place.to_string(),
            maximum: maximum.get(),
        }))
    }

    /// Largest number of objects.
    pub(crate) fn maximum(&self) -> usize {
        self.maximum
    }

    /// Reads every record, moves damaged ones aside, and removes meshes that no record names.
    ///
    /// # Errors
    /// Something cannot be read.
    pub(crate) async fn read_all(&self) -> Result<Found, StoreError> {
        self.try_read_all().await.map_err(|error| StoreError {
            place: self.place.clone(),
            reason: error.to_string(),
        })
    }

    async fn try_read_all(&self) -> Result<Found, Error> {
        let meshes: HashMap<String, u64> = self.list(MESHES).await?;
        let records = self.list(RECORDS).await?;
        let read = records
            .into_keys()
            .map(|id| async move { Ok::<_, Error>((self.readable_record(&id).await?, id)) });
        let mut read = futures_util::stream::iter(read).buffer_unordered(READ_AT_A_TIME);
        let mut found = Found::default();
        while let Some((saved, id)) = read.try_next().await? {
            let Some(saved) = saved else { continue };
            let hash = saved.mesh_hash().unwrap_or_default();
            if meshes.get(&hex(&hash)) != Some(&saved.mesh_bytes) {
                self.move_aside(&record_path(&id), "its mesh is missing or has another size")
                    .await?;
                continue;
            }
            *found.mesh_uses.entry(hash).or_default() += 1;
            found.objects.push((id, saved.without_request()));
        }
        let used: HashSet<String> = found.mesh_uses.keys().map(|hash| hex(hash)).collect();
        let has_damage = self.files.list(Some(&Path::from(DAMAGED))).next().await.is_some();
        let unused = meshes.keys().filter(|mesh| !used.contains(*mesh));
        for mesh in unused {
            // With the mesh, a damaged record may still be repaired.
            if !has_damage {
                self.delete(&Path::from_iter([MESHES, mesh.as_str()])).await?;
            }
        }
        Ok(found)
    }

    /// The names of the files in a folder, with their sizes.
    async fn list(&self, folder: &str) -> Result<HashMap<String, u64>, Error> {
        let files = self.files.list(Some(&Path::from(folder)));
        let names = files.map_ok(|ObjectMeta { location, size, .. }| {
            let name = location.filename().unwrap_or_default().to_owned();
            (name, size)
        });
        names.try_collect().await
    }

    /// Writes an object: its mesh, if it is new here, then its record.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`]; then the object is as it was, or absent.
    pub(crate) async fn write(&self, saved: &SavedObject, mesh: Option<Bytes>) -> Result<(), ServiceError> {
        let written = async {
            if let Some(mesh) = mesh {
                let hash = saved.mesh_hash().unwrap_or_default();
                self.files.put(&mesh_path(&hash), mesh.into()).await?;
            }
            let record = PutPayload::from(saved.to_bytes());
            self.files
                .put(&record_path(&saved.request.object_id), record)
                .await
        };
        written.await.map(|_| ()).map_err(|error| failed(&error))
    }

    /// Deletes a record.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn delete_record(&self, id: &str) -> Result<(), ServiceError> {
        self.delete(&record_path(id))
            .await
            .map_err(|error| failed(&error))
    }

    /// Deletes a mesh that no record names any more. If that fails, the next start does it.
    pub(crate) async fn delete_mesh(&self, hash: &MeshHash) {
        if let Err(error) = self.delete(&mesh_path(hash)).await {
            tracing::warn!(mesh = hex(hash), %error, "cannot delete the mesh of a deleted object");
        }
    }

    /// Deletes a file; one that is missing counts as deleted.
    async fn delete(&self, path: &Path) -> Result<(), Error> {
        match self.files.delete(path).await {
            Err(Error::NotFound { .. }) => {}
            result => result?,
        }
        let synced = self.folder.as_ref().map_or(Ok(()), |folder| {
            let parent = path.parts().next();
            folder.sync(parent.as_ref().map_or("", AsRef::as_ref))
        });
        synced.map_err(|source| Error::Generic {
            store: "folder",
            source: source.into(),
        })
    }

    /// The record of an object.
    ///
    /// # Errors
    /// [`ServiceError::ObjectDamaged`] and [`ServiceError::StoreFailed`].
    pub(crate) async fn record(&self, id: &str) -> Result<SavedObject, ServiceError> {
        let read = self.readable_record(id).await;
        read.map_err(|error| failed(&error))?
            .ok_or_else(|| ServiceError::ObjectDamaged { name: name_of(id) })
    }

    /// The mesh file of an object, to be compared with its hash; none if it is missing.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn mesh(&self, saved: &SavedObject) -> Result<Option<Bytes>, ServiceError> {
        let path = mesh_path(&saved.mesh_hash().unwrap_or_default());
        let read = self.read(&path, saved.mesh_bytes).await;
        read.map_err(|error| failed(&error))
    }

    /// True if a mesh file has this hash. Takes milliseconds, up to a second for the largest.
    pub(crate) fn is_mesh(mesh: &[u8], hash: Option<MeshHash>) -> bool {
        hash.is_some_and(|hash| Sha256::digest(mesh).as_slice() == hash)
    }

    /// Moves a damaged mesh file aside, if it is there.
    ///
    /// # Errors
    /// [`ServiceError::StoreFailed`].
    pub(crate) async fn move_mesh_aside(&self, hash: &MeshHash) -> Result<(), ServiceError> {
        match self.move_aside(&mesh_path(hash), "its SHA-256 is wrong").await {
            Err(Error::NotFound { .. }) => Ok(()),
            moved => moved.map_err(|error| failed(&error)),
        }
    }

    /// Reads a record; none if it is missing or damaged, in which case it is moved aside.
    async fn readable_record(&self, id: &str) -> Result<Option<SavedObject>, Error> {
        let path = record_path(id);
        let Some(bytes) = self.read(&path, LARGEST_RECORD).await? else {
            return Ok(None);
        };
        match SavedObject::from_bytes(id, &bytes) {
            Ok(saved) => Ok(Some(saved)),
            Err(damage) => {
                self.move_aside(&path, &damage.to_string()).await?;
                Ok(None)
            }
        }
    }

    /// Reads a file; nothing of it if it has more than `most` bytes. None if there is no such file.
    async fn read(&self, path: &Path, most: u64) -> Result<Option<Bytes>, Error> {
        let file = match self.files.get(path).await {
            Err(Error::NotFound { .. }) => return Ok(None),
            file => file?,
        };
        if file.meta.size > most {
            return Ok(Some(Bytes::new()));
        }
        file.bytes().await.map(Some)
    }

    async fn move_aside(&self, path: &Path, reason: &str) -> Result<(), Error> {
        tracing::error!(file = %path, reason, "moved a damaged file of the store to damaged/");
        let aside = Path::from(format!("{DAMAGED}/{path}"));
        self.files.rename(path, &aside).await
    }
}

fn record_path(id: &str) -> Path {
    Path::from_iter([RECORDS, id])
}

fn mesh_path(hash: &MeshHash) -> Path {
    Path::from_iter([MESHES, hex(hash).as_str()])
}

/// The error of a call for one of the store, whose details only the log has.
fn failed(error: &Error) -> ServiceError {
    tracing::error!(%error, "the store failed");
    ServiceError::StoreFailed
}
