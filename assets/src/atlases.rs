//! Grips that ship with the server, of the built-in objects and of primitives; and complete atlases.
//!
//! Only the grips on an atlas's shortlists are embedded: some hundreds, enough for first answers. A server grows the rest
//! in the background. Tests, benches and experiments that need complete atlases take them from [`complete_atlas`].

use std::{
    collections::HashMap,
    env, fs, io,
    path::{Path, PathBuf},
    sync::{Arc, LazyLock, Mutex, PoisonError},
};

use grasp_synthesis::{
    known::{
        atlas::Atlas,
        codec::{self, decode, encode},
        growth::Growth,
        primitives::{HeldPrimitive, Primitive},
    },
    model::{
        hand::{Handedness, rig::Rig},
        object::GraspObject,
    },
    physical::grip::Gripper,
    propose::prepared::{PreparedObject, PreparedRig},
};

use crate::{
    hands::{Hand, hand},
    objects::object,
};

/// Embedded files by name.
type Files = &'static [(&'static str, &'static [u8])];

const OBJECTS: Files = include!(concat!(env!("OUT_DIR"), "/atlases.rs"));
const PRIMITIVES: Files = include!(concat!(env!("OUT_DIR"), "/primitives.rs"));

/// The rig whose hands have grips at primitives.
const PRIMITIVES_RIG: &str = "adult";

fn embedded(files: Files, name: &str) -> Option<&'static [u8]> {
    files
        .iter()
        .find(|(file, _)| *file == name)
        .map(|(_, bytes)| *bytes)
}

/// Name of the embedded file for an object and a hand, without extension: "remote-adult-right".
pub fn file_name(object: &str, rig: &Rig) -> String {
    let side = match rig.handedness {
        Handedness::Left => "left",
        Handedness::Right => "right",
    };
    format!("{object}-{}-{side}", rig.name)
}

/// The embedded grips of a built-in object and a hand, to be read by `grasp_synthesis::known::codec::decode`; `None` for hands
/// that ship without.
pub fn shipped_atlas(object: &str, rig: &Rig) -> Option<&'static [u8]> {
    embedded(OBJECTS, &file_name(object, rig))
}

/// The complete atlas of a built-in object. One that this crate's folder `complete` lacks is grown on first use, which takes some
/// twenty seconds, and kept in `target/atlases`. Each is read once per process. A fresh clone grows none of those that its tests
/// need.
///
/// # Panics
/// The object is not built in, or `target/atlases` cannot be read or written.
pub fn complete_atlas(object_name: &str, rig: &PreparedRig) -> Arc<Atlas> {
    /// Atlases by file; a slot stays locked while its atlas grows, so that parallel tests do not all grow it.
    type Slots = HashMap<PathBuf, Arc<Mutex<Option<Arc<Atlas>>>>>;
    static READ: LazyLock<Mutex<Slots>> = LazyLock::new(Mutex::default);

    let object = &object(object_name).expect("the object is built in").prepared;
    let file = codec::file_name(object, rig);
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let target = env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    let grown = crate_folder.join("..").join(target).join("atlases").join(&file);
    let mut slots = READ.lock().unwrap_or_else(PoisonError::into_inner);
    let slot = Arc::clone(slots.entry(grown.clone()).or_default());
    drop(slots);
    let mut atlas = slot.lock().unwrap_or_else(PoisonError::into_inner);
    let atlas = atlas.get_or_insert_with(|| {
        let kept = crate_folder.join("complete").join(&file);
        let other = || read(&grown, object, rig).filter(|atlas| atlas.is_complete());
        let known = read(&kept, object, rig).or_else(other);
        known.unwrap_or_else(|| grow(&grown, object, rig))
    });
    Arc::clone(atlas)
}

/// The atlas of a file; `None` if there is no file, or one of another version.
fn read(path: &Path, object: &GraspObject, rig: &Rig) -> Option<Arc<Atlas>> {
    match fs::read(path) {
        Ok(bytes) => decode(&bytes, object, rig).ok().map(|grown| grown.atlas),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => panic!("cannot read {}: {error}", path.display()),
    }
}

/// Grows an atlas and writes it to a temporary file that is renamed, so that no reader sees half of one.
fn grow(path: &Path, object: &PreparedObject, rig: &PreparedRig) -> Arc<Atlas> {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while !growth.is_complete() {
        growth.round(&mut gripper);
    }
    let grown = growth.grown();
    let unfinished = path.with_extension(format!("{}.part", std::process::id()));
    fs::create_dir_all(path.parent().unwrap_or(Path::new("")))
        .and_then(|()| fs::write(&unfinished, encode(&grown, object, rig)))
        .and_then(|()| fs::rename(&unfinished, path))
        .unwrap_or_else(|error| panic!("cannot write {}: {error}", path.display()));
    grown.atlas
}

/// A hand with its grips at primitives.
type Known = (Arc<Hand>, Arc<[HeldPrimitive]>);

/// The hands that have grips at primitives, and the grips. Reading them on first use takes some tens of milliseconds.
pub fn held_primitives() -> &'static [Known] {
    static HELD: LazyLock<Vec<Known>> = LazyLock::new(|| {
        let hands = [Handedness::Left, Handedness::Right].map(|side| hand(PRIMITIVES_RIG, side));
        let mut held: Vec<_> = hands
            .into_iter()
            .flatten()
            .map(|hand| (hand, Vec::new()))
            .collect();
        // One box at a time: its search structures are larger than its grips.
        for primitive in Primitive::ALL {
            let object = primitive.object();
            for (hand, held) in &mut held {
                held.extend(held_by(&hand.rig, primitive, &object));
            }
        }
        let held = held.into_iter();
        held.map(|(hand, held)| (Arc::clone(hand), held.into())).collect()
    });
    &HELD
}

/// The embedded grips of a primitive and a hand; `None` if there is none.
pub fn grips(primitive: Primitive, rig: &Rig) -> Option<&'static [u8]> {
    embedded(PRIMITIVES, &file_name(&primitive.name(), rig))
}

/// A primitive's grips, if they are there and current. A missing primitive is no error: searches only have fewer seeds.
/// The generator's check reports it.
fn held_by(rig: &Rig, primitive: Primitive, object: &GraspObject) -> Option<HeldPrimitive> {
    let grown = decode(grips(primitive, rig)?, object, rig).ok()?;
    Some(HeldPrimitive {
        primitive,
        grips: Arc::unwrap_or_clone(grown.atlas).into_grips(),
    })
}
