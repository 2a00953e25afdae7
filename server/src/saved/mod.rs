//! The folder or bucket of created objects and rigs: files that are written as a whole and checked when they are read. An object or
//! rig whose file is damaged or missing stays known by its name, and is back when its file is.

#[cfg_attr(
    not(feature = "s3"),
    allow(dead_code, reason = "only buckets have leases; their tests need none")
)]
mod lease;
mod records;

use std::{
    collections::HashMap,
    env, fmt,
    fs::{self, DirBuilder, File, TryLockError},
    io::{self, Read as _, Write as _},
    os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
    process,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bytes::Bytes;
use object_store::{
    Error, ObjectMeta, ObjectStore, ObjectStoreExt as _, local::LocalFileSystem, path::Path as ObjectPath,
};

use self::lease::Lease;
#[cfg(fuzzing)]
pub(crate) use self::records::names_of;
pub(crate) use self::records::{
    CreateFailure, FieldMove, Records, Unreadable, field, is_decodable, message, move_fields, seal,
};
use crate::error::ServiceError;

/// Folders of the records of objects, of their mesh files, and of the records of rigs.
pub(crate) const OBJECTS: &str = "objects";
pub(crate) const MESHES: &str = "meshes";
pub(crate) const RIGS: &str = "rigs";

/// A file in each folder that stays when everything else is deleted: a folder without it is another one.
const MARK: &str = ".grasp";

const NEEDED: &str = "it must be a folder that only this server writes to, or memory, with which created objects and rigs end with \
                      the server";

/// The files of a folder or bucket. Every method that is async must run on the async runtime.
#[derive(Debug)]
pub(crate) struct SavedFiles {
    files: Arc<dyn ObjectStore>,
    folder: Option<OwnedFolder>,
    /// That of a bucket.
    lease: Option<Arc<Lease>>,
    /// As in the configuration, for messages.
    place: String,
}

/// The store cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("store is {place}; {reason}")]
pub struct StoreError {
    /// The folder or bucket.
    pub place: String,
    /// The problem.
    pub reason: String,
}

impl SavedFiles {
    /// Opens the place that the configuration names. `None` if nothing is saved.
    pub(crate) fn open(place: &StorePlace) -> Result<Option<Self>, StoreError> {
        let error = |reason: &dyn fmt::Display| StoreError {
            place: place.to_string(),
            reason: reason.to_string(),
        };
        let (files, folder, lease): (Arc<dyn ObjectStore>, _, _) = match place {
            StorePlace::Memory => return Ok(None),
            StorePlace::Folder(path) => {
                let folder = OwnedFolder::open(path, &[OBJECTS, MESHES, RIGS]);
                let folder = folder.map_err(|source| error(&format!("{NEEDED}: {source}")))?;
                let files = LocalFileSystem::new_with_prefix(path).map_err(|source| error(&source))?;
                (Arc::new(files.with_fsync(true)), Some(folder), None)
            }
            #[cfg(feature = "s3")]
            StorePlace::S3 { bucket, prefix } => {
                let files = object_store::aws::AmazonS3Builder::from_env()
                    .with_bucket_name(bucket)
                    .build()
                    .map_err(|source| error(&source))?;
                let files = Arc::new(object_store::prefix::PrefixStore::new(files, prefix.as_str()));
                let lease = Lease::new(Arc::clone(&files) as Arc<_>, lease::Times::USUAL);
                (files, None, Some(lease))
            }
        };
        Ok(Some(Self {
            files,
            folder,
            lease,
            place: place.to_string(),
        }))
    }

    pub(crate) fn error(&self, reason: &dyn fmt::Display) -> StoreError {
        StoreError {
            place: self.place.clone(),
            reason: reason.to_string(),
        }
    }

    /// Makes this server the only one that uses the bucket; a folder it owns since it was opened.
    pub(crate) async fn own(&self) -> Result<(), StoreError> {
        match &self.lease {
            Some(lease) => lease.take(|reason| self.error(reason)).await,
            None => Ok(()),
        }
    }

    /// Lets another server use the bucket.
    pub(crate) async fn give_back(&self) {
        if let Some(lease) = &self.lease {
            lease.give_back().await;
        }
    }

    /// Waits until another server has taken the bucket over, which takes a pause of this one; gives the error.
    pub(crate) async fn lost(&self) -> StoreError {
        match &self.lease {
            Some(lease) => lease.lost().await,
            None => std::future::pending().await,
        }
        self.error(&"another server took it over, because this one could not reach it for too long")
    }

    /// Changes something, as long as no other server may.
    async fn change<T>(&self, change: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
        match &self.lease {
            Some(lease) => lease.within(change).await,
            None => change.await,
        }
    }

    pub(crate) async fn is_marked(&self, folder: &str) -> Result<bool, Error> {
        let mark = self.read(&ObjectPath::from_iter([folder, MARK]), 0).await?;
        Ok(mark != Err(Unreadable::Missing))
    }

    /// Marks a folder, so that another one in its place shows, such as that of a volume that is not mounted.
    pub(crate) async fn mark(&self, folder: &str) -> Result<(), Error> {
        if self.is_marked(folder).await? {
            return Ok(());
        }
        self.write(&ObjectPath::from_iter([folder, MARK]), Bytes::new())
            .await
    }

    /// The names of the files in a folder, with their sizes.
    pub(crate) async fn list(&self, folder: &str) -> Result<HashMap<String, u64>, Error> {
        let listed = self
            .files
            .list_with_delimiter(Some(&ObjectPath::from(folder)))
            .await?;
        let sizes = listed
            .objects
            .into_iter()
            .map(|ObjectMeta { location, size, .. }| {
                (location.filename().unwrap_or_default().to_owned(), size)
            });
        let mut sizes: HashMap<String, u64> = sizes.collect();
        sizes.remove(MARK);
        Ok(sizes)
    }

    /// Writes a file as a whole: a failure leaves it as it was.
    pub(crate) async fn write(&self, path: &ObjectPath, bytes: Bytes) -> Result<(), Error> {
        self.change(self.files.put(path, bytes.into())).await?;
        if let Some(folder) = &self.folder {
            make_private(&folder.path.join(path.as_ref()));
        }
        Ok(())
    }

    /// Deletes a file for good; one that is missing counts as deleted.
    pub(crate) async fn delete(&self, path: &ObjectPath) -> Result<(), Error> {
        match self.change(self.files.delete(path)).await {
            Err(Error::NotFound { .. }) => {}
            result => result?,
        }
        let Some(folder) = &self.folder else { return Ok(()) };
        let parent = path.parts().next();
        let synced = folder.sync(parent.as_ref().map_or("", AsRef::as_ref));
        synced.map_err(|source| Error::Generic {
            store: "folder",
            source: source.into(),
        })
    }

    /// Reads a file of at most `most` bytes. The inner error is [`Unreadable::Missing`] or [`Unreadable::Size`].
    pub(crate) async fn read(
        &self,
        path: &ObjectPath,
        most: u64,
    ) -> Result<Result<Bytes, Unreadable>, Error> {
        let file = match self.files.get(path).await {
            Err(Error::NotFound { .. }) => return Ok(Err(Unreadable::Missing)),
            file => file?,
        };
        if file.meta.size > most {
            return Ok(Err(Unreadable::Size));
        }
        file.bytes().await.map(Ok)
    }
}

#[cfg(shuttle)]
impl SavedFiles {
    /// Files that end with this, for tests of orders.
    pub(crate) fn in_memory() -> Self {
        Self {
            files: Arc::new(object_store::memory::InMemory::new()),
            folder: None,
            lease: None,
            place: "memory".to_owned(),
        }
    }
}

/// The error of a call; only the log has the details.
impl From<Error> for ServiceError {
    fn from(error: Error) -> Self {
        log_failure(&error);
        Self::StoreFailed
    }
}

fn log_failure(error: &Error) {
    tracing::error!(%error, "the store failed");
}

/// The file that the server locks while it uses the folder.
const LOCK: &str = "lock";

/// How long to wait for the lock: a server that is being replaced may need some time to end.
const LOCK_WAIT: Duration = Duration::from_secs(5);

/// Interval between attempts to take the lock.
const LOCK_RETRY: Duration = Duration::from_millis(20);

/// Permissions of folders and files: none for others than their user.
const FOLDER_MODE: u32 = 0o700;
const FILE_MODE: u32 = 0o600;

/// Part of the names of files that `object_store` has yet to move to their place.
const UNFINISHED: char = '#';

/// A folder that only this server uses, as long as this lives.
#[derive(Debug)]
struct OwnedFolder {
    path: PathBuf,
    _lock: File,
}

impl OwnedFolder {
    /// Takes the folder, which is created if necessary and must have the subfolders that it had, and removes unfinished files.
    fn open(path: &Path, subfolders: &[&str]) -> io::Result<Self> {
        let is_new = !path.join(LOCK).exists();
        let missing = |subfolder: &&str| !is_new && !path.join(subfolder).is_dir();
        if let Some(missing) = subfolders.iter().find(|subfolder| missing(subfolder)) {
            return Err(io::Error::other(format!(
                "{} is missing; mount the volume that has it, or create it empty to start without what it had",
                path.join(missing).display()
            )));
        }
        create_private(path)?;
        for subfolder in subfolders {
            create_private(&path.join(subfolder))?;
        }
        // Not cut: it says who uses the folder.
        let mut opened = File::options();
        let mut lock = opened
            .read(true)
            .append(true)
            .create(true)
            .open(path.join(LOCK))?;
        let start = Instant::now();
        while let Err(error) = lock.try_lock() {
            match error {
                TryLockError::WouldBlock if start.elapsed() < LOCK_WAIT => thread::sleep(LOCK_RETRY),
                TryLockError::WouldBlock => {
                    let mut owner = String::new();
                    // A damaged file names nobody.
                    let _ = lock.take(MAX_OWNER).read_to_string(&mut owner);
                    return Err(io::Error::other(in_use(&owner)));
                }
                TryLockError::Error(error) => return Err(error),
            }
        }
        lock.set_len(0)?;
        lock.write_all(this_process().as_bytes())?;
        let folder = Self {
            path: path.to_owned(),
            _lock: lock,
        };
        make_private(&path.join(LOCK));
        for subfolder in subfolders {
            folder.remove_unfinished(subfolder)?;
            folder.sync(subfolder)?;
        }
        folder.sync("")?;
        Ok(folder)
    }

    /// Removes files of interrupted writes, and makes the others private.
    fn remove_unfinished(&self, subfolder: &str) -> io::Result<()> {
        for entry in fs::read_dir(self.path.join(subfolder))? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().contains(UNFINISHED) {
                fs::remove_file(entry.path())?;
            } else if entry.file_type()?.is_file() {
                // Written by a version that left it to the system's default.
                make_private(&entry.path());
            }
        }
        Ok(())
    }

    /// Waits until the names in a subfolder are on the disk: a deleted file is gone even if the power fails.
    fn sync(&self, subfolder: &str) -> io::Result<()> {
        File::open(self.path.join(subfolder))?.sync_all()
    }
}

