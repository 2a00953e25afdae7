//! The built-in hands: their files, rigs and skins.

mod files;
mod rigs;
mod skin_fit;
mod skin_mesh;
mod thumb_reach;

use grasp_assets::hands::{Hand, RIG_NAMES, glb, hand};
use grasp_synthesis::model::hand::Handedness;

/// All built-in hands.
fn all() -> impl Iterator<Item = &'static Hand> {
    RIG_NAMES
        .into_iter()
        .flat_map(|rig| [Handedness::Left, Handedness::Right].map(|side| built_in(rig, side)))
}

/// A built-in hand.
fn built_in(rig: &str, handedness: Handedness) -> &'static Hand {
    hand(rig, handedness).expect("the rig is built in")
}

/// A built-in hand's GLB file.
fn file_of(hand: &Hand) -> &'static [u8] {
    glb(&hand.rig.name, hand.rig.handedness).expect("the rig is built in")
}
