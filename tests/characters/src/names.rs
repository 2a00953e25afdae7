//! Names of joints in the usual engines; none for joints that they do not have.

use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};
use serde_json::{Value, json};

const DIGITS: [&str; 5] = ["Thumb", "Index", "Middle", "Ring", "Pinky"];

/// Digit and place of a joint counted back from the tip; `None` for wrist and palm.
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

/// Numbers from the bone in the palm to the last one, and the thumb's from 1 to 3: four bones of which the first does not bend.
pub fn numbered_from_palm(side: Handedness, joint: usize) -> Option<String> {
    let l = letter(side);
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("hand_{l}")),
        (_, Some((0, back @ 1..=3))) => Some(format!("thumb_0{}_{l}", 4 - back)),
        (_, Some((digit, back @ 1..=4))) if digit > 0 => {
            Some(format!("{}_0{}_{l}", DIGITS[digit].to_lowercase(), 5 - back))
        }
        _ => None,
    }
}

/// The same with an end: five bones.
pub fn numbered_to_end(side: Handedness, joint: usize) -> Option<String> {
    match digit_of(joint) {
        Some((digit, 0)) => Some(format!("{}_end_{}", DIGITS[digit].to_lowercase(), letter(side))),
        _ => numbered_from_palm(side, joint),
    }
}

/// Auto-Rig Pro: the bone in the palm has the number of the one after it.
pub fn auto_rig(side: Handedness, joint: usize) -> Option<String> {
    let l = letter(side);
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("hand.{l}")),
        (_, Some((digit, back @ 1..=4))) => {
            let digit = DIGITS[digit].to_lowercase();
            Some(match back {
                4 => format!("c_{digit}1_base.{l}"),
                3 => format!("{digit}1.{l}"),
                _ => format!("c_{digit}{}.{l}", 4 - back),
            })
        }
        _ => None,
    }
}

/// Blender's automatic numbers, of which the first bone has none, with a leaf at the end.
pub fn blender(side: Handedness, joint: usize) -> Option<String> {
    let l = letter(side).to_uppercase();
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("hand.{l}")),
        (_, Some((digit, 3))) => Some(format!("{}.{l}", DIGITS[digit].to_lowercase())),
        (_, Some((digit, back @ 0..=2))) => {
            Some(format!("{}.{l}.00{}", DIGITS[digit].to_lowercase(), 3 - back))
        }
        _ => None,
    }
}

/// Numbers from zero beside the name of the bone in the palm, as in `SteamVR`.
pub fn steam(side: Handedness, joint: usize) -> Option<String> {
    let l = letter(side);
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("wrist_{l}")),
        (_, Some((digit, back))) => {
            let digit = DIGITS[digit].to_lowercase();
            Some(match back {
                0 => format!("finger_{digit}_{l}_end"),
                4 => format!("finger_{digit}_meta_{l}"),
                _ => format!("finger_{digit}_{}_{l}", 3 - back),
            })
        }
        _ => None,
    }
}

/// Letters, as Ultraleap's hands have them.
pub fn leap(side: Handedness, joint: usize) -> Option<String> {
    let l = letter(side).to_uppercase();
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{l}_Wrist")),
        (_, Some((0, back))) => {
            let part = ["end", "b", "a", "meta"].get(back)?;
            Some(format!("{l}_thumb_{part}"))
        }
        (_, Some((digit, back))) => {
            let part = ["end", "c", "b", "a", "meta"][back];
            Some(format!("{l}_{}_{part}", DIGITS[digit].to_lowercase()))
        }
        _ => None,
    }
}

/// 3ds Max's Biped.
pub fn biped(side: Handedness, joint: usize) -> Option<String> {
    let prefix = format!("Bip001 {}", letter(side).to_uppercase());
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{prefix} Hand")),
        (_, Some((digit, back @ 0..=3))) => {
            Some(format!("{prefix} Finger{digit}{}", ["Nub", "2", "1", ""][back]))
        }
        _ => None,
    }
}

/// `VRoid`: three joints per digit.
pub fn vroid(side: Handedness, joint: usize) -> Option<String> {
    let prefix = format!("J_Bip_{}", letter(side).to_uppercase());
    match (joint, digit_of(joint)) {
        (index::WRIST, _) => Some(format!("{prefix}_Hand")),
        (_, Some((digit, back @ 1..=3))) => {
            let digits = ["Thumb", "Index", "Middle", "Ring", "Little"];
            Some(format!("{prefix}_{}{}", digits[digit], 4 - back))
        }
        _ => None,
    }
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