/// Longest name of the process that uses a store, in bytes.
const MAX_OWNER: u64 = 300;

/// This process, for people who look for the one that uses a store.
fn this_process() -> String {
    let process = process::id();
    match fs::read_to_string("/proc/sys/kernel/hostname") {
        Ok(host) => format!("process {process} on host {}", host.trim()),
        Err(_) => format!("process {process}"),
    }
}

/// The reason not to use a store of which `owner` is the [`this_process`] of another server, or empty.
fn in_use(owner: &str) -> String {
    match owner.trim() {
        "" => "another server uses it".to_owned(),
        owner => format!("another server uses it ({})", owner.escape_debug()),
    }
}

/// Creates a private folder with its parents, or makes an existing folder private.
pub(crate) fn create_private(folder: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.mode(FOLDER_MODE).recursive(true).create(folder)?;
    set_mode(folder, FOLDER_MODE);
    Ok(())
}

/// Writes a new file that was private from its first moment.
pub(crate) fn write_private(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut options = File::options();
    let new = options.mode(FILE_MODE).write(true).create_new(true);
    new.open(file)?.write_all(bytes)
}

/// Makes a file private.
fn make_private(file: &Path) {
    set_mode(file, FILE_MODE);
}

/// Sets the permissions of a file or folder. A failure is logged: a volume's own folder may belong to another user.
fn set_mode(path: &Path, mode: u32) {
    let others = |about: fs::Metadata| about.permissions().mode() & !mode & 0o777 != 0;
    let set = match fs::metadata(path).map(others) {
        Ok(true) => fs::set_permissions(path, fs::Permissions::from_mode(mode)),
        other => other.map(|_| ()),
    };
    if let Err(error) = set {
        tracing::warn!(path = %path.display(), %error, "cannot take a file of the store from other users");
    }
}

