//! Grips of the built-in hands at primitives, embedded for objects that have no atlas yet.

use std::sync::{Arc, LazyLock};

use grasp_synthesis::{
    known::{
        codec::decode,
        primitives::{HeldPrimitive, Primitive},
    },
    model::{
        hand::{Handedness, rig::Rig},
        object::GraspObject,
    },
};

use crate::{
    atlases::file_name,
    hands::{Hand, hand},
};

/// The rig whose hands have grips at primitives.
const RIG: &str = "adult";

/// The files by name.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/primitives.rs"));

/// A hand with its grips at primitives.
type Known = (Arc<Hand>, Arc<[HeldPrimitive]>);

/// The hands that have grips at primitives, and the grips. Reading them on first use takes some tens of milliseconds.
pub fn held_primitives() -> &'static [Known] {
    static HELD: LazyLock<Vec<Known>> = LazyLock::new(|| {
        let hands = [Handedness::Left, Handedness::Right].map(|side| hand(RIG, side));
        let mut held: Vec<(&Arc<Hand>, Vec<HeldPrimitive>)> = hands
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
        held.into_iter()
            .map(|(hand, held)| (Arc::clone(hand), held.into()))
            .collect()
    });
    &HELD
}

/// The embedded grips of a primitive and a hand; `None` if there is none.
pub fn grips(primitive: Primitive, rig: &Rig) -> Option<&'static [u8]> {
    let name = file_name(&primitive.name(), rig);
    FILES
        .iter()
        .find(|(file, _)| *file == name)
        .map(|(_, bytes)| *bytes)
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
