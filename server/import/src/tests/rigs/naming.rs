//! Which nodes are which joints: by names, by number, by VRM.

use crate::{
    MappedJoint, read_rig, rig_at_rest,
    tests::{
        LIMITS, assert_mentioned, messages,
        rigs::{
            Name, adult, adult_at_rest, assert_is_adult, edited, joints_of, model, named, read, read_style,
            source,
        },
    },
};
use grasp_characters::{
    Style,
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
        let rig = read_style(&style).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
        assert_is_adult(&rig, [2e-3, 1e-3, 0.2], what);
        for hand in [&rig.left, &rig.right] {
            assert!(!hand.is_mirrored && hand.binding.is_some());
        }
    }
}

/// The bones of a VRM extension: a jaw without a node.
fn with_jaw_of_0(names: &[String]) -> Value {
    let mut extensions = vrm_0(names);
    let bones = extensions["VRM"]["humanoid"]["humanBones"]
        .as_array_mut()
        .unwrap();
    bones.insert(0, json!({ "bone": "jaw", "node": -1 }));
    extensions
}

fn with_jaw_of_1(names: &[String]) -> Value {
    let mut extensions = vrm_1(names);
    extensions["VRMC_vrm"]["humanoid"]["humanBones"]["jaw"] = Value::Null;
    extensions
}

/// Thumbs of drafts of VRM 1.0, which have the names of a finger.
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

/// An extension that names the hands and two bones of the index fingers.
fn without_distal(names: &[String]) -> Value {
    let node = |name: String| names.iter().position(|other| *other == name).unwrap();
    let mut bones = Vec::new();
    for (side, letter) in [("left", 'L'), ("right", 'R')] {
        for (bone, name) in [
            ("Hand", "Hand"),
            ("IndexProximal", "Index1"),
            ("IndexIntermediate", "Index2"),
        ] {
            bones.push(
                json!({ "bone": format!("{side}{bone}"), "node": node(format!("J_Bip_{letter}_{name}")) }),
            );
        }
    }
    json!({ "VRM": { "humanoid": { "humanBones": bones } } })
}

/// A program, its names of bones and its extensions.
type Program = (&'static str, Name, fn(&[String]) -> Value);

#[test]
fn numbers_and_extensions_that_leave_out_bones_give_the_same_rig() {
    let none = Style::PLAIN.extensions;
    let programs: [Program; 13] = [
        ("four bones from the palm", numbered_from_palm, none),
        ("five bones from the palm", numbered_to_end, none),
        ("Auto-Rig Pro", auto_rig, none),
        ("Blender", blender, none),
        ("SteamVR", steam, none),
        ("Ultraleap", leap, none),
        ("Biped", biped, none),
        ("VRoid", vroid, none),
        ("bones without a node in 0.x", bone, with_jaw_of_0),
        ("bones without a node in 1.0", bone, with_jaw_of_1),
        ("draft", bone, draft),
        ("without the last bone", vroid, without_distal),
        (
            "broken",
            vroid,
            |_| json!({ "VRM": { "humanoid": { "humanBones": 3 } } }),
        ),
    ];
    for (what, name, extensions) in programs {
        let style = Style {
            extensions,
            ..named(name)
        };
        let rig = read_style(&style).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
        assert_is_adult(&rig, [2e-3, 1.0, 1.0], what);
        let is_told = rig
            .warnings
            .iter()
            .any(|warning| warning.contains("VRM extension cannot be read"));
        assert_eq!(is_told, what == "broken", "{:?}", rig.warnings);
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
    let rig = read_rig(&glb, source(&map), LIMITS).unwrap();
    assert_is_adult(&rig, [2e-3, 1.0, 1.0], "mapped");
}

#[test]
fn the_other_hand_is_mirrored_if_only_one_is_shown() {
    let style = Style {
        sides: &[Handedness::Left],
        ..named(mixamo)
    };
    let rig = read_style(&style).unwrap();
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
            let imported = read_style(&style).unwrap();
            for hand in [&imported.left, &imported.right] {
                let (rig, adult) = (&hand.rig, adult(hand.rig.handedness));
                assert!(rig.fingers().eq(fingers.iter().copied()), "{fingers:?}");
                assert!(rig.has(Digit::Thumb));
                for digit in Digit::ALL.into_iter().filter(|&digit| rig.has(digit)) {
                    let [own, whole] = [rig, adult].map(|rig| rig.digit(digit).lengths);
                    for (own, whole) in own.into_iter().zip(whole) {
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
                for (node, joint) in hand.binding.as_ref().unwrap().joints() {
                    let digit =
                        joint.and_then(|joint| (0..5).find(|&digit| joints_of(digit).contains(&joint)));
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
fn bounds_of_positions_are_not_needed() {
    let glb = edited(&model(unity), |document| {
        let accessor = document["accessors"][0].as_object_mut().unwrap();
        accessor.remove("min");
        accessor.remove("max");
    });
    assert_is_adult(&read(&glb).unwrap(), [2e-3, 1.0, 1.0], "without bounds");
}
