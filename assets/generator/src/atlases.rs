//! The grips that ship with the server: those on the shortlists of complete atlases, of the built-in objects and of the
//! primitives, for both hands of the rig `adult`.

use std::{fs, io, path::Path, sync::Arc};

use grasp_assets::{
    atlases::file_name,
    hands::hand,
    objects::{BuiltInObject, objects},
};
use grasp_synthesis::{
    known::{
        atlas::Atlas,
        codec::{self, AtlasError, decode, encode},
        growth::{EARLY_PROPOSALS, Grown, Growth, MAX_PROPOSALS},
        primitives::Primitive,
    },
    model::{hand::Handedness, strategy::Validity},
    physical::{grip::Gripper, presented::ObjectScene},
    propose::prepared::{PreparedObject, PreparedRig},
};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::AssetFile;

/// The rig whose grips ship with the server: its default one.
const RIG: &str = "adult";

/// Largest file, in bytes. All files together are embedded, thirty times as much.
const MAX_BYTES: usize = 150_000;

/// Grips per file that the check assesses again: some tenths of a second. More catch rarer differences.
const CHECKED: usize = 200;

/// Why a file is not what would be made now.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
enum Difference {
    #[error("{0}")]
    Unreadable(#[from] AtlasError),
    #[error("it is not an excerpt of a complete atlas")]
    NotAnExcerpt,
    #[error("it has {0} bytes, more than {MAX_BYTES}")]
    TooLarge(usize),
    #[error("growth finds other grips: run `grasp-assets-generator algorithm`, then make the files again")]
    OtherGrips,
    #[error(
        "grip {0} is assessed differently: run `grasp-assets-generator algorithm`, then make the files again"
    )]
    OtherAssessment(usize),
}

/// Objects whose grips are shipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Collection {
    /// The built-in objects.
    Objects,
    /// The primitives.
    Primitives,
}

/// A file to be made.
struct Excerpt {
    name: String,
    object: Arc<PreparedObject>,
    rig: &'static PreparedRig,
}

impl Collection {
    /// The folder of the files, below the assets'.
    const fn folder(self) -> &'static str {
        match self {
            Self::Objects => "atlases",
            Self::Primitives => "primitives",
        }
    }

    /// Every object with every hand.
    fn excerpts(self) -> Vec<Excerpt> {
        let named: Vec<(String, Arc<PreparedObject>)> = match self {
            Self::Objects => {
                let named = |object: &BuiltInObject| (object.name.to_owned(), Arc::clone(&object.prepared));
                objects().iter().map(named).collect()
            }
            Self::Primitives => {
                let named = |primitive: Primitive| {
                    (
                        primitive.name(),
                        Arc::new(PreparedObject::new(Arc::new(primitive.object()))),
                    )
                };
                Primitive::ALL.map(named).into()
            }
        };
        let hands = [Handedness::Right, Handedness::Left].map(|side| {
            let hand = hand(RIG, side).expect("the rig is built in");
            &hand.rig
        });
        let each = |(name, object): (String, Arc<PreparedObject>)| {
            hands.map(|rig| Excerpt {
                name: file_name(&name, rig),
                object: Arc::clone(&object),
                rig,
            })
        };
        named.into_iter().flat_map(each).collect()
    }

    /// Grows all atlases, which takes minutes. If `complete` is a folder, the complete atlases are written there, under the
    /// names that a server looks for in its `atlas_directory`.
    ///
    /// # Errors
    /// The folder of the complete atlases cannot be written.
    pub(crate) fn generate(self, complete: Option<&Path>) -> io::Result<Vec<AssetFile>> {
        let bars = MultiProgress::new();
        let style = ProgressStyle::with_template("{msg:28} {bar:40} {pos}/{len} proposals, {elapsed}")
            .expect("the template is right");
        if let Some(folder) = complete {
            fs::create_dir_all(folder)?;
        }
        self.excerpts()
            .par_iter()
            .map(|excerpt| {
                let Excerpt { name, object, rig } = excerpt;
                let bar = bars.add(ProgressBar::new(MAX_PROPOSALS).with_style(style.clone()));
                bar.set_message(name.clone());
                let grown = grow(object, rig, &bar);
                if let Some(folder) = complete {
                    fs::write(
                        folder.join(codec::file_name(object, rig)),
                        encode(&grown, object, rig),
                    )?;
                }
                let bytes = encode(&grown.listed(object, rig).most_listed(object, rig), object, rig);
                Ok((self.path(name), bytes))
            })
            .collect()
    }

    /// Prints why each file below `folder` that is missing or not what would be made now differs; true if none is. Looks at every
    /// `nth` file only. Without any file, a server starts without grips and grows its atlases.
    pub(crate) fn check(self, folder: &Path, nth: usize) -> bool {
        if !folder.join(self.folder()).is_dir() {
            return true;
        }
        let excerpts: Vec<Excerpt> = self.excerpts().into_iter().step_by(nth).collect();
        let complaints: Vec<String> = excerpts
            .par_iter()
            .filter_map(|Excerpt { name, object, rig }| {
                let path = self.path(name);
                let complaint = match fs::read(folder.join(&path)) {
                    Err(error) => format!("cannot be read: {error}"),
                    Ok(bytes) => compare(&bytes, object, rig).err()?.to_string(),
                };
                Some(format!("{path}: {complaint}"))
            })
            .collect();
        for complaint in &complaints {
            println!("{complaint}");
        }
        complaints.is_empty()
    }

    fn path(self, name: &str) -> String {
        format!("{}/{name}.atlas", self.folder())
    }
}

