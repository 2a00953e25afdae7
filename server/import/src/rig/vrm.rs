//! The bones that a VRM file names in its extension, whatever its nodes are called.
//!
//! Programs wrote files that the schemas do not allow and that every viewer takes: bones with the node −1 or null, the thumb's names
//! of 0.x in drafts of 1.0, hands without fingers. What is not a bone with a node is skipped.

use std::collections::BTreeMap;

use grasp_synthesis::model::hand::{Handedness, joints::index};
use serde::Deserialize;
use serde_json::Value;

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
    vrm_0: Option<Vrm>,
    #[serde(rename = "VRMC_vrm")]
    vrm_1: Option<Vrm>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Vrm {
    humanoid: Humanoid,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Humanoid {
    /// A list in 0.x, a map in 1.0.
    #[serde(rename = "humanBones")]
    bones: Value,
}

/// A joint of a hand and its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct VrmJoint {
    pub(super) side: Handedness,
    /// In `OpenXR` order.
    pub(super) joint: usize,
    pub(super) node: usize,
}

/// The joints of hands in the extension of VRM 1.0 or 0.x; `None` if the document has neither.
///
/// # Errors
/// Why the extension cannot be read.
pub(super) fn joints(json: &[u8]) -> Result<Option<Vec<VrmJoint>>, String> {
    let document: Document = serde_json::from_slice(json).map_err(|error| error.to_string())?;
    let Extensions { vrm_0, vrm_1 } = document.extensions;
    let Some(vrm) = vrm_1.or(vrm_0) else {
        return Ok(None);
    };
    let node = |bone: &Value| usize::try_from(bone.get("node")?.as_u64()?).ok();
    let bones: BTreeMap<String, usize> = match vrm.humanoid.bones {
        Value::Array(bones) => bones
            .iter()
            .filter_map(|bone| Some((bone.get("bone")?.as_str()?.to_owned(), node(bone)?)))
            .collect(),
        Value::Object(bones) => bones
            .into_iter()
            .filter_map(|(name, bone)| Some((name, node(&bone)?)))
            .collect(),
        _ => return Err("its humanoid names no bones".to_owned()),
    };
    let mut joints = Vec::new();
    for (prefix, side) in [("left", Handedness::Left), ("right", Handedness::Right)] {
        let has = |bone: &str| bones.contains_key(&format!("{prefix}{bone}"));
        // Metacarpal, proximal and distal since 1.0; of the older names, only these two can mean something else.
        let is_old = has("ThumbIntermediate") && !has("ThumbMetacarpal");
        let of_side = bones.iter().filter_map(|(bone, &node)| {
            let joint = joint(bone.strip_prefix(prefix)?, is_old)?;
            Some(VrmJoint { side, joint, node })
        });
        joints.extend(of_side);
    }
    Ok(Some(joints))
}

/// The joint of a bone without its side; `is_old` if the thumb's bones have the names of a finger's.
fn joint(part: &str, is_old: bool) -> Option<usize> {
    if part == "Hand" {
        return Some(index::WRIST);
    }
    let digits = ["Thumb", "Index", "Middle", "Ring", "Little"];
    let (digit, bone) = digits
        .iter()
        .enumerate()
        .find_map(|(digit, name)| Some((digit, part.strip_prefix(name)?)))?;
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
    use serde_json::json;

    use super::*;

    fn read(extensions: &Value) -> Result<Option<Vec<VrmJoint>>, String> {
        joints(json!({ "extensions": extensions }).to_string().as_bytes())
    }

    #[test]
    fn bones_without_a_node_are_skipped() {
        let hand = VrmJoint {
            side: Handedness::Right,
            joint: index::WRIST,
            node: 4,
        };
        let old = json!({ "VRM": { "humanoid": { "humanBones": [
            { "bone": "jaw", "node": -1 }, { "bone": "rightHand", "node": 4 }, { "bone": "hips" }, null,
        ] } } });
        assert_eq!(read(&old), Ok(Some(vec![hand])));
        let new = json!({ "VRMC_vrm": { "humanoid": { "humanBones": {
            "jaw": null, "rightHand": { "node": 4 }, "leftEye": { "node": null },
        } } } });
        assert_eq!(read(&new), Ok(Some(vec![hand])));
        assert_eq!(read(&json!({})), Ok(None));
        assert!(read(&json!({ "VRM": {} })).is_err());
        assert!(read(&json!({ "VRM": 3 })).is_err());
    }

    #[test]
    fn the_thumbs_names_are_those_of_a_finger_if_one_of_them_is() {
        let thumb = |names: [&str; 3]| {
            let bones = names.iter().enumerate();
            let bones = bones.map(|(node, name)| (format!("leftThumb{name}"), json!({ "node": node })));
            let bones: serde_json::Map<String, Value> = bones.collect();
            let mut read = read(&json!({ "VRMC_vrm": { "humanoid": { "humanBones": bones } } }))
                .unwrap()
                .unwrap();
            read.sort_by_key(|joint| joint.node);
            read.iter().map(|joint| joint.joint).collect::<Vec<_>>()
        };
        let expected = [0, 1, 2].map(|place| index::FIRST_OF_DIGIT[0] + place);
        assert_eq!(thumb(["Metacarpal", "Proximal", "Distal"]), expected);
        assert_eq!(thumb(["Proximal", "Intermediate", "Distal"]), expected);
    }
}
