//! What a folder needs beyond what `object_store` does: one server at a time, no remains of interrupted writes, and
//! deletions that last.

use std::{
    fs::{self, File, TryLockError},
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
    /// It cannot be used, or another server uses it.
    pub(super) fn open(path: &Path, subfolders: &[&str]) -> io::Result<Self> {
        for subfolder in subfolders {
            fs::create_dir_all(path.join(subfolder))?;
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
        for subfolder in subfolders {
            folder.remove_unfinished(subfolder)?;
            folder.sync(subfolder)?;
        }
        folder.sync("")?;
        Ok(folder)
    }

    fn remove_unfinished(&self, subfolder: &str) -> io::Result<()> {
        for entry in fs::read_dir(self.path.join(subfolder))? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().contains(UNFINISHED) {
                fs::remove_file(entry.path())?;
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
