//! The folder or bucket where what clients create is saved: files that are written as a whole and checked when they are read. What is
//! damaged or missing stays known by its name, and is there again when its file is.

mod folder;
mod place;
mod records;

use std::{collections::HashMap, fmt, sync::Arc};

use bytes::Bytes;
use futures_util::TryStreamExt as _;
use object_store::{Error, ObjectMeta, ObjectStore, ObjectStoreExt as _, local::LocalFileSystem, path::Path};

use self::folder::OwnedFolder;
pub use self::place::StorePlace;
pub(crate) use self::{
    folder::{create_private, make_private},
    place::NEEDED_PLACE,
    records::{NotCreated, Records, Unreadable, seal},
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
}

use folders::{MESHES, OBJECTS, RIGS};

/// A file in a folder that stays when everything else is deleted: without it, the folder is not the one that was written to.
const MARK: &str = ".grasp";

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
    /// Opens the place that the configuration names. `None` if nothing is saved.
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
                let folder = OwnedFolder::open(path, &[OBJECTS, MESHES, RIGS]);
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

    /// True if a folder is the one that [`Self::mark`] marked.
    ///
    /// # Errors
    /// The place failed.
    pub(crate) async fn is_marked(&self, folder: &str) -> Result<bool, Error> {
        Ok(self.read(&Path::from_iter([folder, MARK]), 0).await?.is_some())
    }

    /// Marks a folder, so that another one in its place shows, such as that of a volume that is not mounted.
    ///
    /// # Errors
    /// The place failed.
    pub(crate) async fn mark(&self, folder: &str) -> Result<(), Error> {
        if self.is_marked(folder).await? {
            return Ok(());
        }
        self.write(&Path::from_iter([folder, MARK]), Bytes::new()).await
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
        let named: HashMap<String, u64> = names.try_collect().await?;
        Ok(named.into_iter().filter(|(name, _)| name != MARK).collect())
    }

    /// Writes a file as a whole: it is as it was, or as it is to be.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) async fn write(&self, path: &Path, bytes: Bytes) -> Result<(), Error> {
        self.files.put(path, bytes.into()).await?;
        if let Some(folder) = &self.folder {
            folder.make_private(path.as_ref());
        }
        Ok(())
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

    /// Reads a file; nothing of it if it has more than `most` bytes. `None` if there is no such file.
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
