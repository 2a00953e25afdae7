//! The complete atlases of the objects, which the sets with an atlas answer from.
//!
//! An atlas takes minutes to grow. Those that do not come with the objects are therefore grown before anything is
//! searched for, so that they disturb no time, and are kept in the run's folder, also while they grow: a run that goes on
//! finds them there. They hang on object and hand alone and not on a run's seed, so that a fresh start keeps them.

use std::{
    collections::HashMap,
    fs, io,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use grasp_assets::{
    atlases::file_name,
    objects::{BuiltInObject, object},
};
use grasp_synthesis::{
    known::{
        atlas::Atlas,
        codec::{AtlasError, decode, encode},
        growth::{Grown, Growth, MOST_PROPOSALS},
    },
    model::hand::rig::Rig,
    physical::grip::Gripper,
};

use crate::{
    folder::{Folder, FolderError, failed_to},
    make::receiving_hand,
    plan::{Cell, Set, Settings},
};

/// The folder of the atlases in that of a run.
const FOLDER: &str = "atlases";

/// How often an atlas is kept while it grows. Longer loses more when a run is killed; shorter takes more of the time for
/// sorting and writing, some 30 ms each.
const KEEP_EVERY: Duration = Duration::from_secs(10);

/// How far an atlas is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasProgress {
    /// Its object.
    pub object: &'static str,
    /// Grips that were found, in this run or before.
    pub entries: u64,
    /// Proposals that were tried for them.
    pub proposed: u64,
    /// Proposals after which it is complete at the latest; earlier if it has all the grips that it may have.
    pub total: u64,
    /// Why the one in the run's folder is grown again.
    pub refused: Option<AtlasError>,
}

/// Where atlases that need not be grown come from: the bytes of an object's and a hand's, if there are any.
pub type Shipped = fn(&str, &Rig) -> Option<&'static [u8]>;

/// Complete atlases by their objects.
#[derive(Debug, Default)]
pub struct Atlases(HashMap<&'static str, Arc<Atlas>>);

impl Atlases {
    /// The atlases that the settings and what a folder has ask for: read from the folder if they are there, so that a run
    /// goes on with what it began with, or `shipped`, or else grown to the end. None if it was told to stop; what has grown
    /// by then is in the folder.
    ///
    /// # Errors
    /// An atlas in the folder cannot be read, or none can be written.
    pub fn complete(
        settings: &Settings,
        folder: &Folder,
        shipped: Shipped,
        stop: &AtomicBool,
        mut progress: impl FnMut(AtlasProgress),
    ) -> Result<Option<Self>, FolderError> {
        let cells = settings.cells();
        let recorded = folder.records().iter().map(|record| &record.cell);
        let mut objects: Vec<&'static str> = Vec::new();
        for cell in cells.iter().chain(recorded).filter(|cell| cell.set.atlas) {
            let name = cell.built_in().object.as_str();
            if !objects.contains(&name) {
                objects.push(name);
            }
        }
        let folder = folder.path().join(FOLDER);
        let mut atlases = Self::default();
        for name in objects {
            // Built-in holdouts hold built-in objects out, and a set's hand is built in.
            let Some((object, hand)) = object(name).zip(receiving_hand(Set::ATLAS)) else {
                continue;
            };
            match complete(object, &hand.rig, &folder, shipped, stop, &mut progress)? {
                Some(atlas) => atlases.0.insert(name, atlas),
                None => return Ok(None),
            };
        }
        Ok(Some(atlases))
    }

    /// The atlas for a cell; none if its set has none.
    pub(crate) fn of(&self, cell: &Cell) -> Option<&Arc<Atlas>> {
        let object = cell.built_in().object.as_str();
        cell.set.atlas.then(|| self.0.get(object)).flatten()
    }
}

/// An object's atlas, none if it was told to stop.
fn complete(
    object: &'static BuiltInObject,
    rig: &Rig,
    folder: &Path,
    shipped: Shipped,
    stop: &AtomicBool,
    progress: &mut impl FnMut(AtlasProgress),
) -> Result<Option<Arc<Atlas>>, FolderError> {
    let path = folder.join(file_name(object.name, rig)).with_extension("atlas");
    let (known, refused) = match read(&path, object, rig)?.transpose() {
        Ok(Some(known)) if known.atlas.is_complete() => return Ok(Some(known.atlas)),
        Ok(known) => (known, None),
        Err(error) => (None, Some(error)),
    };
    let shipped = shipped(object.name, rig).and_then(|bytes| decode(bytes, &object.object, rig).ok());
    if let Some(shipped) = shipped.filter(|shipped| shipped.atlas.is_complete()) {
        return Ok(Some(shipped.atlas));
    }
    let mut growth = match &known {
        Some(known) => Growth::resume(&object.object, rig, known),
        None => Growth::new(&object.object, rig),
    };
    let mut gripper = Gripper::default();
    let mut kept = Instant::now();
    while !growth.is_complete() {
        progress(AtlasProgress {
            object: object.name,
            entries: growth.len() as u64,
            proposed: growth.proposed(),
            total: MOST_PROPOSALS,
            refused,
        });
        if stop.load(Ordering::Relaxed) {
            write(&path, object, rig, &growth.grown())?;
            return Ok(None);
        }
        growth.round(&mut gripper);
        if kept.elapsed() >= KEEP_EVERY {
            write(&path, object, rig, &growth.grown())?;
            kept = Instant::now();
        }
    }
    let grown = growth.grown();
    write(&path, object, rig, &grown)?;
    Ok(Some(grown.atlas))
}

/// What the folder has; none if it has nothing.
fn read(
    path: &Path,
    object: &BuiltInObject,
    rig: &Rig,
) -> Result<Option<Result<Grown, AtlasError>>, FolderError> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(decode(&bytes, &object.object, rig))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed_to("read", path)(error)),
    }
}

/// Keeps an atlas. It is renamed when it is whole, so that no run finds half of one.
fn write(path: &Path, object: &BuiltInObject, rig: &Rig, grown: &Grown) -> Result<(), FolderError> {
    let parent = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(parent).map_err(failed_to("make", parent))?;
    let unfinished = path.with_extension("part");
    fs::write(&unfinished, encode(grown, &object.object, rig))
        .and_then(|()| fs::rename(&unfinished, path))
        .map_err(failed_to("write", path))
}
