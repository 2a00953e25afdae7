//! What the tests share.

use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, AtomicU32, Ordering},
};

use grasp_assets::holdouts::holdouts;
use grasp_experiment::{
    atlases::Atlases,
    folder::{Folder, Manifest},
    make::Maker,
    plan::{Set, Settings},
    record::{Record, Source},
    run::{RunEnd, run},
};
use grasp_synthesis::model::strategy::Strategy;

/// A folder of its own that is gone when the test is over.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!(
            "grasp-experiment-{}-{}",
            std::process::id(),
            COUNT.fetch_add(1, Ordering::Relaxed)
        );
        let path = std::env::temp_dir().join(name);
        // What a killed run left behind under the same number.
        let _ = std::fs::remove_dir_all(&path);
        Self(path)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub(crate) fn index_of(name: &str) -> usize {
    holdouts()
        .iter()
        .position(|holdout| holdout.name == name)
        .expect("a built-in holdout")
}

/// Two easy holdouts, the sets C and D, and the columns of Figure 5.20.
pub(crate) fn small() -> Settings {
    Settings {
        seed: 7,
        valid: 3,
        invalid: 20,
        sets: vec![Set::ladder(Strategy::C), Set::ladder(Strategy::D)],
        holdouts: vec![index_of("scalpel-hold2"), index_of("scissors-hold1")],
        ..Settings::default()
    }
}

pub(crate) fn open(path: &Path, settings: &Settings) -> Folder {
    Folder::open(path, Manifest::new(settings.seed), false).expect("a folder of this run")
}

/// A maker with the atlases of a folder, which must be there if they are asked for: growing one takes minutes.
pub(crate) fn maker(settings: &Settings, folder: &Folder) -> Maker {
    let atlases = Atlases::complete(settings, folder, |_, _| None, &AtomicBool::new(true), |_| ());
    let atlases = atlases.expect("atlases").expect("complete atlases in the folder");
    Maker::new(settings, atlases).expect("built-in holdouts are sound")
}

/// Runs to the end.
pub(crate) fn complete(path: &Path, settings: &Settings) -> Folder {
    let mut folder = open(path, settings);
    let maker = maker(settings, &folder);
    let end = run(settings, &maker, &mut folder, &AtomicBool::new(false), |_| ()).expect("a run");
    assert_eq!(end, RunEnd::Complete);
    folder
}

/// A record without what a clock or a race decides.
pub(crate) fn timeless(record: &Record) -> Record {
    let mut record = record.clone();
    if record.cell.threads > 1 {
        record.source = Source::Attempt(0);
        record.search = None;
    }
    if let Some(search) = &mut record.search {
        search.nanoseconds = 0;
    }
    if let Some(details) = &mut record.details {
        details.step_nanoseconds = None;
    }
    record
}
