//! Models that are no hands.

use crate::{MappedJoint, read_rig, rig_at_rest};
use glam::Vec3;
use grasp_synthesis::model::hand::{Handedness, joints::index};
use serde_json::json;

use grasp_characters::{Character, Style, glb, names::mixamo};

use crate::tests::rigs::{LIMITS, adult_at_rest, messages, read, source};

#[test]
fn missing_joints_are_all_named() {
    fn broken(side: Handedness, joint: usize) -> Option<String> {
        let is_of_little = joint > index::FIRST_OF_DIGIT[4] + 1;
        (!is_of_little && joint != 4)
            .then(|| mixamo(side, joint))
            .flatten()
    }
    let found = messages(read(
        &Character::new(&Style {
            name: broken,
            ..Style::PLAIN
        })
        .glb,
    ));
    for side in ["left hand", "right hand"] {
        for joint in [
            "thumb-phalanx-distal",
            "pinky-finger-phalanx-intermediate",
            "pinky-finger-phalanx-distal",
        ] {
            let start = format!("{side}, {joint}: is missing");
            assert!(
                found.iter().any(|message| message.starts_with(&start)),
                "{start}: {found:?}"
            );
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
    assert!(
        found
            .iter()
            .any(|message| message.contains("index-finger-phalanx-intermediate: is 0.0000 m")),
        "{found:?}"
    );
    assert!(
        found
            .iter()
            .any(|message| message.contains("middle-finger-phalanx-distal: is not at a finite")),
        "{found:?}"
    );
    assert!(
        found
            .iter()
            .any(|message| message.contains("ring-finger-tip: is 0.4500 m")),
        "{found:?}"
    );
    let among = with(&|joints| {
        let across = joints[17] - joints[2];
        for joint in &mut joints[2..6] {
            *joint += 1.1 * across;
        }
    });
    assert!(
        among.iter().any(|message| message.contains("among the fingers")),
        "{among:?}"
    );
    let line = with(&|joints| {
        for digit in 1..5 {
            joints[index::TIP_OF_DIGIT[digit] - 3] = 0.09 * Vec3::Y;
        }
    });
    assert!(
        line.iter().any(|message| message.contains("no breadth")),
        "{line:?}"
    );
}

#[test]
fn swapped_hands_are_found() {
    fn swapped(side: Handedness, joint: usize) -> Option<String> {
        mixamo(side.other(), joint)
    }
    let found = messages(read(
        &Character::new(&Style {
            name: swapped,
            ..Style::PLAIN
        })
        .glb,
    ));
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found.iter().all(|message| message.contains("swapped")),
        "{found:?}"
    );
}

#[test]
fn wrong_units_are_found() {
    let style = Style {
        name: mixamo,
        size: 100.0,
        ..Style::PLAIN
    };
    let found = messages(read(&Character::new(&style).glb));
    assert!(
        found
            .iter()
            .any(|message| message.contains("m long, after units")),
        "{found:?}"
    );
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
    let character = Character::new(&Style {
        name: mixamo,
        ..Style::PLAIN
    });
    let found = messages(read_rig(&character.glb, source(&map), LIMITS));
    for (place, what) in ["does not have", "is no joint", "set its handedness"]
        .iter()
        .enumerate()
    {
        let start = format!("joint_map[{place}]");
        assert!(
            found
                .iter()
                .any(|message| message.starts_with(&start) && message.contains(what)),
            "{found:?}"
        );
    }
}

#[test]
fn damaged_models_never_panic() {
    let glb = Character::new(&Style {
        name: mixamo,
        ..Style::PLAIN
    })
    .glb;
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