fn grow(object: &PreparedObject, rig: &PreparedRig, bar: &ProgressBar) -> Grown {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while !growth.is_complete() {
        growth.round(&mut gripper);
        bar.set_position(growth.proposed());
    }
    bar.abandon();
    growth.grown()
}

/// Compares an excerpt with a new one.
fn compare(bytes: &[u8], object: &PreparedObject, rig: &PreparedRig) -> Result<(), Difference> {
    let shipped = decode(bytes, object, rig)?;
    if shipped.atlas.is_complete() || shipped.proposed > 0 || shipped.atlas.entries().is_empty() {
        return Err(Difference::NotAnExcerpt);
    }
    if bytes.len() > MAX_BYTES {
        return Err(Difference::TooLarge(bytes.len()));
    }
    if shipped.early_stamp != early_stamp(object, rig) {
        return Err(Difference::OtherGrips);
    }
    match first_difference(&shipped.atlas, object, rig) {
        Some(place) => Err(Difference::OtherAssessment(place)),
        None => Ok(()),
    }
}

/// The first of [`CHECKED`] grips from all over an atlas that is assessed differently now.
fn first_difference(shipped: &Atlas, object: &PreparedObject, rig: &PreparedRig) -> Option<usize> {
    let scene = ObjectScene::new(object, object.friction_under(Validity::Physical));
    let mut gripper = Gripper::default();
    let entries = shipped.entries();
    let step = entries.len().div_ceil(CHECKED).max(1);
    (0..entries.len()).step_by(step).find(|&place| {
        let entry = &entries[place];
        entry.reassessed(&scene, rig, &mut gripper).as_ref() != Some(entry)
    })
}

/// The stamp that growth has now after its first proposals: a second of work.
fn early_stamp(object: &PreparedObject, rig: &PreparedRig) -> u64 {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while growth.proposed() < EARLY_PROPOSALS {
        growth.round(&mut gripper);
    }
    growth.grown().early_stamp
}

#[cfg(test)]
mod tests {
    use grasp_synthesis::{
        known::{atlas::Grips, entry::Entry},
        physical::immobility::FrictionUse,
    };

    use super::*;

