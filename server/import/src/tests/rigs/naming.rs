//! Which nodes are which joints: by names, by number, by VRM.

use crate::{
    MappedJoint, rig_at_rest,
    tests::{
        LIMITS, assert_mentioned, messages,
        rigs::{Name, adult, adult_at_rest, differences, edited, model, named, read, source},
    },
};
use grasp_characters::{
    Character, Style,
    names::{
        auto_rig, biped, blender, bone, leap, mano, mixamo, numbered_from_palm, numbered_to_end, quest,
        steam, unity, unreal, vrm_0, vrm_1, vroid, webxr,
    },
};
use grasp_synthesis::model::hand::{
    Digit, Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};
use serde_json::{Value, json};

#[test]
fn characters_of_the_usual_engines_give_the_rig_of_their_hands() {
    let vrm = |extensions| Style {
        extensions,
        ..named(bone)
    };
    let centimetres = |name| Style {
        units_per_metre: 100.0,
        ..named(name)
    };
    let flat = Style {
        is_flat: true,
        ..Style::PLAIN
    };
    for (what, style) in [
        ("mixamo", centimetres(mixamo)),
        ("unreal", centimetres(unreal)),
        ("unity", named(unity)),
        ("mano", named(mano)),
        ("quest", named(quest)),
        ("vrm 0.x", vrm(vrm_0)),
        ("vrm 1.0", vrm(vrm_1)),
        ("flat", flat),
    ] {
        let rig = read(&Character::new(&style).glb).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
        for hand in [&rig.left, &rig.right] {
            differences(&hand.rig, adult(hand.rig.handedness)).assert_below([2e-3, 1e-3, 0.2], what);
            assert!(!hand.is_mirrored && hand.binding.is_some());
        }
    }
}

#[test]
fn numbers_count_the_bones_that_are_there() {
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
        assert_is_adult(what, &model(name));
    }
}

#[test]
fn four_bones_that_may_start_anywhere_are_refused_by_name() {
    // The wrist lies as far from the first bones as these are long: palms of the same length as fingers.
    let glb = edited(&model(mixamo), |document| {
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
    let texts = messages(read(&glb));
    assert_mentioned(
        &texts,
        &["right hand, index finger: has four bones, \"mixamorig:RightHandIndex1\""],
    );
}

#[test]
fn a_map_names_joints_that_names_do_not() {
    let glb = model(bone);
    assert!(read(&glb).is_err());
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
    let rig = crate::read_rig(&glb, source(&map), LIMITS).unwrap();
    differences(&rig.left.rig, adult(Handedness::Left)).assert_below([2e-3, 1.0, 1.0], "mapped");
}

#[test]
fn the_other_hand_is_mirrored_if_only_one_is_shown() {
    let style = Style {
        sides: &[Handedness::Left],
        ..named(mixamo)
    };
    let rig = read(&Character::new(&style).glb).unwrap();
    assert!(rig.right.is_mirrored && rig.right.binding.is_none());
    assert_eq!(rig.right.rig, rig.left.rig.mirrored());
}

const HANDS: [&[Digit]; 6] = [
    &[Digit::Index, Digit::Middle, Digit::Ring],
    &[Digit::Index, Digit::Middle, Digit::Little],
    &[Digit::Index, Digit::Ring, Digit::Little],
    &[Digit::Middle, Digit::Ring, Digit::Little],
    &[Digit::Index, Digit::Middle],
    &[Digit::Index, Digit::Little],
];

#[test]
fn hands_keep_the_fingers_that_they_have() {
    for fingers in HANDS {
        for (name, units_per_metre) in [(mixamo as Name, 100.0), (webxr, 1.0)] {
            let style = Style {
                units_per_metre,
                fingers,
                ..named(name)
            };
            let imported = read(&Character::new(&style).glb).unwrap();
            for hand in [&imported.left, &imported.right] {
                let (rig, adult) = (&hand.rig, adult(hand.rig.handedness));
                assert!(rig.fingers().eq(fingers.iter().copied()), "{fingers:?}");
                assert!(rig.has(Digit::Thumb));
                for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
                    let pairs = rig
                        .digit(digit)
                        .lengths
                        .into_iter()
                        .zip(adult.digit(digit).lengths);
                    for (own, whole) in pairs {
                        assert!(
                            (own - whole).abs() < 2e-3,
                            "{fingers:?} {digit:?}: {own} for {whole}"
                        );
                    }
                    let tip = index::TIP_OF_DIGIT[digit.index()];
                    let ratio = rig.joint_radii[tip - 1] / adult.joint_radii[tip - 1];
                    let thickness = 1.0 + 0.15 * (4 - fingers.len()) as f32;
                    assert!(
                        (ratio / thickness - 1.0).abs() < 0.15,
                        "{fingers:?} {digit:?}: {ratio}"
                    );
                }
                // The palm is as broad as that of four fingers.
                let at = |digit: Digit| rig.digit(digit).wrist_from_base.position;
                let whole = |digit: Digit| adult.digit(digit).wrist_from_base.position;
                let breadth = at(Digit::Index).distance(at(Digit::Little));
                let expected = whole(Digit::Index).distance(whole(Digit::Little));
                assert!((breadth - expected).abs() < 2e-3, "{fingers:?}: {breadth}");
                let posed = hand.binding.as_ref().unwrap().joints();
                for (node, joint) in posed {
                    // The root need not be a joint.
                    let digit = joint.and_then(|joint| {
                        (0..5).find(|&digit| {
                            (index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]).contains(&joint)
                        })
                    });
                    assert!(digit.is_none_or(|digit| rig.has(Digit::ALL[digit])), "{node}");
                }
            }
        }
    }
}

