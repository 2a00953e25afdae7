//! Complete atlases of the objects, for the sets that answer from an atlas.
//!
//! An atlas takes some twenty seconds to grow. All grow before the first search, where they disturb no measured time. They
//! depend on object and hand but not on a run's seed: all runs, tests and benches share one folder.

use std::{
    collections::HashMap,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use grasp_assets::{
    atlas_folder::{AtlasFolder, AtlasFolderError},
    objects::object,
};
use grasp_synthesis::known::{atlas::Atlas, codec::AtlasError, growth::MAX_PROPOSALS};

use crate::{
    folder::Folder,
    make::receiving_hand,
    plan::{Cell, Set, Settings},
};

/// Progress of an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasProgress {
    /// Its object.
    pub object: &'static str,
    /// Grips found, in this run or before.
    pub entries: u64,
    /// Proposals tried for them.
    pub proposed: u64,
    /// Upper bound on the proposals; fewer if the atlas fills up before.
    pub total: u64,
    /// Why the file in the folder is replaced rather than resumed.
    pub rejected: Option<AtlasError>,
}

/// Complete atlases by object.
#[derive(Debug, Default)]
pub struct Atlases(HashMap<&'static str, Arc<Atlas>>);

impl Atlases {
    /// The atlases that the settings and the records of a run need: read from `atlases`, or else grown and kept there.
    /// None if `stop` was set first; what has grown by then is kept.
    ///
    /// # Errors
    /// The folder of atlases cannot be read or written.
    pub fn complete(
        settings: &Settings,
        run: &Folder,
        atlases: &AtlasFolder,
        stop: &AtomicBool,
        mut progress: impl FnMut(AtlasProgress),
    ) -> Result<Option<Self>, AtlasFolderError> {
        let cells = settings.cells();
        let recorded = run.records().iter().map(|record| &record.cell);
        let mut objects: Vec<&'static str> = Vec::new();
        for cell in cells.iter().chain(recorded).filter(|cell| cell.set.atlas) {
            let name = cell.built_in().object.as_str();
            if !objects.contains(&name) {
                objects.push(name);
            }
        }
        let mut complete = Self::default();
        for name in objects {
            // Objects of built-in holdouts and hands of sets are built in.
            let Some((object, hand)) = object(name).zip(receiving_hand(Set::ATLAS)) else {
                continue;
            };
            let grown = atlases.grow_while(&object.prepared, &hand.rig, |now| {
                progress(AtlasProgress {
                    object: object.name,
                    entries: now.entries,
                    proposed: now.proposed,
                    total: MAX_PROPOSALS,
                    rejected: now.rejected,
                });
                !stop.load(Ordering::Relaxed)
            })?;
            match grown {
                Some(atlas) => complete.0.insert(name, atlas),
                None => return Ok(None),
            };
        }
        Ok(Some(complete))
    }

    /// The atlas of a cell; none if its set uses none.
    pub(crate) fn of(&self, cell: &Cell) -> Option<&Arc<Atlas>> {
        let object = cell.built_in().object.as_str();
        cell.set.atlas.then(|| self.0.get(object)).flatten()
    }
}
