//! Hands of models: glTF, GLB and VRM, and whether they can be posed.

#![no_main]

use gltf::Glb;
use grasp_assets::hands::hand;
use grasp_characters::{
    Character, Style,
    names::{bone, mixamo, vrm_0, vrm_1, webxr},
};
use grasp_fuzz::{GLTF_LIMITS, GLTF_WORDS, LONGEST, Target, file, fuzz, words};
use grasp_import::{RigSource, read_rig};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        HandPose, Handedness,
        joints::{JOINT_COUNT, JOINT_NAMES},
        kinematics::hand_frames,
    },
};
use serde_json::Value;

fn read(input: &[u8]) {
    let reference = &hand("adult", Handedness::Right).expect("the rig is built in").rig;
    let source = RigSource {
        name: "rigs/own",
        reference,
        side: None,
        joint_map: &[],
        limits: std::array::from_fn(|digit| reference.digits[digit].limits),
        width_scale: 1.0,
        radii: [None; JOINT_COUNT],
        is_of_pair: false,
    };
    let Ok(rig) = read_rig(&file(input), source, GLTF_LIMITS) else {
        return;
    };
    // Its model can be posed.
    for hand in [&rig.left, &rig.right] {
        let Some(binding) = &hand.binding else { continue };
        let pose = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: hand.rig.stretched(),
        };
        let frames = hand_frames(&hand.rig, &pose);
        assert!(binding.frame_from_root(&frames, 1.0).position.is_finite());
        for node in binding.posed(&frames, 1.0) {
            let is_finite = node.translation.is_none_or(|translation| translation.is_finite());
            assert!(is_finite && node.rotation.is_normalized(), "{node:?}");
        }
    }
}

/// Every how manyth vertex of a character is left: files of a hundred kilobytes are too slow to be changed often.
const STEP: usize = 24;

/// The input of a character's file with some of its vertices, and one triangle.
fn character(style: &Style) -> Vec<u8> {
    let file = Character::new(style).glb;
    let glb = Glb::from_slice(&file).expect("the file is sound");
    let mut document: Value = serde_json::from_slice(&glb.json).expect("it is JSON");
    let content = glb.bin.expect("it has a buffer");
    let mut rest = &*content;
    let mut buffer = Vec::new();
    // Positions, joints, weights, indices, and the nodes' matrices.
    for (place, bytes) in [12, 8, 16, 4, 64].into_iter().enumerate() {
        let count = document["accessors"][place]["count"]
            .as_u64()
            .expect("it is a number") as usize;
        let (block, others) = rest.split_at(count * bytes);
        rest = others;
        let elements = block.chunks_exact(bytes);
        let left: Vec<u8> = match place {
            0..3 => elements.step_by(STEP).flatten().copied().collect(),
            3 => [0_u32, 1, 2].into_iter().flat_map(u32::to_le_bytes).collect(),
            _ => block.to_vec(),
        };
        document["accessors"][place]["count"] = (left.len() / bytes).into();
        document["bufferViews"][place]["byteOffset"] = buffer.len().into();
        document["bufferViews"][place]["byteLength"] = left.len().into();
        buffer.extend(left);
    }
    document["buffers"][0]["byteLength"] = buffer.len().into();
    [document.to_string().as_bytes(), &[0], &buffer].concat()
}

fuzz!(Target {
    read,
    seeds: || {
        let plain = Style {
            sides: &[Handedness::Right],
            ..Style::PLAIN
        };
        let named = |name, extensions| {
            character(&Style {
                name,
                extensions,
                ..plain
            })
        };
        vec![
            named(webxr, plain.extensions),
            named(mixamo, plain.extensions),
            character(&Style {
                name: bone,
                extensions: vrm_0,
                ..Style::PLAIN
            }),
            character(&Style {
                name: bone,
                extensions: vrm_1,
                ..Style::PLAIN
            }),
        ]
    },
    dense: Vec::new,
    longest: LONGEST,
    words: || {
        let bones =
            "VRM VRMC_vrm humanoid humanBones bone node specVersion rightHand leftHand rightThumbProximal";
        let joints = JOINT_NAMES.iter().map(|&joint| joint.to_owned());
        words(GLTF_WORDS)
            .into_iter()
            .chain(words(bones))
            .chain(joints)
            .collect()
    },
});