#[test]
fn joints_at_rest_without_radii_are_no_finger() {
    let mut rest = adult_at_rest(Handedness::Right);
    for joint in &mut rest.joints[index::FIRST_OF_DIGIT[3]..=index::TIP_OF_DIGIT[3]] {
        joint.radius = 0.0;
        joint.pose.position.x = f32::NAN;
    }
    let rig = rig_at_rest(&[rest], source(&[])).unwrap().right.rig;
    assert!(rig.fingers().eq([Digit::Index, Digit::Middle, Digit::Little]));
    let at = |digit: Digit| rig.digit(digit).wrist_from_base.position;
    let middle = at(Digit::Middle).midpoint(at(Digit::Little));
    assert!(at(Digit::Ring).distance(middle) < 1e-5);
    assert_eq!(rig.digit(Digit::Ring).lengths, [0.0; 3]);
}

#[test]
fn hands_that_cannot_oppose_are_refused_by_name() {
    fn index_only(side: Handedness, joint: usize) -> Option<String> {
        webxr(side, joint).filter(|_| joint < index::FIRST_OF_DIGIT[2])
    }
    fn thumbless(side: Handedness, joint: usize) -> Option<String> {
        let is_thumb = (index::FIRST_OF_DIGIT[0]..=index::TIP_OF_DIGIT[0]).contains(&joint);
        webxr(side, joint).filter(|_| !is_thumb)
    }
    for (name, expected) in [
        (thumbless as Name, "hand, thumb: is missing; without a thumb"),
        (index_only, "lacks the middle finger, ring finger, little finger"),
    ] {
        let texts = messages(read(&model(name)));
        assert_eq!(texts.len(), 2, "{texts:?}");
        assert!(
            texts.iter().all(|message| message.contains(expected)),
            "{texts:?}"
        );
    }
}

#[test]
fn unknown_bones_below_the_wrist_are_no_missing_finger() {
    fn odd(side: Handedness, joint: usize) -> Option<String> {
        let is_little = joint >= index::FIRST_OF_DIGIT[4];
        let name = mixamo(side, joint);
        if is_little {
            name.map(|_| format!("{side:?} spare {}", JOINT_NAMES[joint].len() + joint))
        } else {
            name
        }
    }
    let texts = messages(read(&model(odd)));
    assert_eq!(texts.len(), 2, "{texts:?}");
    for side in ["left", "right"] {
        assert_mentioned(
            &texts,
            &[side, "little finger: has no nodes with its names", "spare"],
        );
    }
}

