//! Which joint of a hand a node is, by its name: `WebXR` and `OpenXR`, Unity's humanoid, Mixamo, Unreal's mannequin, MANO,
//! Quest (OVR), 3ds Max (Biped), and others that name side, digit and segment in any order and spelling; or by the bones that a
//! VRM file names in its extension, whatever its nodes are called.
//!
//! Programs wrote files that the schemas of VRM do not allow and that every viewer takes: bones with the node −1 or null, the
//! thumb's names of 0.x in drafts of 1.0, hands without fingers. Entries without a bone's node are skipped.

use std::collections::BTreeMap;

use grasp_synthesis::model::hand::{
    Digit, Handedness,
    joints::{JOINT_NAMES, index},
};
use serde::Deserialize;
use serde_json::Value;

use super::{hand_nodes::HandNodes, model::Model};
use crate::text::name_words;

/// Meaning of a node's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NodeName {
    /// The hand, if the name has one.
    pub(super) side: Option<Handedness>,
    /// The segment of a digit; `None` for the wrist, or the hand as a whole.
    pub(super) segment: Option<(Digit, Segment)>,
}

/// A segment of a digit. What `Proximal` of a thumb and numbers mean depends on which others the digit has; see
/// [`digits`](super::digits).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Segment {
    /// The bone in the palm.
    Metacarpal,
    Proximal,
    Intermediate,
    Distal,
    Tip,
    /// The digit alone, as Blender names the bone that others with numbers were copied from.
    Unnumbered,
    Number(u8),
}

/// Words of nodes that are no joints of a hand though their names contain those of joints.
const OTHERS: &str = "ik ctrl control target pole twist roll arm fore forearm lowerarm attach gun weapon pad mesh foot toe \
    corrective half marker collider axis";

/// Reads a name; `None` if it is not that of a joint of a hand.
pub(super) fn read(name: &str) -> Option<NodeName> {
    let words = name_words(name);
    if OTHERS
        .split(' ')
        .any(|other| words.iter().any(|word| word == other))
    {
        return None;
    }
    let mut side = None;
    let mut digit = None;
    let mut segment = None;
    let mut is_wrist = false;
    for (place, word) in words.iter().enumerate() {
        match word.as_str() {
            "l" | "left" => side = side.or(Some(Handedness::Left)),
            "r" | "right" => side = side.or(Some(Handedness::Right)),
            "thumb" => digit = digit.or(Some(Digit::Thumb)),
            "index" => digit = digit.or(Some(Digit::Index)),
            "middle" | "mid" if digit.is_none() => digit = Some(Digit::Middle),
            "ring" => digit = digit.or(Some(Digit::Ring)),
            "little" | "pinky" | "pinkie" => digit = digit.or(Some(Digit::Little)),
            "metacarpal" | "meta" | "carpal" => segment = Some(Segment::Metacarpal),
            // Before the digit, it is of the character, as in CC_Base_R_Index1.
            "base" if digit.is_some() => segment = Some(Segment::Metacarpal),
            "proximal" | "knuckle" => segment = Some(Segment::Proximal),
            "intermediate" | "medial" | "middle" => segment = Some(Segment::Intermediate),
            "distal" => segment = Some(Segment::Distal),
            "tip" | "end" | "null" | "nub" => segment = Some(Segment::Tip),
            "wrist" | "hand" => is_wrist = true,
            "finger" if digit.is_none() => {
                if let Some((its_digit, number)) = words.get(place + 1).and_then(|word| biped(word)) {
                    digit = Some(its_digit);
                    segment = Some(Segment::Number(number));
                }
            }
            // Numbers before the digit are those of the character.
            other if digit.is_some() => segment = segment.or(number(other).map(Segment::Number)),
            _ => {}
        }
    }
    let is_hand = digit.is_some() || is_wrist && segment.is_none();
    let segment = digit.map(|digit| (digit, segment.unwrap_or(Segment::Unnumbered)));
    is_hand.then_some(NodeName { side, segment })
}

/// A number, or a letter that counts like one.
fn number(word: &str) -> Option<u8> {
    match word.as_bytes() {
        [letter @ b'a'..=b'd'] => Some(letter - b'a' + 1),
        _ => word.parse().ok(),
    }
}

/// The digit and the bone's number after "Finger" in names of Biped: 0 to 4, and from the second bone on its number less one.
fn biped(word: &str) -> Option<(Digit, u8)> {
    let (digit, bone) = match word.as_bytes() {
        [digit] => (digit, 1),
        [digit, bone @ b'1'..=b'3'] => (digit, bone - b'0' + 1),
        _ => return None,
    };
    let digit = Digit::ALL.get(usize::from(digit.checked_sub(b'0')?))?;
    Some((*digit, bone))
}