/// The default folder, in the user's data folder.
const DEFAULT_FOLDER: &str = "grasp";

/// The valid values of the setting.
pub(crate) const NEEDED_PLACE: &str = if cfg!(feature = "s3") {
    "memory, a folder, or s3://BUCKET/PREFIX"
} else {
    "memory or a folder (s3:// needs a server built with the feature s3)"
};

/// Where created objects and rigs are kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StorePlace {
    /// Nowhere but in memory: they end with the server, or when they are evicted.
    Memory,
    /// In a folder of this server's own.
    Folder(PathBuf),
    /// In a bucket of S3, under a prefix of this server's own.
    #[cfg(feature = "s3")]
    S3 {
        /// The bucket.
        bucket: String,
        /// The prefix, without slashes around it; may be empty.
        prefix: String,
    },
}

impl Default for StorePlace {
    /// The folder `grasp` where the system keeps the user's data (`XDG_DATA_HOME`, by default `~/.local/share`), or in the
    /// working folder for a user without a home.
    fn default() -> Self {
        let set = env::var_os("XDG_DATA_HOME").map(PathBuf::from);
        let in_home = || Some(env::home_dir()?.join(".local/share"));
        let folder = set.filter(|path| path.is_absolute()).or_else(in_home);
        Self::Folder(folder.unwrap_or_default().join(DEFAULT_FOLDER))
    }
}

