//! The folder or bucket where what clients create is saved: files that are written as a whole, checked when they are read, and
//! moved aside if they are damaged.

mod folder;
mod place;
mod sealed;

use std::{collections::HashMap, fmt, sync::Arc};

use bytes::Bytes;
use futures_util::{StreamExt as _, TryStreamExt as _};
use object_store::{Error, ObjectMeta, ObjectStore, ObjectStoreExt as _, local::LocalFileSystem, path::Path};

use self::folder::OwnedFolder;
pub use self::place::StorePlace;
pub(crate) use self::{
    place::NEEDED_PLACE,
    sealed::{Unreadable, seal, unsealed},
};
use crate::error::ServiceError;

/// The folders of what is saved.
pub(crate) mod folders {
    /// Records of objects.
    pub(crate) const OBJECTS: &str = "objects";
    /// Mesh files of objects.
    pub(crate) const MESHES: &str = "meshes";
    /// Records of rigs.
    pub(crate) const RIGS: &str = "rigs";
    /// What was damaged.
    pub(crate) const DAMAGED: &str = "damaged";
}

use folders::{DAMAGED, MESHES, OBJECTS, RIGS};

/// What a folder must be.
const NEEDED: &str = "it must be a folder that only this server writes to, or memory, with which created objects and rigs end with \
                      the server";

/// The files of a folder or bucket. Every method that is async must run on the async runtime.
#[derive(Debug)]
pub(crate) struct SavedFiles {
    files: Arc<dyn ObjectStore>,
    folder: Option<OwnedFolder>,
    /// As in the configuration, for messages.
    place: String,
}

/// What is saved cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("store is {place}; {reason}")]
pub struct StoreError {
    /// The folder or bucket.
    pub place: String,
    /// What is wrong.
    pub reason: String,
}

impl SavedFiles {
    /// Opens the place that the configuration names; none if nothing is saved.
    ///
    /// # Errors
    /// The place cannot be used.
    pub(crate) fn open(place: &StorePlace) -> Result<Option<Self>, StoreError> {
        let error = |reason: &dyn fmt::Display| StoreError {
            place: place.to_string(),
            reason: reason.to_string(),
        };
        let (files, folder): (Arc<dyn ObjectStore>, _) = match place {
            StorePlace::Memory => return Ok(None),
            StorePlace::Folder(path) => {
                let folder = OwnedFolder::open(path, &[OBJECTS, MESHES, RIGS, DAMAGED]);
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
        }))
    }

    /// An error of the start.
    pub(crate) fn error(&self, reason: &dyn fmt::Display) -> StoreError {
        StoreError {
            place: self.place.clone(),
            reason: reason.to_string(),
        }
    }

    /// The names of the files in a folder, with their sizes.
    ///
    /// # Errors
    /// They cannot be read.
    pub(crate) async fn list(&self, folder: &str) -> Result<HashMap<String, u64>, Error> {
        let files = self.files.list(Some(&Path::from(folder)));
        let names = files.map_ok(|ObjectMeta { location, size, .. }| {
            let name = location.filename().unwrap_or_default().to_owned();
            (name, size)
        });
        names.try_collect().await
    }

    /// Writes a file as a whole: it is as it was, or as it is to be.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) async fn write(&self, path: &Path, bytes: Bytes) -> Result<(), Error> {
        self.files.put(path, bytes.into()).await.map(|_| ())
    }

    /// Deletes a file for good; one that is missing counts as deleted.
    ///
    /// # Errors
    /// It cannot be deleted.
    pub(crate) async fn delete(&self, path: &Path) -> Result<(), Error> {
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

    /// Reads a file; nothing of it if it has more than `most` bytes. None if there is no such file.
    ///
    /// # Errors
    /// It cannot be read.
    pub(crate) async fn read(&self, path: &Path, most: u64) -> Result<Option<Bytes>, Error> {
        let file = match self.files.get(path).await {
            Err(Error::NotFound { .. }) => return Ok(None),
            file => file?,
        };
        if file.meta.size > most {
            return Ok(Some(Bytes::new()));
        }
        file.bytes().await.map(Some)
    }

    /// Reads a file that was sealed, and makes something of its message. If that fails, the file is moved aside. None if it was, or
    /// if there is no such file.
    ///
    /// # Errors
    /// It cannot be read or moved.
    pub(crate) async fn read_sealed<T>(
        &self,
        path: &Path,
        most: u64,
        parse: impl FnOnce(&[u8]) -> Result<T, Unreadable>,
    ) -> Result<Option<T>, Error> {
        let Some(bytes) = self.read(path, most).await? else {
            return Ok(None);
        };
        match unsealed(&bytes).and_then(parse) {
            Ok(read) => Ok(Some(read)),
            Err(wrong) => {
                self.move_aside(path, &wrong.to_string()).await?;
                Ok(None)
            }
        }
    }

    /// Moves a damaged file aside, for people to look at.
    ///
    /// # Errors
    /// It cannot be moved.
    pub(crate) async fn move_aside(&self, path: &Path, reason: &str) -> Result<(), Error> {
        tracing::error!(file = %path, reason, "moved a damaged file of the store to damaged/");
        let aside = Path::from(format!("{DAMAGED}/{path}"));
        self.files.rename(path, &aside).await
    }

    /// True if anything was moved aside.
    pub(crate) async fn has_damage(&self) -> bool {
        self.files.list(Some(&Path::from(DAMAGED))).next().await.is_some()
    }
}

/// The error of a call for one of the store, whose details only the log has.
pub(crate) fn failed(error: &Error) -> ServiceError {
    tracing::error!(%error, "the store failed");
    ServiceError::StoreFailed
}

/// Waits for a future, on a thread that may block.
///
/// # Panics
/// Outside the context of an async runtime, or on a thread that runs its tasks.
pub(crate) fn wait_for<T>(future: impl Future<Output = T>) -> T {
    tokio::runtime::Handle::current().block_on(future)
}