/// The joint with a name of `WebXR`, in any spelling of its words.
pub(super) fn joint_named(name: &str) -> Option<usize> {
    let words = name_words(name);
    JOINT_NAMES.iter().position(|known| name_words(known) == words)
}

/// The part of a document that is read here.
#[derive(Deserialize, Default)]
#[serde(default)]
struct VrmDocument {
    extensions: Value,
}

/// The joints of hands in the extension of VRM 1.0 or 0.x; `None` if the document has neither. Fails if it cannot be read.
pub(super) fn vrm_hands(json: &[u8], model: &Model) -> Result<Option<[HandNodes; 2]>, String> {
    let document: VrmDocument = serde_json::from_slice(json).map_err(|error| error.to_string())?;
    let extension = |name| document.extensions.get(name).filter(|found| !found.is_null());
    let Some(vrm) = extension("VRMC_vrm").or_else(|| extension("VRM")) else {
        return Ok(None);
    };
    let node = |bone: &Value| usize::try_from(bone.get("node")?.as_u64()?).ok();
    // A list in 0.x, a map in 1.0.
    let bones: BTreeMap<String, usize> = match &vrm["humanoid"]["humanBones"] {
        Value::Array(bones) => bones
            .iter()
            .filter_map(|bone| Some((bone.get("bone")?.as_str()?.to_owned(), node(bone)?)))
            .collect(),
        Value::Object(bones) => bones
            .iter()
            .filter_map(|(name, bone)| Some((name.clone(), node(bone)?)))
            .collect(),
        _ => return Err("its humanoid names no bones".to_owned()),
    };
    let mut hands = HandNodes::NONE;
    for (prefix, hand) in ["left", "right"].into_iter().zip(&mut hands) {
        let has = |bone: &str| bones.contains_key(&format!("{prefix}{bone}"));
        // Metacarpal, proximal and distal since 1.0; of the older names, only these two can mean something else.
        let is_old = has("ThumbIntermediate") && !has("ThumbMetacarpal");
        for (bone, &node) in bones.iter().filter(|&(_, &node)| node < model.names.len()) {
            let part = bone.strip_prefix(prefix);
            if let Some(joint) = part.and_then(|part| joint_of_bone(part, is_old)) {
                hand.joints[joint] = Some(node);
            }
        }
    }
    Ok(Some(hands))
}

/// The joint of a bone without its side; `is_old` if the thumb's bones have the names of a finger's.
fn joint_of_bone(part: &str, is_old: bool) -> Option<usize> {
    if part == "Hand" {
        return Some(index::WRIST);
    }
    let mut digits = ["Thumb", "Index", "Middle", "Ring", "Little"]
        .into_iter()
        .enumerate();
    let (digit, bone) = digits.find_map(|(digit, name)| Some((digit, part.strip_prefix(name)?)))?;
    let bones = if digit == 0 && !is_old {
        ["Metacarpal", "Proximal", "Distal"]
    } else {
        ["Proximal", "Intermediate", "Distal"]
    };
    let place = bones.iter().position(|&name| name == bone)?;
    Some(index::TIP_OF_DIGIT[digit] - 3 + place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knows_the_names_of_the_usual_engines() {
        use Digit::{Index, Little, Middle, Ring};
        use Segment::{Distal, Intermediate, Metacarpal, Number, Proximal};
        let (left, right) = (Some(Handedness::Left), Some(Handedness::Right));
        for (name, side, segment) in [
            ("index-finger-phalanx-proximal", None, Some((Index, Proximal))),
            ("CC_Base_R_Hand", right, None),
            ("CC_Base_R_Index1", right, Some((Index, Number(1)))),
            ("c_index1_base.r", right, Some((Index, Metacarpal))),
            ("XRHand_LittleMetacarpal", None, Some((Little, Metacarpal))),
            ("L_MiddleIntermediate", left, Some((Middle, Intermediate))),
            ("mixamorig1:LeftHandPinky4", left, Some((Little, Number(4)))),
            ("Right Ring Distal", right, Some((Ring, Distal))),
            ("R_IndexKnuckle", right, Some((Index, Proximal))),
            ("R_MiddleMiddleJoint", right, Some((Middle, Intermediate))),
            ("R_index_b", right, Some((Index, Number(2)))),
        ] {
            assert_eq!(read(name), Some(NodeName { side, segment }), "{name}");
        }
        for other in
            "LeftForeArm|ik_hand_l|Head|lowerarm_twist_01_l|LeftHandle|spine_03|r_index_knuckle_marker"
                .split('|')
        {
            assert_eq!(read(other), None, "{other}");
        }
    }
}
