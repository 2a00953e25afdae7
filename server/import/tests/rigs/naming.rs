//! Names of the usual engines.

use grasp_import::MappedJoint;
use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};
use serde_json::{Value, json};

use crate::{
    LIMITS, adult,
    character::{Character, Style, side_name},
    differences, read, source,
};

const DIGITS: [&str; 5] = ["Thumb", "Index", "Middle", "Ring", "Pinky"];

/// Digit and place of a joint counted back from the tip; none for wrist and palm.
fn digit_of(joint: usize) -> Option<(usize, usize)> {
    let digit =
        (0..5).find(|&digit| (index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]).contains(&joint))?;
    Some((digit, index::TIP_OF_DIGIT[digit] - joint))
}

fn letter(side: Handedness) -> &'static str {
    match side {
        Handedness::Left => "l",
        Handedness::Right => "r",
    }
}

pub(crate) fn mixamo(side: Handedness, joint: usize) -> Option<String> {
    let hand = format!("mixamorig:{}Hand", side_name(side));
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(hand),
        (_, Some((digit, back))) if back < 4 => Some(format!("{hand}{}{}", DIGITS[digit], 4 - back)),
        _ => None,
    }
}

fn unreal(side: Handedness, joint: usize) -> Option<String> {
    let l = letter(side);
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("hand_{l}")),
        (_, Some((digit, 4))) => Some(format!("{}_metacarpal_{l}", DIGITS[digit].to_lowercase())),
        (_, Some((digit, back))) if back > 0 => {
            Some(format!("{}_0{}_{l}", DIGITS[digit].to_lowercase(), 4 - back))
        }
        _ => None,
    }
}

fn unity(side: Handedness, joint: usize) -> Option<String> {
    let side = side_name(side);
    let digits = ["Thumb", "Index", "Middle", "Ring", "Little"];
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{side}Hand")),
        (_, Some((digit, back @ 1..=3))) => {
            let segment = ["Distal", "Intermediate", "Proximal"][back - 1];
            Some(format!("{side}{}{segment}", digits[digit]))
        }
        _ => None,
    }
}

fn mano(side: Handedness, joint: usize) -> Option<String> {
    let side = side_name(side).to_lowercase();
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{side}_wrist")),
        (_, Some((digit, back @ 1..=3))) => {
            Some(format!("{side}_{}{}", DIGITS[digit].to_lowercase(), 4 - back))
        }
        _ => None,
    }
}

fn quest(side: Handedness, joint: usize) -> Option<String> {
    let prefix = format!("b_{}_", letter(side));
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{prefix}wrist")),
        (_, Some((4, 4))) => Some(format!("{prefix}pinky0")),
        (_, Some((digit, 0))) => Some(format!("{prefix}{}_null", DIGITS[digit].to_lowercase())),
        (_, Some((digit, back @ 1..=3))) => {
            Some(format!("{prefix}{}{}", DIGITS[digit].to_lowercase(), 4 - back))
        }
        _ => None,
    }
}

/// Names that say nothing.
fn bone(side: Handedness, joint: usize) -> Option<String> {
    matches!(
        (joint, digit_of(joint)),
        (index::WRIST, _) | (_, Some((_, 1..=3)))
    )
    .then(|| format!("bone.{}.{joint}", letter(side)))
}

/// The humanoid bones of VRM by joint, with the names of the thumb's bones.
fn vrm_bones(names: &[String], thumb: [&str; 3]) -> Vec<(String, usize)> {
    let mut bones = Vec::new();
    for side in [Handedness::Left, Handedness::Right] {
        for joint in 0..JOINT_COUNT {
            let Some(name) = bone(side, joint) else { continue };
            let node = names.iter().position(|other| *other == name).unwrap();
            let prefix = side_name(side).to_lowercase();
            bones.push(match digit_of(joint) {
                None => (format!("{prefix}Hand"), node),
                Some((digit, back)) => {
                    let segments = if digit == 0 {
                        thumb
                    } else {
                        ["Proximal", "Intermediate", "Distal"]
                    };
                    let digits = ["Thumb", "Index", "Middle", "Ring", "Little"];
                    (format!("{prefix}{}{}", digits[digit], segments[3 - back]), node)
                }
            });
        }
    }
    bones
}

fn vrm_0(names: &[String]) -> Value {
    let bones = vrm_bones(names, ["Proximal", "Intermediate", "Distal"]);
    let bones: Vec<Value> = bones
        .iter()
        .map(|(bone, node)| json!({ "bone": bone, "node": node }))
        .collect();
    json!({ "VRM": { "specVersion": "0.0", "humanoid": { "humanBones": bones } } })
}

fn vrm_1(names: &[String]) -> Value {
    let bones = vrm_bones(names, ["Metacarpal", "Proximal", "Distal"]);
    let bones: serde_json::Map<String, Value> = bones
        .into_iter()
        .map(|(bone, node)| (bone, json!({ "node": node })))
        .collect();
    json!({ "VRMC_vrm": { "specVersion": "1.0", "humanoid": { "humanBones": bones } } })
}

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
    let rig = grasp_import::read_rig(&character.glb, source(&map), LIMITS).unwrap();
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