impl StorePlace {
    /// The folder. `None` if objects are elsewhere.
    pub(crate) fn folder(&self) -> Option<&Path> {
        if let Self::Folder(path) = self {
            Some(path)
        } else {
            None
        }
    }

    /// Reads `memory`, a folder, or `s3://bucket/prefix`. `None` for any other text.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        match text.split_once("://") {
            None if text.is_empty() => None,
            None if text == "memory" => Some(Self::Memory),
            None => Some(Self::Folder(text.into())),
            #[cfg(feature = "s3")]
            Some(("s3", place)) => {
                let (bucket, prefix) = place.split_once('/').unwrap_or((place, ""));
                (!bucket.is_empty()).then(|| Self::S3 {
                    bucket: bucket.to_owned(),
                    prefix: prefix.trim_matches('/').to_owned(),
                })
            }
            Some(_) => None,
        }
    }
}

impl fmt::Display for StorePlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Memory => f.write_str("memory"),
            Self::Folder(path) => path.display().fmt(f),
            #[cfg(feature = "s3")]
            Self::S3 { bucket, prefix } => write!(f, "s3://{bucket}/{prefix}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_schemes_and_nothing_are_no_places() {
        for text in ["", "http://bucket", "s3://"] {
            assert_eq!(StorePlace::parse(text), None, "{text}");
        }
        assert_eq!(
            StorePlace::parse("s3://bucket/a/b/").is_some(),
            cfg!(feature = "s3")
        );
    }
}
