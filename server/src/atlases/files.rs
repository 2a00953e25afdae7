//! Atlases on disk: one file per object and hand, named after a hash of the atlas' inputs.
//!
//! A file is written under a temporary name ending in `.part` and then renamed, so that readers find the old file or
//! the new one, never half of one. All files together take at most [`MAX_BYTES`]; beyond that, the least recently used
//! ones are removed. Unfinished files that a crash left behind are removed at the next start.

use std::{
    fs::{self, File},
    io::{self, Read as _},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
    time::SystemTime,
};

use grasp_assets::hands::{Hand, hand};
use grasp_synthesis::{
    known::{
        codec::{decode, encode, file_name},
        growth::Grown,
    },
    model::hand::Handedness,
    propose::prepared::PreparedObject,
};

use super::hand_label;
use crate::{
    objects::StoredObject,
    saved::{create_private, write_private},
};

/// Largest total size of all files, in bytes: 15,000 complete atlases. It keeps clients that create ever more objects from
/// filling the disk.
const MAX_BYTES: u64 = 1 << 30;

/// Largest file that is read, in bytes: twice that of an atlas grown for hours, from which the server keeps the best part.
const MAX_FILE: u64 = 4 << 20;

/// Extension of a finished file.
const EXTENSION: &str = "atlas";

/// Hexadecimal digits in a file's name, which [`file_name`] takes from the key.
const KEY_DIGITS: usize = 32;

/// A folder of atlases.
#[derive(Debug)]
pub(crate) struct AtlasFiles {
    folder: PathBuf,
    most_bytes: u64,
}

impl AtlasFiles {
    /// Opens the folder, and removes unfinished files that a crash left in it. A missing one is created for this user only, as files
    /// are in any case; others may have been given access to one that exists.
    pub(crate) fn open(folder: PathBuf) -> io::Result<Self> {
        if !folder.is_dir() {
            create_private(&folder)?;
        }
        if let Err(error) = remove_unfinished(&folder) {
            let folder = folder.display();
            tracing::warn!(%folder, %error, "cannot remove unfinished atlas files");
        }
        Ok(Self {
            folder,
            most_bytes: MAX_BYTES,
        })
    }

    /// The same folder with another bound.
    #[cfg(test)]
    fn bounded(self, most_bytes: u64) -> Self {
        Self { most_bytes, ..self }
    }

    /// True if there is a file for an object and a hand, or for the hand of which it may be the mirror image.
    pub(super) fn may_have(&self, object: &StoredObject, of: &Hand) -> bool {
        let right = hand(&of.rig.name, Handedness::Right);
        let hands = right.map(|right| &**right).into_iter().chain([of]);
        let mut paths = hands.map(|hand| self.path(object, hand));
        paths.any(|path| path.exists())
    }

    /// Reads the atlas of an object and a hand. `None` if there is no file, or a broken one, which is logged.
    pub(super) fn read(
        &self,
        object: &StoredObject,
        prepared: &PreparedObject,
        hand: &Hand,
    ) -> Option<Grown> {
        let path = self.path(object, hand);
        let read = read_bounded(&path)
            .and_then(|bytes| decode(&bytes, prepared, &hand.rig).map_err(io::Error::other));
        match read {
            Ok(grown) => {
                // Marks the file as used. A read-only folder still serves atlases.
                let file = File::options().append(true).open(&path);
                let _ = file.and_then(|file| file.set_modified(SystemTime::now()));
                Some(grown)
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => {
                let file = path.display();
                tracing::warn!(object = object.name(), %file, %error, "rebuilding an atlas that cannot be read");
                None
            }
        }
    }

    /// Writes the atlas of an object and a hand; a failure is logged.
    pub(super) fn write(&self, object: &StoredObject, prepared: &PreparedObject, hand: &Hand, grown: &Grown) {
        let bytes = encode(grown, prepared, &hand.rig);
        if let Err(error) = self.replace(&self.path(object, hand), &bytes) {
            let folder = self.folder.display();
            let hand = hand_label(hand);
            tracing::warn!(object = object.name(), %hand, %folder, %error, "cannot write an atlas");
        }
    }

    fn replace(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let written = Self::write_whole(path, bytes);
        if written.is_err() {
            // Another server that shares the folder started just now, and took the file for one that a crash left.
            Self::write_whole(path, bytes)?;
        }
        self.make_room(path)
    }

    /// Writes a file under the name of an unfinished one, and gives it its final name.
    fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
        let part = part_of(path);
        let written = write_private(&part, bytes).and_then(|()| fs::rename(&part, path));
        written.inspect_err(|_| _ = fs::remove_file(&part))
    }