/// Checks that a file gives the adult's rig, and returns its warnings.
fn assert_is_adult(what: &str, glb: &[u8]) -> Vec<String> {
    let rig = read(glb).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
    for hand in [&rig.left, &rig.right] {
        differences(&hand.rig, adult(hand.rig.handedness)).assert_below([2e-3, 1.0, 1.0], what);
    }
    rig.warnings
}

#[test]
fn bones_without_a_node_are_skipped() {
    fn old(names: &[String]) -> Value {
        let mut extensions = vrm_0(names);
        let bones = extensions["VRM"]["humanoid"]["humanBones"]
            .as_array_mut()
            .unwrap();
        bones.insert(0, json!({ "bone": "jaw", "node": -1 }));
        extensions
    }
    fn new(names: &[String]) -> Value {
        let mut extensions = vrm_1(names);
        extensions["VRMC_vrm"]["humanoid"]["humanBones"]["jaw"] = Value::Null;
        extensions
    }
    for (what, extensions) in [("0.x", old as fn(&[String]) -> Value), ("1.0", new)] {
        let style = Style {
            extensions,
            ..named(bone)
        };
        let warnings = assert_is_adult(what, &Character::new(&style).glb);
        assert!(
            warnings.iter().all(|warning| !warning.contains("VRM")),
            "{warnings:?}"
        );
    }
}

#[test]
fn thumbs_of_drafts_have_the_names_of_a_finger() {
    fn draft(names: &[String]) -> Value {
        let mut extensions = vrm_1(names);
        let bones = extensions["VRMC_vrm"]["humanoid"]["humanBones"]
            .as_object_mut()
            .unwrap();
        for side in ["left", "right"] {
            let [first, second] =
                ["Metacarpal", "Proximal"].map(|bone| bones.remove(&format!("{side}Thumb{bone}")).unwrap());
            bones.insert(format!("{side}ThumbProximal"), first);
            bones.insert(format!("{side}ThumbIntermediate"), second);
        }
        extensions
    }
    let style = Style {
        extensions: draft,
        ..named(bone)
    };
    assert_is_adult("draft", &Character::new(&style).glb);
}

#[test]
fn fingers_that_the_extension_does_not_name_are_found_by_their_nodes() {
    fn hands(names: &[String]) -> Value {
        let node = |name: &str| names.iter().position(|other| other == name).unwrap();
        json!({ "VRM": { "humanoid": { "humanBones": [
            { "bone": "leftHand", "node": node("J_Bip_L_Hand") }, { "bone": "rightHand", "node": node("J_Bip_R_Hand") },
        ] } } })
    }
    let style = Style {
        extensions: hands,
        ..named(vroid)
    };
    assert_is_adult("hands only", &Character::new(&style).glb);
}

#[test]
fn bones_that_the_extension_leaves_out_are_found_by_their_nodes() {
    fn without_distal(names: &[String]) -> Value {
        let node = |name: String| names.iter().position(|other| *other == name).unwrap();
        let mut bones = Vec::new();
        for (side, letter) in [("left", 'L'), ("right", 'R')] {
            bones
                .push(json!({ "bone": format!("{side}Hand"), "node": node(format!("J_Bip_{letter}_Hand")) }));
            for (number, part) in ["Proximal", "Intermediate"].iter().enumerate() {
                let name = format!("J_Bip_{letter}_Index{}", number + 1);
                bones.push(json!({ "bone": format!("{side}Index{part}"), "node": node(name) }));
            }
        }
        json!({ "VRM": { "humanoid": { "humanBones": bones } } })
    }
    let style = Style {
        extensions: without_distal,
        ..named(vroid)
    };
    assert_is_adult("without the last bone", &Character::new(&style).glb);
}

#[test]
fn bounds_of_positions_are_not_needed() {
    let glb = edited(&model(unity), |document| {
        let accessor = document["accessors"][0].as_object_mut().unwrap();
        accessor.remove("min");
        accessor.remove("max");
    });
    assert_is_adult("without bounds", &glb);
}

#[test]
fn an_extension_that_cannot_be_read_is_told() {
    let style = Style {
        extensions: |_| json!({ "VRM": { "humanoid": { "humanBones": 3 } } }),
        ..named(vroid)
    };
    let warnings = assert_is_adult("broken", &Character::new(&style).glb);
    assert_mentioned(&warnings, &["VRM extension cannot be read"]);
}
