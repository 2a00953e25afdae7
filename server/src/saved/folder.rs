//! What a folder needs beyond what `object_store` does: one server at a time, no remains of interrupted writes, deletions that
//! last, and no other users.

#[cfg(unix)]
use std::os::unix::fs::{DirBuilderExt as _, PermissionsExt as _};
use std::{
    fs::{self, DirBuilder, File, TryLockError},
    io,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

/// The file that the server locks while it uses the folder.
const LOCK: &str = "lock";

/// How long to wait for the lock: a server that is being replaced may need some time to end.
const LOCK_WAIT: Duration = Duration::from_secs(5);

/// Interval between attempts to take the lock.
const LOCK_RETRY: Duration = Duration::from_millis(20);

/// Permissions of folders and files: none for others than their user.
const FOLDER_MODE: u32 = 0o700;
const FILE_MODE: u32 = 0o600;

/// In the names of files that `object_store` has yet to move to their place.
const UNFINISHED: char = '#';

/// A folder that only this server uses, as long as this lives.
#[derive(Debug)]
pub(super) struct OwnedFolder {
    path: PathBuf,
    _lock: File,
}

impl OwnedFolder {
    /// Creates the folder with these subfolders if necessary, takes it, and removes what interrupted writes left.
    ///
    /// # Errors
    /// It cannot be used, lacks a subfolder that it had, or another server uses it.
    pub(super) fn open(path: &Path, subfolders: &[&str]) -> io::Result<Self> {
        let is_new = !path.join(LOCK).exists();
        let missing = subfolders.iter().find(|subfolder| !path.join(subfolder).is_dir());
        if let Some(missing) = missing.filter(|_| !is_new) {
            let missing = path.join(missing).display().to_string();
            return Err(io::Error::other(format!(
                "{missing} is missing; mount the volume that has it, or create it empty to start without what it had"
            )));
        }
        create_private(path)?;
        for subfolder in subfolders {
            create_private(&path.join(subfolder))?;
        }
        let lock = File::create(path.join(LOCK))?;
        let start = Instant::now();
        while let Err(error) = lock.try_lock() {
            match error {
                TryLockError::WouldBlock if start.elapsed() < LOCK_WAIT => thread::sleep(LOCK_RETRY),
                TryLockError::WouldBlock => {
                    return Err(io::Error::other("another server uses it"));
                }
                TryLockError::Error(error) => return Err(error),
            }
        }
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

    /// Takes a file of it from all other users.
    pub(super) fn make_private(&self, file: &str) {
        make_private(&self.path.join(file));
    }

    /// Removes what interrupted writes left, and takes the rest from all other users.
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
    ///
    /// # Errors
    /// The disk failed.
    pub(super) fn sync(&self, subfolder: &str) -> io::Result<()> {
        // Only Unix can open a folder to synchronise it.
        if cfg!(unix) {
            File::open(self.path.join(subfolder))?.sync_all()?;
        }
        Ok(())
    }
}

/// Creates a folder for this user only, with those above it, or takes one that is there from all others.
///
/// # Errors
/// It cannot be created.
pub(crate) fn create_private(folder: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    #[cfg(unix)]
    builder.mode(FOLDER_MODE);
    builder.recursive(true).create(folder)?;
    set_mode(folder, FOLDER_MODE);
    Ok(())
}

/// Takes a file from all other users.
pub(crate) fn make_private(file: &Path) {
    set_mode(file, FILE_MODE);
}

/// Sets the permissions of a file or folder. A failure is logged: a volume's own folder may belong to another user.
fn set_mode(path: &Path, mode: u32) {
    #[cfg(unix)]
    {
        let others = |about: fs::Metadata| about.permissions().mode() & !mode & 0o777 != 0;
        let set = match fs::metadata(path).map(others) {
            Ok(true) => fs::set_permissions(path, fs::Permissions::from_mode(mode)),
            other => other.map(|_| ()),
        };
        if let Err(error) = set {
            tracing::warn!(path = %path.display(), %error, "cannot take a file of the store from other users");
        }
    }
}
