//! Rigs of hands, from models and from joints at rest.

mod naming;
mod odd_models;
mod skins;

use crate::{ImportError, ImportedRig, MappedJoint, RigSource, read_rig, tests::LIMITS};
use grasp_assets::hands::hand;
use grasp_characters::{Character, Style};
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{HandJoints, JOINT_COUNT, index},
    rig::Rig,
};
use serde_json::Value;

fn adult(side: Handedness) -> &'static Rig {
    &hand("adult", side).expect("the rig is built in").rig
}

/// The adult's joints at rest, as a client would describe them.
fn adult_at_rest(side: Handedness) -> HandJoints {
    let hand = hand("adult", side).expect("the rig is built in");
    hand.skin.bind.clone()
}

fn source(joint_map: &[MappedJoint]) -> RigSource<'_> {
    RigSource {
        name: "own",
        reference: adult(Handedness::Right),
        side: None,
        joint_map,
        limits: adult(Handedness::Right)
            .digits
            .each_ref()
            .map(|digit| digit.limits),
        width_scale: 1.0,
        radii: [None; JOINT_COUNT],
        is_of_pair: false,
    }
}

/// The document of a GLB, and its buffer.
fn opened(glb: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    (document, glb[28 + length..].to_vec())
}

/// A GLB with a changed document.
fn edited(glb: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut document, buffer) = opened(glb);
    change(&mut document);
    grasp_characters::glb(&document, buffer)
}

fn read(glb: &[u8]) -> Result<ImportedRig, Vec<ImportError>> {
    read_rig(glb, source(&[]), LIMITS)
}

/// A character with the nodes' names of a program.
fn named(name: Name) -> Style {
    Style { name, ..Style::PLAIN }
}

/// The name of a joint's node.
type Name = fn(Handedness, usize) -> Option<String>;

fn model(name: Name) -> Vec<u8> {
    Character::new(&named(name)).glb
}

fn read_style(style: &Style) -> Result<ImportedRig, Vec<ImportError>> {
    read(&Character::new(style).glb)
}

/// The joints of a digit, from its metacarpal to its tip.
fn joints_of(digit: usize) -> std::ops::RangeInclusive<usize> {
    index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]
}

/// Asserts that rigs differ by less than limits: bones' ends and lengths in metres, directions in radians, and radii as a share.
#[track_caller]
fn assert_alike(rig: &Rig, expected: &Rig, limits: [f32; 3], what: &str) {
    let mut most = [0.0_f32; 3];
    let mut note = |kind: usize, difference: f32| most[kind] = most[kind].max(difference.abs());
    note(0, rig.palm.distance(expected.palm));
    note(0, rig.reach - expected.reach);
    for (own, other) in rig.digits.iter().zip(&expected.digits) {
        let (base, other_base) = (own.wrist_from_base, other.wrist_from_base);
        note(0, base.position.distance(other_base.position));
        note(1, base.orientation.angle_between(other_base.orientation));
        assert_eq!(own.yaw_sign, other.yaw_sign);
        for link in 0..3 {
            note(0, own.lengths[link] - other.lengths[link]);
            note(2, own.diameters[link] / other.diameters[link] - 1.0);
        }
    }
    for (own, other) in rig.finger_metacarpals.iter().zip(expected.finger_metacarpals) {
        note(0, own.distance(other));
    }
    for (own, other) in rig.joint_radii.iter().zip(expected.joint_radii) {
        note(2, own / other - 1.0);
    }
    let are_below = most.iter().zip(limits).all(|(most, limit)| *most < limit);
    assert!(are_below, "{what}: {most:?}, {limits:?} are allowed");
}

/// Asserts that both hands are the adult's, up to limits.
#[track_caller]
fn assert_is_adult(rig: &ImportedRig, limits: [f32; 3], what: &str) {
    for hand in [&rig.left, &rig.right] {
        assert_alike(&hand.rig, adult(hand.rig.handedness), limits, what);
    }
}
