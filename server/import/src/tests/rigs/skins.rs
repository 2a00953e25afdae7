//! What is measured of a rig's skin, and how posed nodes move it.

use std::collections::HashSet;

use crate::{
    ImportedHand, ModelPose, RigSource, posed_skin, read_rig, rig_at_rest,
    tests::{
        LIMITS,
        rigs::{adult, adult_at_rest, assert_is_adult, edited, model, named, read, read_style, source},
    },
};
use glam::{Quat, Vec3};
use grasp_assets::hands::glb;
use grasp_characters::{Character, Style, names::mixamo};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{DigitAngles, HandPose, Handedness, joints::HandJoints, kinematics::hand_frames},
};
use serde_json::json;

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

fn gripping(hand: &ImportedHand) -> HandPose {
    let mut digits = [DigitAngles::coupled(0.1, 0.7, 0.8); 5];
    digits[0] = DigitAngles {
        base_yaw: 0.6,
        base_pitch: -0.1,
        second_pitch: 0.4,
        third_pitch: 0.5,
    };
    let side = if hand.rig.handedness == Handedness::Left {
        1.0
    } else {
        -1.0
    };
    HandPose {
        frame_from_wrist: Pose::new(
            Vec3::new(0.3 * side, 0.9, 0.2),
            Quat::from_rotation_x(0.8) * Quat::from_rotation_y(2.0 * side),
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
            let pose = gripping(hand);
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
            let skin = &grasp_assets::hands::hand("adult", hand.rig.handedness)
                .unwrap()
                .skin;
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
