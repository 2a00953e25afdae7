//! Names of the usual engines.

use crate::MappedJoint;
use grasp_characters::{
    Character, Style,
    names::{
        auto_rig, biped, blender, bone, leap, mano, mixamo, numbered_from_palm, numbered_to_end, quest,
        steam, unity, unreal, vrm_0, vrm_1, vroid,
    },
};
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES},
};
use serde_json::json;

use crate::tests::rigs::{LIMITS, adult, differences, edited, messages, read, source};

#[test]
fn characters_of_the_usual_engines_give_the_rig_of_their_hands() {
    let centimetres = Style {
        units_per_metre: 100.0,
        ..Style::PLAIN
    };
    for (what, style) in [
        (
            "mixamo",
            Style {
                name: mixamo,
                units_per_metre: 100.0,
                ..Style::PLAIN
            },
        ),
        (
            "unreal",
            Style {
                name: unreal,
                ..centimetres
            },
        ),
        (
            "unity",
            Style {
                name: unity,
                ..Style::PLAIN
            },
        ),
        (
            "mano",
            Style {
                name: mano,
                ..Style::PLAIN
            },
        ),
        (
            "quest",
            Style {
                name: quest,
                ..Style::PLAIN
            },
        ),
        (
            "vrm 0.x",
            Style {
                name: bone,
                extensions: vrm_0,
                ..Style::PLAIN
            },
        ),
        (
            "vrm 1.0",
            Style {
                name: bone,
                extensions: vrm_1,
                ..Style::PLAIN
            },
        ),
        (
            "flat",
            Style {
                is_flat: true,
                ..Style::PLAIN
            },
        ),
    ] {
        let rig = read(&Character::new(&style).glb).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
        for hand in [&rig.left, &rig.right] {
            let [places, directions, radii] = differences(&hand.rig, adult(hand.rig.handedness));
            assert!(places.0 < 2e-3, "{what}: {places:?}");
            assert!(directions.0 < 1e-3, "{what}: {directions:?}");
            assert!(radii.0 < 0.2, "{what}: {radii:?}");
            assert!(!hand.is_mirrored && hand.binding.is_some());
        }
    }
}

#[test]
fn numbers_count_the_bones_that_are_there() {
    type Name = fn(Handedness, usize) -> Option<String>;
    let programs: [(&str, Name); 8] = [
        ("four bones from the palm", numbered_from_palm),
        ("five bones from the palm", numbered_to_end),
        ("Auto-Rig Pro", auto_rig),
        ("Blender", blender),
        ("SteamVR", steam),
        ("Ultraleap", leap),
        ("Biped", biped),
        ("VRoid", vroid),
    ];
    for (what, name) in programs {
        let style = Style { name, ..Style::PLAIN };
        let rig = read(&Character::new(&style).glb).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
        for hand in [&rig.left, &rig.right] {
            let [places, ..] = differences(&hand.rig, adult(hand.rig.handedness));
            assert!(places.0 < 2e-3, "{what}: {places:?}");
        }
    }
}

#[test]
fn four_bones_that_may_start_anywhere_are_refused_by_name() {
    // The wrist lies as far from the first bones as these are long: palms of the same length as fingers.
    let glb = Character::new(&Style {
        name: mixamo,
        ..Style::PLAIN
    })
    .glb;
    let glb = edited(&glb, |document| {
        let nodes = document["nodes"].as_array_mut().unwrap();
        for place in 0..nodes.len() {
            // With the leaves that Blender adds to all last bones.
            let name = nodes[place]["name"].as_str().unwrap_or_default();
            if name.ends_with('4') {
                let leaf = json!({ "name": format!("{name}_end") });
                nodes[place]["children"] = json!([nodes.len()]);
                nodes.push(leaf);
            }
        }
        for node in nodes {
            let name = node["name"].as_str().unwrap_or_default().to_owned();
            let is_first = name.ends_with('1') && !name.contains("Thumb");
            if is_first {
                for length in node["translation"].as_array_mut().unwrap() {
                    *length = (0.45 * length.as_f64().unwrap()).into();
                }
            }
        }
    });
    let found = messages(read(&glb));
    assert!(
        found.iter().any(|message| message
            .contains("right hand, index finger: has four bones, \"mixamorig:RightHandIndex1\"")),
        "{found:?}"
    );
}

#[test]
fn a_map_names_joints_that_names_do_not() {
    let style = Style {
        name: bone,
        ..Style::PLAIN
    };
    let character = Character::new(&style);
    assert!(read(&character.glb).is_err());
    let map: Vec<MappedJoint> = [Handedness::Left, Handedness::Right]
        .into_iter()
        .flat_map(|side| (0..JOINT_COUNT).map(move |joint| (side, joint)))
        .filter_map(|(side, joint)| {
            Some(MappedJoint {
                node: bone(side, joint)?,
                side: Some(side),
                joint: JOINT_NAMES[joint].to_owned(),
            })
        })
        .collect();
    let rig = crate::read_rig(&character.glb, source(&map), LIMITS).unwrap();
    let [places, ..] = differences(&rig.left.rig, adult(Handedness::Left));
    assert!(places.0 < 2e-3, "{places:?}");
}

#[test]
fn the_other_hand_is_mirrored_if_only_one_is_shown() {
    let style = Style {
        name: mixamo,
        sides: &[Handedness::Left],
        ..Style::PLAIN
    };
    let rig = read(&Character::new(&style).glb).unwrap();
    assert!(rig.right.is_mirrored && rig.right.binding.is_none());
    assert_eq!(rig.right.rig, rig.left.rig.mirrored());
}
