//! Which joint of a hand a node is, by its name: `WebXR` and `OpenXR`, Unity's humanoid, Mixamo, Unreal's mannequin, MANO,
//! Quest (OVR), and others that name side, digit and segment in any order and spelling.

use grasp_synthesis::model::hand::{
    Digit, Handedness,
    joints::{JOINT_NAMES, index},
};

/// What a name says about a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NodeName {
    /// The hand, if the name has one.
    pub(super) side: Option<Handedness>,
    /// The part of the hand.
    pub(super) part: Part,
}

/// A part of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The wrist, or the hand as a whole.
    Wrist,
    /// A segment of a digit.
    Segment(Digit, Segment),
}

/// A segment of a digit. What `Proximal` of a thumb and numbers mean depends on which others the digit has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Segment {
    /// The bone in the palm.
    Metacarpal,
    Proximal,
    Intermediate,
    Distal,
    Tip,
    Number(u8),
}

/// Words of nodes that are no joints of a hand though their names contain those of joints.
const OTHERS: &[&str] = &[
    "ik",
    "ctrl",
    "control",
    "target",
    "pole",
    "twist",
    "roll",
    "arm",
    "fore",
    "forearm",
    "lowerarm",
    "attach",
    "gun",
    "weapon",
    "pad",
    "mesh",
    "foot",
    "toe",
    "corrective",
    "half",
];

/// Reads a name; none if it is not that of a joint of a hand.
pub(super) fn read(name: &str) -> Option<NodeName> {
    let words = words(name);
    if words.iter().any(|word| OTHERS.contains(&word.as_str())) {
        return None;
    }
    let mut side = None;
    let mut digit = None;
    let mut segment = None;
    let mut is_wrist = false;
    for word in &words {
        match word.as_str() {
            "l" | "left" => side = side.or(Some(Handedness::Left)),
            "r" | "right" => side = side.or(Some(Handedness::Right)),
            "thumb" => digit = digit.or(Some(Digit::Thumb)),
            "index" => digit = digit.or(Some(Digit::Index)),
            "middle" | "mid" if digit.is_none() => digit = Some(Digit::Middle),
            "ring" => digit = digit.or(Some(Digit::Ring)),
            "little" | "pinky" | "pinkie" => digit = digit.or(Some(Digit::Little)),
            "metacarpal" | "meta" | "carpal" => segment = Some(Segment::Metacarpal),
            "proximal" => segment = Some(Segment::Proximal),
            "intermediate" | "medial" | "middle" => segment = Some(Segment::Intermediate),
            "distal" => segment = Some(Segment::Distal),
            "tip" | "end" | "null" | "nub" => segment = Some(Segment::Tip),
            "wrist" | "hand" => is_wrist = true,
            number => {
                // Numbers before the digit are those of the character.
                if let (Some(_), Ok(number)) = (digit, number.parse()) {
                    segment = segment.or(Some(Segment::Number(number)));
                }
            }
        }
    }
    let part = match (digit, segment) {
        (Some(digit), Some(segment)) => Part::Segment(digit, segment),
        (None, None) if is_wrist => Part::Wrist,
        _ => return None,
    };
    Some(NodeName { side, part })
}

/// The joint of a segment, in `OpenXR` order; `others` are all segments that names give to the digit.
pub(super) fn joint(digit: Digit, segment: Segment, others: &[Segment]) -> Option<usize> {
    let has = |segment| others.contains(&segment);
    let first = index::FIRST_OF_DIGIT[digit.index()];
    let tip = index::TIP_OF_DIGIT[digit.index()];
    // Places of the joints from the tip: the last three bones of a digit come before it.
    let from_tip = match (digit, segment) {
        (_, Segment::Tip) => 0,
        (_, Segment::Distal) => 1,
        (Digit::Thumb, Segment::Metacarpal) => 3,
        // As in Unity's humanoid, whose thumb has the names of a finger.
        (Digit::Thumb, Segment::Proximal) if has(Segment::Intermediate) && !has(Segment::Metacarpal) => 3,
        (_, Segment::Intermediate) | (Digit::Thumb, Segment::Proximal) => 2,
        (Digit::Thumb, Segment::Number(number)) => {
            // Quest's thumb counts a bone of the wrist as 0; others start with the metacarpal.
            let base = u8::from(!has(Segment::Number(0)) || has(Segment::Number(3)));
            3_usize.checked_sub(usize::from(number.checked_sub(base)?))?
        }
        (_, Segment::Metacarpal | Segment::Number(0)) => return Some(first),
        (_, Segment::Proximal) => 3,
        (_, Segment::Number(number)) => 3_usize.checked_sub(usize::from(number - 1))?,
    };
    Some(tip - from_tip)
}

/// The joint with a name of `WebXR`, in any spelling of its words.
pub(super) fn joint_named(name: &str) -> Option<usize> {
    JOINT_NAMES.iter().position(|known| words(known) == words(name))
}

