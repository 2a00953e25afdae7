//! Models that are no hands.

use crate::{MappedJoint, read_rig, rig_at_rest};
use glam::Vec3;
use grasp_synthesis::model::hand::{Handedness, joints::index};
use serde_json::json;

use grasp_characters::{Character, Style, glb, names::mixamo};

use crate::tests::{
    LIMITS, assert_told, messages,
    rigs::{adult_at_rest, model, named, read, source},
};

#[test]
fn missing_joints_are_all_named() {
    fn broken(side: Handedness, joint: usize) -> Option<String> {
        let is_of_little = joint > index::FIRST_OF_DIGIT[4] + 1;
        (!is_of_little && joint != 4)
            .then(|| mixamo(side, joint))
            .flatten()
    }
    let found = messages(read(&model(broken)));
    for side in ["left hand", "right hand"] {
        for joint in [
            "thumb-phalanx-distal",
            "pinky-finger-phalanx-intermediate",
            "pinky-finger-phalanx-distal",
        ] {
            assert_told(&found, &[&format!("{side}, {joint}: is missing")]);
        }
    }
    assert_eq!(found.len(), 6, "{found:?}");
}

#[test]
fn impossible_joints_at_rest_are_all_named() {
    let rest = adult_at_rest(Handedness::Right);
    let with = |change: &dyn Fn(&mut [Vec3; 26])| {
        let mut rest = rest.clone();
        let mut positions = rest.joints.map(|joint| joint.pose.position);
        change(&mut positions);
        for (joint, position) in rest.joints.iter_mut().zip(positions) {
            joint.pose.position = position;
        }
        messages(rig_at_rest(&[rest], source(&[])))
    };
    let found = with(&|joints| {
        joints[8] = joints[7];
        joints[14].x = f32::NAN;
        joints[20] = joints[19] + 0.45 * Vec3::Y;
    });
    for expected in [
        "index-finger-phalanx-intermediate: is 0.0000 m",
        "middle-finger-phalanx-distal: is not at a finite",
        "ring-finger-tip: is 0.4500 m",
    ] {
        assert_told(&found, &[expected]);
    }
    let among = with(&|joints| {
        let across = joints[17] - joints[2];
        for joint in &mut joints[2..6] {
            *joint += 1.1 * across;
        }
    });
    assert_told(&among, &["among the fingers"]);
    let line = with(&|joints| {
        for digit in 1..5 {
            joints[index::TIP_OF_DIGIT[digit] - 3] = 0.09 * Vec3::Y;
        }
    });
    assert_told(&line, &["no breadth"]);
}

#[test]
fn swapped_hands_are_found() {
    fn swapped(side: Handedness, joint: usize) -> Option<String> {
        mixamo(side.other(), joint)
    }
    let found = messages(read(&model(swapped)));
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found.iter().all(|message| message.contains("swapped")),
        "{found:?}"
    );
}

#[test]
fn wrong_units_are_found() {
    let style = Style {
        size: 100.0,
        ..named(mixamo)
    };
    let found = messages(read(&Character::new(&style).glb));
    assert_told(&found, &["m long, after units"]);
}

#[test]
fn models_without_a_hand_say_what_is_known() {
    let body = json!({ "asset": { "version": "2.0" }, "nodes": [{ "name": "Hips" }] });
    let found = messages(read(&glb(&body, Vec::new())));
    assert!(found.len() == 1 && found[0].contains("joint_map"), "{found:?}");
    let found = messages(read(b"solid"));
    assert!(found[0].contains("is no glTF"), "{found:?}");
}

#[test]
fn wrong_maps_are_refused_entry_by_entry() {
    let map = |node: &str, joint: &str, side| MappedJoint {
        node: node.to_owned(),
        side,
        joint: joint.to_owned(),
    };
    let map = [
        map("nowhere", "wrist", Some(Handedness::Left)),
        map("Hips", "elbow", Some(Handedness::Left)),
        map("Hips", "wrist", None),
    ];
    let found = messages(read_rig(&model(mixamo), source(&map), LIMITS));
    for (place, what) in ["does not have", "is no joint", "set its handedness"]
        .iter()
        .enumerate()
    {
        assert_told(&found, &[&format!("joint_map[{place}]"), what]);
    }
}

#[test]
fn damaged_models_never_panic() {
    let glb = model(mixamo);
    // Bytes of the text and of the buffer's matrices, at the end.
    for place in (0..4000)
        .step_by(137)
        .chain((glb.len() - 4000..glb.len()).step_by(211))
    {
        let mut damaged = glb.clone();
        damaged[place] ^= 0x5a;
        let _ = read(&damaged);
    }
}
