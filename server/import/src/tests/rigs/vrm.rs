//! VRM files that other readers take.

use grasp_characters::{
    Character, Style,
    names::{bone, vrm_0, vrm_1, vroid},
};
use serde_json::{Value, json};

use crate::tests::rigs::{adult, differences, edited, read};

/// Checks that a file gives the adult's rig, and returns its warnings.
fn assert_is_adult(what: &str, glb: &[u8]) -> Vec<String> {
    let rig = read(glb).unwrap_or_else(|errors| panic!("{what}: {errors:?}"));
    for hand in [&rig.left, &rig.right] {
        let [places, ..] = differences(&hand.rig, adult(hand.rig.handedness));
        assert!(places.0 < 2e-3, "{what}: {places:?}");
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
            name: bone,
            extensions,
            ..Style::PLAIN
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
        name: bone,
        extensions: draft,
        ..Style::PLAIN
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
        name: vroid,
        extensions: hands,
        ..Style::PLAIN
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
        name: vroid,
        extensions: without_distal,
        ..Style::PLAIN
    };
    assert_is_adult("without the last bone", &Character::new(&style).glb);
}

#[test]
fn bounds_of_positions_are_not_needed() {
    let glb = Character::new(&Style {
        name: bone,
        extensions: vrm_0,
        ..Style::PLAIN
    })
    .glb;
    let glb = edited(&glb, |document| {
        let accessor = document["accessors"][0].as_object_mut().unwrap();
        accessor.remove("min");
        accessor.remove("max");
    });
    assert_is_adult("without bounds", &glb);
}

#[test]
fn an_extension_that_cannot_be_read_is_told() {
    let style = Style {
        name: vroid,
        extensions: |_| json!({ "VRM": { "humanoid": { "humanBones": 3 } } }),
        ..Style::PLAIN
    };
    let warnings = assert_is_adult("broken", &Character::new(&style).glb);
    assert!(
        warnings
            .iter()
            .any(|warning| warning.contains("VRM extension cannot be read")),
        "{warnings:?}"
    );
}
