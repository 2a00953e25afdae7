//! Names of joints in the usual engines; `None` for joints that they do not have.

use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_COUNT, JOINT_NAMES, index},
};
use serde_json::{Value, json};

const DIGITS: [&str; 5] = ["Thumb", "Index", "Middle", "Ring", "Pinky"];
const ENGLISH_DIGITS: [&str; 5] = ["Thumb", "Index", "Middle", "Ring", "Little"];

/// Digit and place of a joint counted back from the tip; `None` for wrist and palm.
fn digit_of(joint: usize) -> Option<(usize, usize)> {
    let digit =
        (0..5).find(|&digit| (index::FIRST_OF_DIGIT[digit]..=index::TIP_OF_DIGIT[digit]).contains(&joint))?;
    Some((digit, index::TIP_OF_DIGIT[digit] - joint))
}

/// The name of a joint by patterns for the wrist and the joints of a digit from its tip back, separated by bars; `None` where a pattern is
/// empty. "{s}" and "{S}" stand for "left" and "Left", "{l}" and "{L}" for "l" and "L", "{d}" and "{D}" for "pinky" and "Pinky", "{E}" for
/// "Little", "{n}" for the digit's number and "{j}" for the joint's.
fn named(side: Handedness, joint: usize, patterns: &str) -> Option<String> {
    let patterns: Vec<&str> = patterns.split('|').collect();
    let (pattern, digit) = match digit_of(joint) {
        Some((digit, back)) => (patterns[1 + back], digit),
        None if joint == index::WRIST => (patterns[0], 0),
        None => return None,
    };
    let (side, letter) = (side_name(side), &side_name(side)[..1]);
    let marks = [
        ("{s}", side.to_lowercase()),
        ("{S}", side.to_owned()),
        ("{l}", letter.to_lowercase()),
        ("{L}", letter.to_owned()),
        ("{d}", DIGITS[digit].to_lowercase()),
        ("{D}", DIGITS[digit].to_owned()),
        ("{E}", ENGLISH_DIGITS[digit].to_owned()),
        ("{n}", digit.to_string()),
        ("{j}", joint.to_string()),
    ];
    let name = marks
        .iter()
        .fold(pattern.to_owned(), |name, (mark, text)| name.replace(mark, text));
    (!name.is_empty()).then_some(name)
}

/// Mixamo: the wrist, and four joints per digit.
pub fn mixamo(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "mixamorig:{S}Hand|mixamorig:{S}Hand{D}4|mixamorig:{S}Hand{D}3|mixamorig:{S}Hand{D}2|mixamorig:{S}Hand{D}1|";
    named(side, joint, patterns)
}

/// Unreal's mannequin: with metacarpals, without tips.
pub fn unreal(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "hand_{l}||{d}_03_{l}|{d}_02_{l}|{d}_01_{l}|{d}_metacarpal_{l}";
    named(side, joint, patterns)
}

/// Unity's humanoid: three joints per digit.
pub fn unity(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "{S}Hand||{S}{E}Distal|{S}{E}Intermediate|{S}{E}Proximal|";
    named(side, joint, patterns)
}

/// MANO: three joints per digit.
pub fn mano(side: Handedness, joint: usize) -> Option<String> {
    named(side, joint, "{s}_wrist||{s}_{d}3|{s}_{d}2|{s}_{d}1|")
}

/// Names that say nothing.
pub fn bone(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "bone.{l}.{j}||bone.{l}.{j}|bone.{l}.{j}|bone.{l}.{j}|";
    named(side, joint, patterns)
}

/// Auto-Rig Pro: the bone in the palm has the number of the one after it.
pub fn auto_rig(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "hand.{l}||c_{d}3.{l}|c_{d}2.{l}|{d}1.{l}|c_{d}1_base.{l}";
    named(side, joint, patterns)
}

/// Blender's automatic numbers, of which the first bone has none, with a leaf at the end.
pub fn blender(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "hand.{L}|{d}.{L}.003|{d}.{L}.002|{d}.{L}.001|{d}.{L}|";
    named(side, joint, patterns)
}

/// Numbers from zero beside the name of the bone in the palm, as in `SteamVR`.
pub fn steam(side: Handedness, joint: usize) -> Option<String> {
    let patterns =
        "wrist_{l}|finger_{d}_{l}_end|finger_{d}_2_{l}|finger_{d}_1_{l}|finger_{d}_0_{l}|finger_{d}_meta_{l}";
    named(side, joint, patterns)
}

