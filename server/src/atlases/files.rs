//! Atlases on disk: a file for each object and hand, named by the key of what it was made of.
//!
//! A file is written under another name first and then renamed, so that a reader finds the old one or the new one, whole.
//! All files together take at most [`MOST_BYTES`]: beyond that, those go first that were not used for longest.

use std::{
    fmt::Write as _,
    fs::{self, File},
    io::{self, Read as _},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
    time::SystemTime,
};

use grasp_assets::hands::Hand;
use grasp_synthesis::known::{
    codec::{decode, encode},
    growth::Grown,
    key::key,
};

use super::builder::told;
use crate::objects::StoredObject;

/// Bytes of all files together: those of 800 complete atlases. More remember more objects; clients who create objects
/// without end must not fill the disk.
const MOST_BYTES: u64 = 1 << 30;

/// Bytes of a file at most: three times those of a complete atlas. What is larger is not read.
const LARGEST_FILE: u64 = 4 << 20;

/// How the files' names end.
const EXTENSION: &str = "atlas";

/// Characters of a file's name: 128 bits of the key, which nobody hits by chance.
const NAME_BYTES: usize = 16;

/// A folder of atlases.
#[derive(Debug)]
pub(crate) struct AtlasFiles {
    folder: PathBuf,
    most_bytes: u64,
    /// Counts what was written, for names that no other thread uses.
    written: AtomicU64,
}

impl AtlasFiles {
    /// Makes the folder if need be.
    ///
    /// # Errors
    /// It cannot be made.
    pub(crate) fn open(folder: PathBuf) -> io::Result<Self> {
        fs::create_dir_all(&folder)?;
        Ok(Self {
            folder,
            most_bytes: MOST_BYTES,
            written: AtomicU64::new(0),
        })
    }

    /// The same folder with another bound.
    #[cfg(test)]
    pub(super) fn bounded(self, most_bytes: u64) -> Self {
        Self { most_bytes, ..self }
    }

    /// What was written for an object and a hand; none if nothing was, or if it cannot be used, which the log tells.
    pub(super) fn read(&self, object: &StoredObject, hand: &Hand) -> Option<Grown> {
        let path = self.path(object, hand);
        let read = read_bounded(&path).and_then(|bytes| {
            decode(&bytes, &object.object, &hand.rig)
                .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
        });
        match read {
            Ok(grown) => {
                // Used now: others go first. A folder that cannot be written to is still read.
                let _ = File::options()
                    .append(true)
                    .open(&path)
                    .and_then(|file| file.set_modified(SystemTime::now()));
                Some(grown)
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => {
                let file = path.display();
                tracing::warn!(object = object.name(), %file, %error, "an atlas cannot be read and is built again");
                None
            }
        }
    }

    /// Writes what has grown for an object and a hand; the log tells if it cannot.
    pub(super) fn write(&self, object: &StoredObject, hand: &'static Hand, grown: &Grown) {
        let bytes = encode(grown, &object.object, &hand.rig);
        if let Err(error) = self.replace(&self.path(object, hand), &bytes) {
            let folder = self.folder.display();
            let hand = told(hand);
            tracing::warn!(object = object.name(), %hand, %folder, %error, "an atlas cannot be written");
        }
    }

    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let number = self.written.fetch_add(1, Ordering::Relaxed);
        // Of this process and this write alone, and not an atlas by its name.
        let temporary = path.with_extension(format!("{}-{number}.part", std::process::id()));
        let result = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, path));
        if result.is_err() {
            let _ = fs::remove_file(&temporary);
        }
        result?;
        self.make_room(path)
    }

    /// Removes the files that were not used for longest, until the others take no more than they may. What was just
    /// written stays.
    fn make_room(&self, written: &Path) -> io::Result<()> {
        let mut files = Vec::new();
        for file in fs::read_dir(&self.folder)? {
            let path = file?.path();
            if path.extension().is_some_and(|extension| extension == EXTENSION)
                && let Ok(about) = fs::metadata(&path)
            {
                files.push((about.modified()?, about.len(), path));
            }
        }
        files.sort_unstable();
        let mut taken: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
        for (_, bytes, path) in files {
            if taken <= self.most_bytes {
                break;
            }
            if path != written {
                fs::remove_file(path)?;
                taken -= bytes;
            }
        }
        Ok(())
    }

    fn path(&self, object: &StoredObject, hand: &Hand) -> PathBuf {
        let mut name = String::with_capacity(2 * NAME_BYTES);
        for byte in &key(&object.object, &hand.rig)[..NAME_BYTES] {
            // Writing to a string cannot fail.
            let _ = write!(name, "{byte:02x}");
        }
        self.folder.join(name).with_extension(EXTENSION)
    }
}

/// The bytes of a file, unless it is too large for an atlas.
fn read_bounded(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            format!("it has more than {LARGEST_FILE} bytes"),
        ));
    }
    Ok(bytes)
}