    /// Grows until there are so many grips.
    fn grown(entries: usize, object: &PreparedObject, rig: &PreparedRig) -> Grown {
        let mut growth = Growth::new(object, rig);
        let mut gripper = Gripper::default();
        while growth.len() < entries {
            growth.round(&mut gripper);
        }
        growth.grown()
    }

    #[test]
    fn shipped_grips_are_listed_by_the_complete_atlases_of_the_tests() {
        for Excerpt { name, object, rig } in Collection::Objects.excerpts() {
            if rig.handedness == Handedness::Left {
                continue;
            }
            let assets = Path::new(crate::ASSETS);
            let complete = fs::read(assets.join("complete").join(codec::file_name(&object, rig)));
            let complete = complete.unwrap_or_else(|error| panic!("the complete atlas {name}: {error}"));
            let grown = decode(&complete, &object, rig).expect("it is of this object and hand");
            let listed = encode(
                &grown.listed(&object, rig).most_listed(&object, rig),
                &object,
                rig,
            );
            let shipped = fs::read(assets.join(Collection::Objects.path(&name))).expect("it is there");
            assert!(listed == shipped, "{name}");
        }
    }

    /// Bytes of the files below a folder that have one of these extensions.
    fn bytes_below(folder: &Path, extensions: &[&str]) -> u64 {
        let files = fs::read_dir(folder).expect("the folder can be read");
        files
            .map(|file| {
                let path = file.expect("the folder can be listed").path();
                if path.is_dir() {
                    return bytes_below(&path, extensions);
                }
                let extension = path.extension().and_then(|extension| extension.to_str());
                if extension.is_some_and(|extension| extensions.contains(&extension)) {
                    fs::metadata(&path).expect("the file is there").len()
                } else {
                    0
                }
            })
            .sum()
    }

    #[test]
    fn generated_binaries_take_less_than_four_megabytes() {
        let assets = Path::new(crate::ASSETS);
        let extensions = ["atlas", "glb", "png"];
        let folders = ["atlases", "hands", "pictures", "primitives", "../tests/results"];
        let bytes = folders.map(|folder| bytes_below(&assets.join(folder), &extensions));
        assert!(bytes.iter().sum::<u64>() < 4_000_000, "{folders:?}: {bytes:?}");
    }

    #[test]
    fn reports_grip_that_is_assessed_differently() {
        let Excerpt { object, rig, .. } = &Collection::Objects.excerpts()[0];
        let made = grown(20, object, rig).atlas;
        assert_eq!(first_difference(&made, object, rig), None);
        let changed = |change: fn(&mut Entry)| {
            let mut entries = made.entries().to_vec();
            change(&mut entries[7]);
            first_difference(&Atlas::new(Grips::new(rig, entries), false), object, rig)
        };
        assert_eq!(changed(|entry| entry.grip.epsilon *= 1.5), Some(7));
        assert_eq!(changed(|entry| entry.scores[3] ^= 1), Some(7));
        let use_more = |entry: &mut Entry| {
            let more = match entry.friction_uses.get(3) {
                FrictionUse::Full => FrictionUse::Low,
                _ => FrictionUse::Full,
            };
            entry.friction_uses.set(3, more);
        };
        assert_eq!(changed(use_more), Some(7));
        assert_eq!(changed(|entry| entry.contacts.truncate(1)), Some(7));
    }

    #[test]
    fn reports_files_that_are_no_excerpts() {
        let Excerpt { object, rig, .. } = &Collection::Objects.excerpts()[0];
        let whole = grown(20, object, rig);
        for not_listed in [&Growth::new(object, rig).grown(), &whole] {
            let bytes = encode(not_listed, object, rig);
            assert_eq!(compare(&bytes, object, rig), Err(Difference::NotAnExcerpt));
        }
        let listed = encode(&whole.listed(object, rig), object, rig);
        assert_eq!(compare(&listed, object, rig), Err(Difference::OtherGrips));
        assert_eq!(
            compare(&listed[..listed.len() - 1], object, rig),
            Err(Difference::Unreadable(AtlasError::Damaged))
        );
    }
}