/// The words of a name in lower case: parts between other characters than letters and digits, and before capital letters and
/// numbers.
fn words(name: &str) -> Vec<String> {
    let characters: Vec<char> = name.chars().take(MOST_CHARACTERS).collect();
    let mut words: Vec<String> = Vec::new();
    let mut starts_word = true;
    for (place, &character) in characters.iter().enumerate() {
        if !character.is_ascii_alphanumeric() {
            starts_word = true;
            continue;
        }
        if let Some(&before) = place.checked_sub(1).and_then(|before| characters.get(before)) {
            let next_is_lower = characters.get(place + 1).is_some_and(char::is_ascii_lowercase);
            starts_word |= before.is_ascii_digit() != character.is_ascii_digit()
                || before.is_ascii_lowercase() && character.is_ascii_uppercase()
                || before.is_ascii_uppercase() && character.is_ascii_uppercase() && next_is_lower;
        }
        match words.last_mut() {
            Some(word) if !starts_word => word.push(character.to_ascii_lowercase()),
            _ => words.push(character.to_ascii_lowercase().to_string()),
        }
        starts_word = false;
    }
    words
}

/// Characters of a name that are read.
const MOST_CHARACTERS: usize = 256;

#[cfg(test)]
mod tests {
    use super::*;

    fn joint_of(name: &str, others: &[&str]) -> Option<(Option<Handedness>, &'static str)> {
        let NodeName { side, part } = read(name)?;
        let joint = match part {
            Part::Wrist => index::WRIST,
            Part::Segment(digit, segment) => {
                let of_others = others.iter().filter_map(|name| match read(name)?.part {
                    Part::Segment(other, segment) if other == digit => Some(segment),
                    _ => None,
                });
                joint(digit, segment, &of_others.collect::<Vec<_>>())?
            }
        };
        Some((side, JOINT_NAMES[joint]))
    }

    #[test]
    fn knows_the_names_of_the_usual_engines() {
        let (left, right) = (Some(Handedness::Left), Some(Handedness::Right));
        for (name, side, joint) in [
            (
                "index-finger-phalanx-proximal",
                None,
                "index-finger-phalanx-proximal",
            ),
            ("wrist", None, "wrist"),
            ("XRHand_LittleMetacarpal", None, "pinky-finger-metacarpal"),
            ("L_MiddleIntermediate", left, "middle-finger-phalanx-intermediate"),
            ("mixamorig:LeftHand", left, "wrist"),
            ("mixamorig:RightHandThumb1", right, "thumb-metacarpal"),
            ("mixamorig1:LeftHandPinky4", left, "pinky-finger-tip"),
            ("hand_r", right, "wrist"),
            ("index_metacarpal_l", left, "index-finger-metacarpal"),
            ("thumb_01_l", left, "thumb-metacarpal"),
            ("pinky_03_r", right, "pinky-finger-phalanx-distal"),
            ("right_ring2", right, "ring-finger-phalanx-intermediate"),
            ("b_l_wrist", left, "wrist"),
            ("b_l_pinky0", left, "pinky-finger-metacarpal"),
            ("b_r_index_null", right, "index-finger-tip"),
            ("Right Ring Distal", right, "ring-finger-phalanx-distal"),
        ] {
            assert_eq!(joint_of(name, &[]), Some((side, joint)), "{name}");
        }
        for other in [
            "LeftForeArm",
            "ik_hand_l",
            "Head",
            "lowerarm_twist_01_l",
            "LeftHandle",
            "spine_03",
        ] {
            assert_eq!(joint_of(other, &[]), None, "{other}");
        }
    }

    #[test]
    fn thumbs_follow_the_segments_that_they_have() {
        let unity = ["LeftThumbProximal", "LeftThumbIntermediate", "LeftThumbDistal"];
        let webxr = [
            "thumb-metacarpal",
            "thumb-phalanx-proximal",
            "thumb-phalanx-distal",
        ];
        let quest = ["b_l_thumb0", "b_l_thumb1", "b_l_thumb2", "b_l_thumb3"];
        let from_zero = ["thumb0", "thumb1", "thumb2"];
        let expected = |place: usize| {
            Some(
                [
                    "thumb-metacarpal",
                    "thumb-phalanx-proximal",
                    "thumb-phalanx-distal",
                ][place],
            )
        };
        for names in [&unity[..], &webxr, &quest[1..], &from_zero] {
            for (place, name) in names.iter().enumerate() {
                let others = if names.len() == 3 && names[0] == "b_l_thumb1" {
                    &quest[..]
                } else {
                    names
                };
                let found = joint_of(name, others).map(|(_, joint)| joint);
                assert_eq!(found, expected(place), "{name}");
            }
        }
        assert_eq!(joint_of("b_l_thumb0", &quest), None);
    }

    #[test]
    fn joints_are_named_in_any_spelling() {
        assert_eq!(joint_named("index-finger-phalanx-proximal"), Some(7));
        assert_eq!(joint_named("IndexFingerPhalanxProximal"), Some(7));
        assert_eq!(joint_named("index"), None);
    }
}
