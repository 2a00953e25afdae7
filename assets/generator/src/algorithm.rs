//! The number that names how atlases grow: a hash of a small reference growth.

use std::sync::Arc;

use grasp_assets::hands::hand;
use grasp_synthesis::{
    known::{
        codec::fingerprint,
        growth::{EARLY_PROPOSALS, ENTRIES, Growth, MAX_PROPOSALS, ROUND},
        key::ALGORITHM,
        primitives::Primitive,
    },
    model::{hand::Handedness, object::GraspObject},
    physical::grip::Gripper,
    propose::prepared::{PreparedObject, PreparedRig},
};
use rayon::prelude::*;
use sha2::{Digest as _, Sha256};

use crate::{AssetFile, success_prior::shapes};

/// The file, below the assets' folder.
const PATH: &str = "../server/synthesis/src/known/key/algorithm.rs";

/// The box of the reference growth: 160 × 20 × 6 mm, as thin and long as the built-in objects.
const BOX: Primitive = Primitive::ALL[2];

/// The curved shape of the reference growth: a cup.
const CUP: u64 = 2;

/// Triangles of the cup that may not be touched.
const FORBIDDEN: u32 = 16;

/// Makes the file: two seconds.
pub(crate) fn generate() -> Vec<AssetFile> {
    vec![(PATH.to_owned(), source(reference()).into_bytes())]
}

/// Do atlases still grow as [`ALGORITHM`] says?
pub(crate) fn is_current() -> bool {
    reference() == ALGORITHM
}

/// The hash of the early growth of a box and a cup, one per hand, and of what bounds growth later on.
fn reference() -> u64 {
    let references = [(bar(), Handedness::Right), (cup(), Handedness::Left)];
    let fingerprints: Vec<[u8; 32]> = references
        .par_iter()
        .map(|(object, side)| early_growth(object, &hand("adult", *side).expect("the rig is built in").rig))
        .collect();
    let mut hash = Sha256::new();
    for bound in [ENTRIES as u64, MAX_PROPOSALS, ROUND] {
        hash.update(bound.to_le_bytes());
    }
    for fingerprint in fingerprints {
        hash.update(fingerprint);
    }
    let digest = hash.finalize();
    let bytes = digest.iter().take(8);
    bytes.fold(0, |number, &byte| number << 8 | u64::from(byte))
}

fn early_growth(object: &PreparedObject, rig: &PreparedRig) -> [u8; 32] {
    let mut growth = Growth::new(object, rig);
    let mut gripper = Gripper::default();
    while growth.proposed() < EARLY_PROPOSALS {
        growth.round(&mut gripper);
    }
    fingerprint(&growth.grown(), object, rig)
}

fn bar() -> PreparedObject {
    PreparedObject::new(Arc::new(BOX.object()))
}

/// A cup with a forbidden patch.
fn cup() -> PreparedObject {
    let cup = shapes::draw(CUP);
    let forbidden: Vec<u32> = (0..FORBIDDEN).collect();
    let mesh = cup.surface.mesh().clone();
    let cup = GraspObject::new(mesh, cup.mass, cup.centre_of_mass, None, &forbidden);
    PreparedObject::new(Arc::new(cup.expect("the cup is sound")))
}

/// The number as Rust.
fn source(algorithm: u64) -> String {
    let groups: Vec<String> = (0..4)
        .rev()
        .map(|group| format!("{:04x}", algorithm >> (16 * group) & 0xffff))
        .collect();
    format!(
        "//! The fingerprint of growth: written by `grasp-assets-generator algorithm`, not by hand.\n\n\
         /// Hash of a small reference growth and of the bounds on growth. It changes exactly when the same object and hand get\n\
         /// other grips, contacts or scores, so that older atlases are not mistaken for current ones.\n\
         pub const ALGORITHM: u64 = 0x{};\n",
        groups.join("_")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn algorithm_matches_reference_growth() {
        // A build that fuses multiplications with additions finds other grips.
        assert!(
            crate::FUSES || is_current(),
            "atlases grow differently than before; run\n  \
             cargo run --release -p grasp-assets-generator -- algorithm\n  \
             cargo run --release -p grasp-assets-generator -- atlases\n  \
             cargo run --release -p grasp-assets-generator -- primitives"
        );
    }

    #[test]
    fn source_holds_the_number() {
        assert!(source(0x0123_4567_89ab_cdef).ends_with("= 0x0123_4567_89ab_cdef;\n"));
        assert!(source(1).ends_with("= 0x0000_0000_0000_0001;\n"));
    }
}