    /// Removes the least recently used files but `written`, until all files are within the bound. Unfinished files
    /// count, but are not removed here.
    fn make_room(&self, written: &Path) -> io::Result<()> {
        let mut finished = Vec::new();
        let mut taken = 0;
        for file in fs::read_dir(&self.folder)? {
            let path = file?.path();
            let Ok(about) = fs::metadata(&path) else {
                continue;
            };
            if path.extension().is_some_and(|extension| extension == EXTENSION) {
                taken += about.len();
                finished.push((about.modified()?, about.len(), path));
            } else if is_part_file(&path) {
                taken += about.len();
            }
        }
        finished.sort_unstable();
        for (_, bytes, path) in finished {
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
        self.folder.join(file_name(&object.object, &hand.rig))
    }
}

/// A new name `KEY.PROCESS-NUMBER.part` next to a file that is to be written.
fn part_of(path: &Path) -> PathBuf {
    /// Number of the next file, unique in this process.
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    path.with_extension(format!("{}-{number}.part", std::process::id()))
}

/// True for a name that [`part_of`] gives.
fn is_part_file(path: &Path) -> bool {
    let is_part = |name: &str| {
        let (key, rest) = name.split_once('.')?;
        let (process, number) = rest.strip_suffix(".part")?.split_once('-')?;
        let is_key =
            key.len() == KEY_DIGITS && key.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let are_numbers = [process, number]
            .iter()
            .all(|number| number.parse::<u64>().is_ok());
        Some(is_key && are_numbers)
    };
    let name = path.file_name().and_then(|name| name.to_str());
    name.and_then(is_part) == Some(true)
}

/// Removes the unfinished files of earlier processes, and logs how many there were.
fn remove_unfinished(folder: &Path) -> io::Result<()> {
    let (mut files, mut failed) = (0, Ok(()));
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        // A process id says nothing: in a container, it is the same after every restart.
        let is_file = fs::symlink_metadata(&path).is_ok_and(|about| about.is_file());
        if !is_file || !is_part_file(&path) {
            continue;
        }
        match fs::remove_file(&path) {
            Ok(()) => files += 1,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => failed = Err(error),
        }
    }
    if files > 0 {
        tracing::info!(folder = %folder.display(), files, "removed unfinished atlas files");
    }
    failed
}

/// The bytes of a file, unless it is too large for an atlas.
fn read_bounded(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_FILE + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_FILE {
        return Err(io::Error::other(format!("it has more than {MAX_FILE} bytes")));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::{os::unix::fs::MetadataExt as _, time::Duration};

    use glam::Vec3;

    use super::*;
    use crate::atlases::tests::{Folder, adult, cuboid, grown, prepared, small};

    /// Longer than the resolution of any file system's clock.
    fn pause() {
        std::thread::sleep(Duration::from_millis(20));
    }

    const KEY: &str = "0123456789abcdef0123456789abcdef";

    #[test]
    fn reads_written_files_and_rejects_broken_ones() {
        let folder = Folder::new("files");
        let files = folder.open();
        let (object, other) = (small("a"), cuboid("b", Vec3::new(0.03, 0.015, 0.05)));
        let grown = grown(&object);
        assert!(files.read(&object, &prepared(&object), adult()).is_none());
        files.write(&object, &prepared(&object), adult(), &grown);
        assert_eq!(
            files.read(&object, &prepared(&object), adult()).as_ref(),
            Some(&*grown)
        );
        assert!(files.read(&other, &prepared(&other), adult()).is_none());
        let names = folder.names();
        assert_eq!(names.len(), 1, "{names:?}");
        let path = folder.0.join(&names[0]);
        assert_eq!(path.extension(), Some(EXTENSION.as_ref()));
        assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        assert!(is_part_file(&part_of(&path)), "{:?}", part_of(&path));
        let whole = fs::read(&path).unwrap();
        for broken in [&whole[..whole.len() / 2], b"", &[&whole[..], b"more"].concat()] {
            fs::write(&path, broken).unwrap();
            assert!(files.read(&object, &prepared(&object), adult()).is_none());
        }
        files.write(&object, &prepared(&object), adult(), &grown);
        assert_eq!(
            files.read(&object, &prepared(&object), adult()).as_ref(),
            Some(&*grown)
        );
    }

    #[test]
    fn evicts_least_recently_used_files_and_counts_unfinished_ones() {
        let folder = Folder::new("room");
        let objects = [0.02, 0.021, 0.022].map(|x| cuboid("any", Vec3::new(x, 0.015, 0.05)));
        let prepared = objects.each_ref().map(prepared);
        let write = |files: &AtlasFiles, place: usize| {
            pause();
            let (object, grown) = (&objects[place], grown(&objects[place]));
            files.write(object, &prepared[place], adult(), &grown);
        };
        let files = folder.open();
        write(&files, 0);
        let bytes = folder.bytes();
        let files = files.bounded(5 * bytes / 2);
        let is_there = |place: usize| files.read(&objects[place], &prepared[place], adult()).is_some();
        write(&files, 1);
        pause();
        assert!(is_there(0));
        write(&files, 2);
        assert_eq!([0, 1, 2].map(is_there), [true, false, true]);
        let unfinished = folder.0.join(format!("{KEY}.7-0.part"));
        fs::write(unfinished, vec![0_u8; bytes as usize]).unwrap();
        write(&files, 1);
        assert_eq!([0, 1, 2].map(is_there), [false, true, false]);
    }

    #[test]
    fn opening_removes_unfinished_files_and_nothing_else() {
        let folder = Folder::new("part");
        // The name of this process too: a restarted container gives it to the next one.
        let own = format!("{KEY}.{}-0.part", std::process::id());
        let left_by_a_crash = [own, format!("{KEY}.1-25.part")];
        let foreign = [
            format!("{KEY}.atlas"),
            format!("{KEY}.part"),
            format!("{KEY}.1-.part"),
            format!("{KEY}.1-2.part.bak"),
            format!("{KEY}.x-2.part"),
            format!("{}.1-2.part", &KEY[1..]),
            format!("{}.1-2.part", KEY.to_uppercase()),
            "download.part".to_owned(),
        ];
        for name in left_by_a_crash.iter().chain(&foreign) {
            fs::write(folder.0.join(name), "unfinished").unwrap();
        }
        let directory = format!("{KEY}.1-3.part");
        fs::create_dir(folder.0.join(&directory)).unwrap();
        folder.open();
        let mut expected = [&foreign[..], &[directory]].concat();
        expected.sort();
        assert_eq!(folder.names(), expected);
    }
}
