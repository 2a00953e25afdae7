//! Atlases as bytes: they round-trip, and stale or damaged ones are rejected.

use grasp_synthesis::known::codec::{AtlasError, encode};
use proptest::prelude::*;
use sha2::{Digest as _, Sha256};

use crate::prelude::*;

/// Length of the checksum at the end, in bytes.
const CHECKSUM: usize = 32;

/// A young atlas of the scissors for the right hand, and its bytes.
static SCISSORS: LazyLock<(Grown, Vec<u8>)> = LazyLock::new(|| {
    let (object, rig) = (object("scissors"), right());
    let grown = grown(growth(object, rig), 24);
    let bytes = encode(&grown, object, rig);
    (grown, bytes)
});

fn decode_scissors(bytes: &[u8]) -> Result<Grown, AtlasError> {
    decode(bytes, object("scissors"), right())
}

#[test]
fn atlases_round_trip_through_bytes() {
    for name in OBJECT_NAMES {
        for handedness in [Handedness::Left, Handedness::Right] {
            let (object, rig) = (object(name), adult(handedness));
            let written = grown(growth(object, rig), 12);
            let entries = written.atlas.entries().len();
            assert!(entries > 5, "{name}: {entries}");
            let bytes = encode(&written, object, rig);
            let read = decode(&bytes, object, rig).expect("it is whole");
            assert_eq!(read, written);
            assert_eq!(encode(&read, object, rig), bytes);
            // The first grips take more bytes than later ones.
            assert!(
                bytes.len() <= 300 * entries + 128,
                "{name}: {entries} in {}",
                bytes.len()
            );
        }
    }
}

#[test]
fn an_interrupted_growth_resumes_to_the_same_atlas() {
    let (object, rig) = (object("remote"), right());
    let whole = grown(growth(object, rig), 52);
    let half = encode(&grown(growth(object, rig), 37), object, rig);
    let half = decode(&half, object, rig).expect("it is whole");
    // By then, every other round has a giver, and better grips replace others.
    let (before, after) = (half.atlas.entries(), whole.atlas.entries());
    assert!(before.len() > 256, "{}", before.len());
    assert_ne!(before, &after[..before.len()]);
    assert!(half.atlas.entries().len() < whole.atlas.entries().len());
    assert_ne!(half.atlas.stamp(), whole.atlas.stamp());
    assert!(grown(Growth::resume(prepared(object), rig, &half), 15) == whole);
}

#[test]
fn an_atlas_of_another_object_or_hand_is_stale() {
    let object = object("scissors");
    let mesh = object.surface.mesh();
    let friction = object.friction_under(Validity::Physical);
    let forbidden = triangles_where(mesh, |triangle| object.is_forbidden(triangle as u32));
    let more: Vec<u32> = forbidden.iter().copied().chain([0]).collect();
    assert!(!object.is_forbidden(0));
    let with = |mass: f32, centre, friction: f32, forbidden: &[u32]| {
        GraspObject::new(mesh.clone(), mass, centre, Some(friction), forbidden).expect("it is right")
    };
    let (mass, centre) = (object.mass, object.centre_of_mass);
    let bytes = &SCISSORS.1;
    let read = |object: &GraspObject| decode(bytes, object, right()).map(|_| ());
    assert_eq!(read(&with(mass, centre, friction, &forbidden)), Ok(()));
    for other in [
        with(mass * 1.01, centre, friction, &forbidden),
        with(mass, centre + 0.001, friction, &forbidden),
        with(mass, centre, friction * 1.01, &forbidden),
        with(mass, centre, friction, &more),
    ] {
        assert_eq!(read(&other), Err(AtlasError::Stale));
    }
    assert_eq!(
        decode(bytes, object, adult(Handedness::Left)).map(|_| ()),
        Err(AtlasError::Stale)
    );
}

#[test]
fn rejects_bytes_that_are_no_atlas_or_of_another_format() {
    assert_eq!(decode_scissors(b"").unwrap_err(), AtlasError::NotAnAtlas);
    assert_eq!(
        decode_scissors(b"v 0 0 0\nv 1 0 0\n").unwrap_err(),
        AtlasError::NotAnAtlas
    );
    let mut bytes = SCISSORS.1.clone();
    bytes[9] = 99;
    assert_eq!(
        decode_scissors(&bytes).unwrap_err(),
        AtlasError::OtherFormat { found: 99 }
    );
}

/// The bytes with a valid checksum.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.truncate(bytes.len() - CHECKSUM);
    let checksum = Sha256::digest(&bytes);
    bytes.extend_from_slice(&checksum);
    bytes
}

#[test]
fn rejects_a_count_beyond_the_bytes() {
    let count = 8 + 2 + 32 + 1;
    for claimed in [u32::MAX, 4096, SCISSORS.0.atlas.entries().len() as u32 + 1] {
        let mut bytes = SCISSORS.1.clone();
        bytes[count..count + 4].copy_from_slice(&claimed.to_be_bytes());
        assert!(matches!(
            decode_scissors(&sealed(bytes)),
            Err(AtlasError::Malformed(_))
        ));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(400), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rejects_any_flipped_bit(place in any::<prop::sample::Index>(), bit in 0..8) {
        let mut bytes = SCISSORS.1.clone();
        let place = place.index(bytes.len());
        bytes[place] ^= 1_u8 << bit;
        prop_assert!(decode_scissors(&bytes).is_err());
    }

    #[test]
    fn rejects_any_truncation(end in any::<prop::sample::Index>()) {
        let bytes = &SCISSORS.1;
        prop_assert!(decode_scissors(&bytes[..end.index(bytes.len())]).is_err());
    }

    // It gives an error or an atlas with usable indices and numbers, but no panic.
    #[test]
    fn nonsense_with_a_valid_checksum_is_rejected_or_harmless(
        place in any::<prop::sample::Index>(),
        nonsense in prop::collection::vec(any::<u8>(), 1..40),
    ) {
        let mut bytes = SCISSORS.1.clone();
        let first = 8 + 2 + 32;
        let place = first + place.index(bytes.len() - CHECKSUM - first);
        let end = (place + nonsense.len()).min(bytes.len() - CHECKSUM);
        bytes[place..end].copy_from_slice(&nonsense[..end - place]);
        if let Ok(read) = decode_scissors(&sealed(bytes)) {
            let triangles = object("scissors").surface.mesh().triangles().len();
            for entry in read.atlas.entries() {
                prop_assert!(entry.grip.pose.frame_from_wrist.is_finite());
                for contact in &entry.contacts {
                    prop_assert!((contact.triangle as usize) < triangles && contact.position.is_finite());
                }
            }
        }
    }
}

#[test]
fn the_listed_part_of_an_atlas_is_an_atlas_of_its_own() {
    let (object, rig) = (object("scissors"), right());
    let (grown, _) = &*SCISSORS;
    let listed = grown.listed(object, rig);
    let (few, all) = (listed.atlas.entries(), grown.atlas.entries());
    let mut left = all.iter();
    assert!(!few.is_empty() && few.len() < all.len());
    assert!(few.iter().all(|grip| left.any(|other| other == grip)), "in order");
    // They cannot pass for a complete atlas, nor for an interrupted growth.
    assert!(!listed.atlas.is_complete());
    assert_eq!(
        (listed.proposed(), listed.early_stamp()),
        (0, grown.early_stamp())
    );
    // It round-trips like any other.
    let bytes = encode(&listed, object, rig);
    assert_eq!(decode_scissors(&bytes).expect("it is whole"), listed);
}