/// 3ds Max's Biped.
pub fn biped(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "Bip001 {L} Hand|Bip001 {L} Finger{n}Nub|Bip001 {L} Finger{n}2|Bip001 {L} Finger{n}1|Bip001 {L} Finger{n}|";
    named(side, joint, patterns)
}

/// `VRoid`: three joints per digit.
pub fn vroid(side: Handedness, joint: usize) -> Option<String> {
    let patterns = "J_Bip_{L}_Hand||J_Bip_{L}_{E}3|J_Bip_{L}_{E}2|J_Bip_{L}_{E}1|";
    named(side, joint, patterns)
}

/// Quest's hands: with tips.
pub fn quest(side: Handedness, joint: usize) -> Option<String> {
    let has_base = joint == index::FIRST_OF_DIGIT[4];
    let base = if has_base { "b_{l}_pinky0" } else { "" };
    let patterns = "b_{l}_wrist|b_{l}_{d}_null|b_{l}_{d}3|b_{l}_{d}2|b_{l}_{d}1|";
    named(side, joint, &format!("{patterns}{base}"))
}

/// Numbers from the bone in the palm to the last one, and the thumb's from 1 to 3: four bones of which the first does not bend.
pub fn numbered_from_palm(side: Handedness, joint: usize) -> Option<String> {
    if let Some((0, _)) = digit_of(joint) {
        return unreal(side, joint);
    }
    let patterns = "hand_{l}||{d}_04_{l}|{d}_03_{l}|{d}_02_{l}|{d}_01_{l}";
    named(side, joint, patterns)
}

/// The same with an end: five bones.
pub fn numbered_to_end(side: Handedness, joint: usize) -> Option<String> {
    named(side, joint, "|{d}_end_{l}||||").or_else(|| numbered_from_palm(side, joint))
}

/// Letters, as Ultraleap's hands have them.
pub fn leap(side: Handedness, joint: usize) -> Option<String> {
    let letters = match digit_of(joint) {
        Some((0, _)) => "|{L}_{d}_end|{L}_{d}_b|{L}_{d}_a|{L}_{d}_meta|",
        _ => "{L}_Wrist|{L}_{d}_end|{L}_{d}_c|{L}_{d}_b|{L}_{d}_a|{L}_{d}_meta",
    };
    named(side, joint, letters)
}

/// The humanoid bones of VRM by joint, with the names of the thumb's bones.
fn vrm_bones(names: &[String], thumb: [&str; 3]) -> Vec<(String, usize)> {
    let mut bones = Vec::new();
    for side in [Handedness::Left, Handedness::Right] {
        for joint in 0..JOINT_COUNT {
            let Some(name) = bone(side, joint) else { continue };
            let node = names.iter().position(|other| *other == name).unwrap();
            let prefix = side_name(side).to_lowercase();
            let fingers = ["Proximal", "Intermediate", "Distal"];
            let part = digit_of(joint).map_or("Hand".to_owned(), |(digit, back)| {
                let segments = if digit == 0 { thumb } else { fingers };
                format!("{}{}", ENGLISH_DIGITS[digit], segments[3 - back])
            });
            bones.push((format!("{prefix}{part}"), node));
        }
    }
    bones
}

/// The extension of VRM 0.x, which says which joints nodes with the names of [`bone`] are.
pub fn vrm_0(names: &[String]) -> Value {
    let bones = vrm_bones(names, ["Proximal", "Intermediate", "Distal"]);
    let bones = bones
        .iter()
        .map(|(bone, node)| json!({ "bone": bone, "node": node }));
    let bones: Vec<Value> = bones.collect();
    json!({ "VRM": { "specVersion": "0.0", "humanoid": { "humanBones": bones } } })
}

/// The same of VRM 1.0.
pub fn vrm_1(names: &[String]) -> Value {
    let bones = vrm_bones(names, ["Metacarpal", "Proximal", "Distal"]);
    let bones = bones
        .into_iter()
        .map(|(bone, node)| (bone, json!({ "node": node })));
    let bones: serde_json::Map<String, Value> = bones.collect();
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
