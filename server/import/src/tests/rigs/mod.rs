//! Rigs of hands, from models and from joints at rest.

mod naming;
mod odd_models;
mod skins;

use std::collections::HashSet;

use crate::{
    ImportError, ImportedRig, MappedJoint, ModelPose, RigSource, posed_skin, read_rig, rig_at_rest,
    tests::LIMITS,
};
use glam::{Quat, Vec3};
use grasp_assets::hands::{glb, hand};
use grasp_characters::{Character, Style, names::mixamo};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, index},
        kinematics::hand_frames,
        rig::Rig,
    },
};
use serde_json::{Value, json};

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

#[test]
fn a_skin_that_nothing_shows_binds_nothing() {
    let glb = model(mixamo);
    let whole = read(&glb).unwrap();
    let odd = edited(&glb, |document| {
        let mut skin = document["skins"][0].clone();
        // All bones at the mesh's origin.
        skin.as_object_mut().unwrap().remove("inverseBindMatrices");
        document["skins"].as_array_mut().unwrap().insert(0, skin);
        document["nodes"].as_array_mut().unwrap().last_mut().unwrap()["skin"] = json!(1);
    });
    assert_eq!(read(&odd).unwrap().right.rig, whole.right.rig);
}

#[test]
fn built_in_hands_and_joints_at_rest_give_back_their_rigs() {
    for side in [Handedness::Left, Handedness::Right] {
        let file = glb("adult", side).expect("the rig is built in");
        let sided = RigSource {
            side: Some(side),
            ..source(&[])
        };
        let of_file = read_rig(file, sided, LIMITS).unwrap();
        assert_is_adult(&of_file, [5e-4, 1e-3, 0.2], "adult");
        let at_rest = rig_at_rest(&[adult_at_rest(side)], source(&[])).unwrap();
        assert_is_adult(&at_rest, [1e-5, 1e-3, 0.02], "at rest");
        for rig in [&of_file, &at_rest] {
            let is_mirrored = [rig.left.is_mirrored, rig.right.is_mirrored];
            assert_eq!(is_mirrored, [side == Handedness::Right, side == Handedness::Left]);
        }
    }
}

#[test]
fn size_follows_the_hand() {
    for size in [0.5, 1.0, 1.6] {
        let read = read_style(&Style { size, ..Style::PLAIN }).unwrap();
        for hand in [&read.left, &read.right] {
            let adult = adult(hand.rig.handedness);
            assert!((hand.rig.reach / adult.reach / size - 1.0).abs() < 2e-3);
            for (own, other) in hand.rig.joint_radii.iter().zip(adult.joint_radii) {
                assert!(
                    (own / other / size - 1.0).abs() < 0.2,
                    "{own} for {}",
                    other * size
                );
            }
        }
    }
}

fn gripping() -> HandPose {
    let mut digits = [DigitAngles::coupled(0.1, 0.7, 0.8); 5];
    digits[0] = DigitAngles {
        base_yaw: 0.6,
        base_pitch: -0.1,
        second_pitch: 0.4,
        third_pitch: 0.5,
    };
    HandPose {
        frame_from_wrist: Pose::new(
            Vec3::new(0.3, 0.9, 0.2),
            Quat::from_rotation_x(0.8) * Quat::from_rotation_y(2.0),
        ),
        digits,
    }
}

#[test]
fn posed_nodes_draw_the_skin_where_the_rig_has_it() {
    let flat = Style {
        is_flat: true,
        ..Style::PLAIN
    };
    let centimetres = |style| Style {
        units_per_metre: 100.0,
        ..style
    };
    for (style, keeps_translations) in [
        (Style::PLAIN, true),
        (flat, false),
        (centimetres(Style::PLAIN), true),
        (centimetres(named(mixamo)), true),
    ] {
        let glb = Character::new(&style).glb;
        let imported = read(&glb).unwrap();
        for hand in [&imported.left, &imported.right] {
            let binding = hand.binding.as_ref().unwrap();
            let pose = gripping();
            let frames = hand_frames(&hand.rig, &pose);
            let model = ModelPose {
                root: binding.root(),
                frame_from_root: binding.frame_from_root(&frames, 1.0),
                scale: 1.0,
                nodes: binding.posed(&frames, 1.0).collect(),
            };
            assert!(model.nodes.len() >= 19, "{}", model.nodes.len());
            let moved = model.nodes.iter().filter(|node| node.translation.is_some());
            assert_eq!(moved.count() == 0, keeps_translations, "{:?}", model.nodes);
            let drawn = posed_skin(&glb, &model, LIMITS).unwrap();
            let skin = &self::hand("adult", hand.rig.handedness).unwrap().skin;
            let expected = skin.posed(&HandJoints::of_pose(&hand.rig, &pose));
            // Vertices are drawn in the order of their first use.
            let mut used = HashSet::new();
            let order = skin
                .triangles
                .iter()
                .flatten()
                .filter(|&&vertex| used.insert(vertex));
            let order: Vec<usize> = order.map(|&vertex| vertex as usize).collect();
            assert_eq!(drawn.positions.len(), order.len());
            let distances = drawn.positions.iter().zip(order);
            let mut distances: Vec<f32> = distances
                .map(|(drawn, vertex)| drawn.distance(expected[vertex]))
                .collect();
            distances.sort_by(f32::total_cmp);
            let (median, most) = (distances[distances.len() / 2], distances[distances.len() - 1]);
            assert!(
                median < 3e-4 && most < 2.5e-3,
                "{:?}: {median} {most}",
                hand.rig.handedness
            );
        }
    }
}
