//! The atlases of the built-in objects for both hands of the rig `adult`, and of primitives the grips of their lists.

use std::{fs, path::Path, sync::Arc};

use grasp_assets::{
    atlases::file_name,
    hands::hand,
    objects::{BuiltInObject, objects},
};
use grasp_synthesis::{
    known::{
        atlas::Atlas,
        codec::{AtlasError, decode, encode},
        growth::{EARLY_PROPOSALS, Growth, MOST_PROPOSALS},
        primitives::Primitive,
    },
    model::{
        hand::{Handedness, rig::Rig},
        object::GraspObject,
        strategy::Validity,
    },
    physical::{grip::Gripper, scene::ObjectScene},
};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::AssetFile;

/// The rig whose atlases come with the server: its default one.
const RIG: &str = "adult";

/// Bytes of a file at most. More make the program larger, by six times as much.
const MOST_BYTES: usize = 2_200_000;

/// Grips of a file that are assessed anew: some tenths of a second. More notice rarer differences.
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
        "grips are found differently now: make them again, and raise ALGORITHM of grasp_synthesis::known::key"
    )]
    OtherGrips,
    #[error(
        "grip {0} is worth something else now: make them again, and raise ALGORITHM of grasp_synthesis::known::key"
    )]
    OtherWorth(usize),
}

/// What is made of an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kept {
    /// All its grips: for the built-in objects.
    All,
    /// Those of its lists: for the primitives.
    Listed,
}

/// A file to be made.
struct Making {
    name: String,
    object: Arc<GraspObject>,
    rig: &'static Rig,
}

