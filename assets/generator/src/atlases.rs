//! The atlases of the built-in objects for both hands of the rig `adult`.

use std::{fs, path::Path, sync::LazyLock};

use grasp_assets::{
    atlases::file_name,
    hands::hand,
    objects::{BuiltInObject, objects},
};
use grasp_synthesis::{
    atlas::{
        Atlas,
        codec::{AtlasError, decode, encode},
        growth::Growth,
    },
    hand::{Handedness, rig::Rig},
    object::GraspObject,
    physical::grip::Gripper,
};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::AssetFile;

/// The rig whose atlases come with the server: its default one.
const RIG: &str = "adult";

/// Bytes of a file at most. More make the program larger, by six times as much.
const MOST_BYTES: usize = 1_200_000;

/// Grips that a check finds anew and compares: a second of work. More notice rarer differences.
const CHECKED: usize = 200;

/// Why a file is not what would be made now.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
enum Difference {
    #[error("{0}")]
    Unreadable(#[from] AtlasError),
    #[error("it is not complete")]
    Incomplete,
    #[error("it has {0} bytes, more than {MOST_BYTES}")]
    TooLarge(usize),
    #[error(
        "grip {0} is found differently now: make them again, and raise ALGORITHM of grasp_synthesis::atlas::key"
    )]
    OtherGrip(usize),
}

/// Every object with every hand.
static PAIRS: LazyLock<Vec<(&BuiltInObject, &Rig)>> = LazyLock::new(|| {
    let hands = [Handedness::Right, Handedness::Left].map(|side| {
        let hand = hand(RIG, side).expect("the rig is built in");
        &hand.rig
    });
    objects()
        .iter()
        .flat_map(|object| hands.map(|rig| (object, rig)))
        .collect()
});

/// Builds all of them: minutes.
pub(crate) fn generate() -> Vec<AssetFile> {
    let bars = MultiProgress::new();
    let style = ProgressStyle::with_template("{msg:24} {bar:40} {pos}/{len} grips, {elapsed}")
        .expect("the template is right");
    PAIRS
        .par_iter()
        .map(|(object, rig)| {
            let name = file_name(object.name, rig);
            let most = grasp_synthesis::atlas::growth::ENTRIES as u64;
            let bar = bars.add(ProgressBar::new(most).with_style(style.clone()));
            bar.set_message(name.clone());
            (path(&name), complete(&object.object, rig, &bar))
        })
        .collect()
}

fn complete(object: &GraspObject, rig: &Rig, bar: &ProgressBar) -> Vec<u8> {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while !growth.is_complete() {
        growth.round(&mut gripper);
        bar.set_position(growth.len() as u64);
    }
    bar.abandon();
    encode(&growth.grown(), object, rig)
}

/// Says of every file below `folder` that is missing or not what would be made now why; true if there is none. Without
/// any, a server builds its own.
pub(crate) fn check(folder: &Path) -> bool {
    if !folder.join("atlases").is_dir() {
        return true;
    }
    let complaints: Vec<String> = PAIRS
        .par_iter()
        .filter_map(|(object, rig)| {
            let path = path(&file_name(object.name, rig));
            let complaint = match fs::read(folder.join(&path)) {
                Err(error) => format!("cannot be read: {error}"),
                Ok(bytes) => compare(&bytes, &object.object, rig).err()?.to_string(),
            };
            Some(format!("{path}: {complaint}"))
        })
        .collect();
    for complaint in &complaints {
        println!("{complaint}");
    }
    complaints.is_empty()
}

/// Compares an atlas with what would be made now.
fn compare(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<(), Difference> {
    let made = decode(bytes, object, rig)?;
    if !made.atlas.is_complete() {
        return Err(Difference::Incomplete);
    }
    if bytes.len() > MOST_BYTES {
        return Err(Difference::TooLarge(bytes.len()));
    }
    match first_difference(&made.atlas, object, rig, CHECKED) {
        Some(place) => Err(Difference::OtherGrip(place)),
        None => Ok(()),
    }
}

/// The first grip of an atlas that is not what is found now; the first `count` are found anew.
fn first_difference(made: &Atlas, object: &GraspObject, rig: &Rig, count: usize) -> Option<usize> {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while growth.len() < count && !growth.is_complete() {
        growth.round(&mut gripper);
    }
    let now = growth.atlas();
    (0..count.min(now.entries().len())).find(|&place| made.entries().get(place) != now.entries().get(place))
}

fn path(name: &str) -> String {
    format!("atlases/{name}.atlas")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grip_that_is_found_differently_is_named() {
        let (object, rig) = PAIRS[0];
        let object = &object.object;
        let mut growth = Growth::new(object, rig);
        let mut gripper = Gripper::default();
        while growth.len() < 20 {
            growth.round(&mut gripper);
        }
        let made = growth.atlas();
        assert_eq!(first_difference(&made, object, rig, 20), None);
        let mut entries = made.entries().to_vec();
        entries[7].epsilon *= 1.5;
        assert_eq!(
            first_difference(&Atlas::new(entries.clone(), false), object, rig, 20),
            Some(7)
        );
        entries.truncate(5);
        assert_eq!(
            first_difference(&Atlas::new(entries, false), object, rig, 20),
            Some(5)
        );
    }

    #[test]
    fn what_is_not_complete_is_told() {
        let (object, rig) = PAIRS[0];
        let bytes = encode(&Growth::new(&object.object, rig).grown(), &object.object, rig);
        assert_eq!(compare(&bytes, &object.object, rig), Err(Difference::Incomplete));
        assert_eq!(
            compare(&bytes[..bytes.len() - 1], &object.object, rig),
            Err(Difference::Unreadable(AtlasError::Damaged))
        );
    }
}
