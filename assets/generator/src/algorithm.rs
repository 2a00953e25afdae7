//! The number that names how atlases grow: a hash of a small reference growth.

use std::{f32::consts::TAU, sync::Arc};

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_synthesis::{
    base::random::AttemptStream,
    geometry::mesh::TriangleMesh,
    known::{
        codec::{ALGORITHM, fingerprint},
        growth::{EARLY_PROPOSALS, ENTRIES, Growth, MAX_PROPOSALS, ROUND},
        primitives::Primitive,
    },
    model::{hand::Handedness, object::GraspObject},
    physical::grip::Gripper,
    propose::prepared::{PreparedObject, PreparedRig},
};
use rayon::prelude::*;
use sha2::{Digest as _, Sha256};

use crate::AssetFile;

/// The file, below the assets' folder.
const PATH: &str = "../server/synthesis/src/known/codec/algorithm.rs";

/// The box of the reference growth: 160 × 20 × 6 mm, as thin and long as the built-in objects.
const BOX: Primitive = Primitive::ALL[2];

/// Seed and number of the random stream of the reference growth's curved shape, a cup.
const CUP: [u64; 2] = [0x5348_4150, 2];

/// Triangles of the cup that may not be touched.
const FORBIDDEN: u32 = 16;

/// Corners of the cup's rings, and rings of its wall.
const CORNERS: usize = 20;
const RINGS: usize = 12;

/// Makes the file: two seconds.
pub(crate) fn generate() -> AssetFile {
    (PATH.to_owned(), source(reference()).into_bytes())
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
    let mut stream = AttemptStream::new(CUP[0], CUP[1]);
    let mesh = cup_mesh(&mut stream);
    let mass = stream.between(0.03, 0.35);
    let centre = mesh.volume_centroid().expect("the cup is closed");
    let forbidden: Vec<u32> = (0..FORBIDDEN).collect();
    let cup = GraspObject::new(mesh, mass, centre, None, &forbidden);
    PreparedObject::new(Arc::new(cup.expect("the cup is sound")))
}

/// A cup that widens or narrows, perhaps with a foot and a stem: drawn once, and the same since.
fn cup_mesh(stream: &mut AttemptStream) -> TriangleMesh {
    let mut length = |least: f32, most: f32| least * (most / least).powf(stream.unit());
    let (height, radius) = (length(0.05, 0.15), length(0.02, 0.05));
    let taper = stream.between(0.6, 1.2);
    let wall = stream.between(0.0015, 0.004);
    // Radii and heights.
    let mut rings: Vec<(f32, f32)> = Vec::new();
    let is_stemmed = stream.unit() < 0.4;
    if is_stemmed {
        let stem = stream.between(0.04, 0.1);
        rings.extend([
            (0.9 * radius, -stem),
            (0.9 * radius, 0.003 - stem),
            (0.005, 0.006 - stem),
            (0.004, -0.01),
        ]);
    }
    let wide = |share: f32| radius * (taper + (1.0 - taper) * share);
    // The bowl of a glass starts narrow.
    let bottom = if is_stemmed { 0.6 } else { 1.0 };
    let shares = || (1..=RINGS).map(|ring| ring as f32 / RINGS as f32);
    rings.push((bottom * wide(0.0), 0.0));
    rings.extend(shares().map(|share| (wide(share), share * height)));
    let inside = shares().map(|share| 1.0 - share).take(RINGS - 1);
    rings.extend(inside.map(|share| (wide(share) - wall, share * height)));
    rings.push((bottom * wide(0.0) - wall, wall));
    round(&rings)
}

/// The body of revolution about z with rings of these radii and heights, closed by discs.
fn round(rings: &[(f32, f32)]) -> TriangleMesh {
    let mut positions: Vec<Vec3> = Vec::new();
    for &(radius, height) in rings {
        positions.extend((0..CORNERS).map(|corner| {
            let (sin, cos) = (corner as f32 / CORNERS as f32 * TAU).sin_cos();
            Vec3::new(radius * cos, radius * sin, height)
        }));
    }
    let corner = |ring: usize, corner: usize| (ring * CORNERS + corner % CORNERS) as u32;
    let last = rings.len() - 1;
    let ends = [0, last].map(|ring| {
        positions.push(Vec3::Z * rings[ring].1);
        positions.len() as u32 - 1
    });
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for i in 0..CORNERS {
        for ring in 0..last {
            let (a, b) = (corner(ring, i), corner(ring, i + 1));
            let (c, d) = (corner(ring + 1, i), corner(ring + 1, i + 1));
            triangles.extend([[a, b, d], [a, d, c]]);
        }
        triangles.push([ends[0], corner(0, i + 1), corner(0, i)]);
        triangles.push([ends[1], corner(last, i), corner(last, i + 1)]);
    }
    TriangleMesh::without_degenerates(positions, &triangles).expect("a round body is a mesh")
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