impl Kept {
    /// The folder of the files, below the assets'.
    const fn folder(self) -> &'static str {
        match self {
            Self::All => "atlases",
            Self::Listed => "primitives",
        }
    }

    /// Everything to be held with every hand.
    fn makings(self) -> Vec<Making> {
        let held: Vec<(String, Arc<GraspObject>)> = match self {
            Self::All => {
                let named = |object: &BuiltInObject| (object.name.to_owned(), Arc::clone(&object.object));
                objects().iter().map(named).collect()
            }
            Self::Listed => {
                let named = |primitive: Primitive| (primitive.name(), Arc::new(primitive.object()));
                Primitive::ALL.map(named).into()
            }
        };
        let hands = [Handedness::Right, Handedness::Left].map(|side| {
            let hand = hand(RIG, side).expect("the rig is built in");
            &hand.rig
        });
        let each = |(name, object): (String, Arc<GraspObject>)| {
            hands.map(|rig| Making {
                name: file_name(&name, rig),
                object: Arc::clone(&object),
                rig,
            })
        };
        held.into_iter().flat_map(each).collect()
    }

    /// Builds all of them: minutes.
    pub(crate) fn generate(self) -> Vec<AssetFile> {
        let bars = MultiProgress::new();
        let style = ProgressStyle::with_template("{msg:28} {bar:40} {pos}/{len} proposals, {elapsed}")
            .expect("the template is right");
        self.makings()
            .par_iter()
            .map(|making| {
                let bar = bars.add(ProgressBar::new(MOST_PROPOSALS).with_style(style.clone()));
                bar.set_message(making.name.clone());
                (self.path(&making.name), self.make(making, &bar))
            })
            .collect()
    }

    fn make(self, Making { object, rig, .. }: &Making, bar: &ProgressBar) -> Vec<u8> {
        let mut growth = Growth::new(object, rig);
        let mut gripper = Gripper::default();
        while !growth.is_complete() {
            growth.round(&mut gripper);
            bar.set_position(growth.proposed());
        }
        bar.abandon();
        let grown = match self {
            Self::All => growth.grown(),
            Self::Listed => growth.grown().listed(object, rig),
        };
        encode(&grown, object, rig)
    }

    /// Says of every file below `folder` that is missing or not what would be made now why; true if there is none. Without
    /// any, a server builds its own atlases and does without primitives.
    pub(crate) fn check(self, folder: &Path) -> bool {
        if !folder.join(self.folder()).is_dir() {
            return true;
        }
        let complaints: Vec<String> = self
            .makings()
            .par_iter()
            .filter_map(|Making { name, object, rig }| {
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

/// Compares an atlas with what would be made now.
fn compare(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<(), Difference> {
    let made = decode(bytes, object, rig)?;
    if !made.atlas.is_complete() {
        return Err(Difference::Incomplete);
    }
    if bytes.len() > MOST_BYTES {
        return Err(Difference::TooLarge(bytes.len()));
    }
    if made.early_stamp() != early_stamp(object, rig) {
        return Err(Difference::OtherGrips);
    }
    first_difference(&made.atlas, object, rig).map_or(Ok(()), |place| Err(Difference::OtherWorth(place)))
}

/// The first grip of an atlas, of [`CHECKED`] from all over it, that is worth something else now.
fn first_difference(made: &Atlas, object: &GraspObject, rig: &Rig) -> Option<usize> {
    let scene = ObjectScene::new(object, object.friction_under(Validity::Physical));
    let mut gripper = Gripper::default();
    let entries = made.entries();
    let apart = entries.len().div_ceil(CHECKED).max(1);
    (0..entries.len()).step_by(apart).find(|&place| {
        let entry = &entries[place];
        entry.reassessed(&scene, rig, &mut gripper).as_ref() != Some(entry)
    })
}

/// The stamp that an atlas has now after its first proposals: a second of work.
fn early_stamp(object: &GraspObject, rig: &Rig) -> u64 {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while growth.proposed() < EARLY_PROPOSALS {
        growth.round(&mut gripper);
    }
    growth.grown().early_stamp()
}

#[cfg(test)]
mod tests {
    use grasp_synthesis::{
        known::{entry::Entry, grips::Grips},
        physical::immobility::FrictionUse,
    };

    use super::*;

    #[test]
    fn the_early_stamp_is_that_of_the_first_proposals() {
        let [Making { object, rig, .. }, other, ..] = &Kept::All.makings()[..] else {
            panic!("there are objects and hands");
        };
        let mut growth = Growth::new(object, rig);
        let mut gripper = Gripper::default();
        while growth.proposed() < EARLY_PROPOSALS {
            assert_eq!(growth.grown().early_stamp(), 0);
            growth.round(&mut gripper);
        }
        let early = growth.atlas().stamp();
        growth.round(&mut gripper);
        let later = growth.grown();
        assert_ne!(later.atlas.stamp(), early);
        assert_eq!(later.early_stamp(), early);
        assert_eq!(early_stamp(object, rig), early);
        let read = decode(&encode(&later, object, rig), object, rig).expect("it was just written");
        assert_eq!(read.early_stamp(), early);
        // The other hand's is another: the stamp tells growth apart.
        assert_ne!(early_stamp(object, other.rig), early);
    }

    #[test]
    fn a_grip_that_is_worth_something_else_is_named() {
        let Making { object, rig, .. } = &Kept::All.makings()[0];
        let mut growth = Growth::new(object, rig);
        let mut gripper = Gripper::default();
        while growth.len() < 20 {
            growth.round(&mut gripper);
        }
        let made = growth.atlas();
        assert_eq!(first_difference(&made, object, rig), None);
        let changed = |change: fn(&mut Entry)| {
            let mut entries = made.entries().to_vec();
            change(&mut entries[7]);
            first_difference(
                &Atlas::new(object, rig, Grips::new(rig, entries), false),
                object,
                rig,
            )
        };
        assert_eq!(changed(|entry| entry.grip.epsilon *= 1.5), Some(7));
        assert_eq!(changed(|entry| entry.scores[3] ^= 1), Some(7));
        let use_more = |entry: &mut Entry| {
            let more = match entry.friction_uses.get(3) {
                FrictionUse::Full => FrictionUse::Sparing,
                _ => FrictionUse::Full,
            };
            entry.friction_uses.set(3, more);
        };
        assert_eq!(changed(use_more), Some(7));
        assert_eq!(changed(|entry| entry.contacts.truncate(1)), Some(7));
    }

    #[test]
    fn what_is_not_complete_is_told() {
        let Making { object, rig, .. } = &Kept::All.makings()[0];
        let bytes = encode(&Growth::new(object, rig).grown(), object, rig);
        assert_eq!(compare(&bytes, object, rig), Err(Difference::Incomplete));
        assert_eq!(
            compare(&bytes[..bytes.len() - 1], object, rig),
            Err(Difference::Unreadable(AtlasError::Damaged))
        );
    }
}
