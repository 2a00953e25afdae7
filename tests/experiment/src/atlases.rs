//! Complete atlases of the objects, for the sets that answer from an atlas.
//!
//! An atlas takes minutes to grow. Atlases that do not come with the objects grow before the first search, where they
//! disturb no measured time, and are saved in the run's folder, even partly grown: a resumed run finds them there. They
//! depend on object and hand but not on a run's seed, so a fresh start keeps them.

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
    propose::prepared::PreparedRig,
};

use crate::{
    folder::{Folder, FolderError, failed_to},
    make::receiving_hand,
    plan::{Cell, Set, Settings},
};

/// The folder of the atlases in a run's folder.
const FOLDER: &str = "atlases";

/// How often a growing atlas is saved. Longer loses more when a run is killed; shorter spends more time on saving, some
/// 30 ms each.
const KEEP_EVERY: Duration = Duration::from_secs(10);

/// Progress of an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasProgress {
    /// Its object.
    pub object: &'static str,
    /// Grips found, in this run or before.
    pub entries: u64,
    /// Proposals tried.
    pub proposed: u64,
    /// Largest number of proposals; it is complete earlier if it reaches its largest number of grips.
    pub total: u64,
    /// Why the atlas in the run's folder cannot be used and grows again.
    pub refused: Option<AtlasError>,
}

/// A source of shipped atlases: the bytes of an object's and a hand's atlas, if there is one.
pub type Shipped = fn(&str, &Rig) -> Option<&'static [u8]>;

/// Complete atlases by their objects.
#[derive(Debug, Default)]
pub struct Atlases(HashMap<&'static str, Arc<Atlas>>);

impl Atlases {
    /// The atlases that the settings and the folder's records need: from the folder, so that a run continues with the
    /// atlases it began with, or from `shipped`, or else grown to the end. None if stopped; what has grown by then is
    /// in the folder.
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
            // Objects of built-in holdouts and hands of sets are built in.
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

    /// The atlas of a cell; none if its set uses none.
    pub(crate) fn of(&self, cell: &Cell) -> Option<&Arc<Atlas>> {
        let object = cell.built_in().object.as_str();
        cell.set.atlas.then(|| self.0.get(object)).flatten()
    }
}

/// An object's complete atlas; none if stopped.
fn complete(
    object: &'static BuiltInObject,
    rig: &PreparedRig,
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
        Some(known) => Growth::resume(&object.prepared, rig, known),
        None => Growth::new(&object.prepared, rig),
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

/// The folder's atlas, if there is one.
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

/// Saves an atlas, under a temporary name until it is complete, so that no run reads half of one.
fn write(path: &Path, object: &BuiltInObject, rig: &Rig, grown: &Grown) -> Result<(), FolderError> {
    let parent = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(parent).map_err(failed_to("make", parent))?;
    let unfinished = path.with_extension("part");
    fs::write(&unfinished, encode(grown, &object.object, rig))
        .and_then(|()| fs::rename(&unfinished, path))
        .map_err(failed_to("write", path))
}
