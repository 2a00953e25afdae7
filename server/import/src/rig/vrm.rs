//! The bones that a VRM file names in its extension, whatever its nodes are called.

use std::collections::BTreeMap;

use grasp_synthesis::model::hand::{
    Handedness,
    joints::{JOINT_NAMES, index},
};
use serde::Deserialize;

/// The parts of a document that are read here; the others are skipped.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Document {
    extensions: Extensions,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Extensions {
    #[serde(rename = "VRM")]
    vrm_0: Option<Vrm<Vec<Bone0>>>,
    #[serde(rename = "VRMC_vrm")]
    vrm_1: Option<Vrm<BTreeMap<String, Bone1>>>,
}

#[derive(Deserialize)]
struct Vrm<Bones> {
    humanoid: Humanoid<Bones>,
}

#[derive(Deserialize)]
struct Humanoid<Bones> {
    #[serde(rename = "humanBones")]
    bones: Bones,
}

#[derive(Deserialize)]
struct Bone0 {
    bone: String,
    node: usize,
}

#[derive(Deserialize)]
struct Bone1 {
    node: usize,
}

/// A joint of a hand and its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct VrmJoint {
    pub(super) side: Handedness,
    /// In `OpenXR` order.
    pub(super) joint: usize,
    pub(super) node: usize,
}

/// The joints of hands in the extension of VRM 1.0 or 0.x; none if the document has neither, or a broken one.
pub(super) fn joints(json: &[u8]) -> Option<Vec<VrmJoint>> {
    let Extensions { vrm_0, vrm_1 } = serde_json::from_slice::<Document>(json).ok()?.extensions;
    let bones: Vec<(String, usize, &[&str; 3])> = match (vrm_1, vrm_0) {
        (Some(vrm), _) => {
            let bones = vrm.humanoid.bones.into_iter();
            bones
                .map(|(bone, Bone1 { node })| (bone, node, &["Metacarpal", "Proximal", "Distal"]))
                .collect()
        }
        (None, Some(vrm)) => {
            let bones = vrm.humanoid.bones.into_iter();
            bones
                .map(|Bone0 { bone, node }| (bone, node, &["Proximal", "Intermediate", "Distal"]))
                .collect()
        }
        (None, None) => return None,
    };
    let joints = bones.into_iter().filter_map(|(bone, node, thumb)| {
        let (side, part) = match (bone.strip_prefix("left"), bone.strip_prefix("right")) {
            (Some(part), _) => (Handedness::Left, part),
            (_, Some(part)) => (Handedness::Right, part),
            _ => return None,
        };
        let joint = joint(part, thumb)?;
        Some(VrmJoint { side, joint, node })
    });
    Some(joints.collect())
}

/// The joint of a bone without its side; `thumb` are the names of the thumb's bones.
fn joint(part: &str, thumb: &[&str; 3]) -> Option<usize> {
    if part == "Hand" {
        return Some(index::WRIST);
    }
    let digits = ["Thumb", "Index", "Middle", "Ring", "Little"];
    let (digit, bone) = digits
        .iter()
        .enumerate()
        .find_map(|(digit, name)| Some((digit, part.strip_prefix(name)?)))?;
    let bones = if digit == 0 {
        thumb
    } else {
        &["Proximal", "Intermediate", "Distal"]
    };
    let place = bones.iter().position(|&name| name == bone)?;
    let joint = index::TIP_OF_DIGIT[digit] - 3 + place;
    debug_assert!(joint < JOINT_NAMES.len());
    Some(joint)
}
