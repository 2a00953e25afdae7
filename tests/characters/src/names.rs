//! Names of joints in the usual engines; none for joints that they do not have.

use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};
use serde_json::{Value, json};

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

/// Mixamo: the wrist, and four joints per digit.
pub fn mixamo(side: Handedness, joint: usize) -> Option<String> {
    let hand = format!("mixamorig:{}Hand", side_name(side));
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(hand),
        (_, Some((digit, back))) if back < 4 => Some(format!("{hand}{}{}", DIGITS[digit], 4 - back)),
        _ => None,
    }
}

/// Unreal's mannequin: with metacarpals, without tips.
pub fn unreal(side: Handedness, joint: usize) -> Option<String> {
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

/// Unity's humanoid: three joints per digit.
pub fn unity(side: Handedness, joint: usize) -> Option<String> {
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

/// MANO: three joints per digit.
pub fn mano(side: Handedness, joint: usize) -> Option<String> {
    let side = side_name(side).to_lowercase();
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{side}_wrist")),
        (_, Some((digit, back @ 1..=3))) => {
            Some(format!("{side}_{}{}", DIGITS[digit].to_lowercase(), 4 - back))
        }
        _ => None,
    }
}

/// Quest's hands: with tips.
pub fn quest(side: Handedness, joint: usize) -> Option<String> {
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
pub fn bone(side: Handedness, joint: usize) -> Option<String> {
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

/// The extension of VRM 0.x, which says which joints nodes with the names of [`bone`] are.
pub fn vrm_0(names: &[String]) -> Value {
    let bones = vrm_bones(names, ["Proximal", "Intermediate", "Distal"]);
    let bones: Vec<Value> = bones
        .iter()
        .map(|(bone, node)| json!({ "bone": bone, "node": node }))
        .collect();
    json!({ "VRM": { "specVersion": "0.0", "humanoid": { "humanBones": bones } } })
}

/// The same of VRM 1.0.
pub fn vrm_1(names: &[String]) -> Value {
    let bones = vrm_bones(names, ["Metacarpal", "Proximal", "Distal"]);
    let bones: serde_json::Map<String, Value> = bones
        .into_iter()
        .map(|(bone, node)| (bone, json!({ "node": node })))
        .collect();
    json!({ "VRMC_vrm": { "specVersion": "1.0", "humanoid": { "humanBones": bones } } })
}

/// `WebXR`: the wrist, and every joint but the palm.
pub fn webxr(side: Handedness, joint: usize) -> Option<String> {
    (joint != index::PALM).then(|| format!("{}-{}", side_name(side), JOINT_NAMES[joint]))
}

/// "Left" or "Right".
pub(crate) fn side_name(side: Handedness) -> &'static str {
    match side {
        Handedness::Left => "Left",
        Handedness::Right => "Right",
    }
}
