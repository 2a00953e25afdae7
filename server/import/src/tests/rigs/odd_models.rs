//! Warnings about odd hands, and which hands are refused.

use crate::{
    MappedJoint, RigSource, read_rig, rig_at_rest,
    tests::{
        LIMITS, assert_mentioned, messages,
        rigs::{Name, adult_at_rest, edited, joints_of, model, named, opened, read, read_style, source},
    },
};
use glam::{Mat4, Vec3};
use grasp_characters::{
    Character, Style, glb,
    names::{mixamo, webxr},
};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, JOINT_NAMES, index},
        rig::Rig,
    },
    physical::solids::{HandSolids, SOFT_CONTACT, self_clearance},
};
use serde_json::json;

fn warnings(style: &Style) -> Vec<String> {
    read_style(style).unwrap().warnings
}

#[test]
fn values_from_the_reference_are_told() {
    let texts = warnings(&named(mixamo));
    let start = "right hand: has no index-finger-metacarpal, middle-finger-metacarpal";
    assert_mentioned(&texts, &[start, "rig adult"]);
    assert_eq!(warnings(&Style::PLAIN), [""; 0], "everything is in the model");
    let bare = edited(&Character::new(&Style::PLAIN).glb, |document| {
        document["nodes"].as_array_mut().unwrap().pop();
        document["scenes"][0]["nodes"].as_array_mut().unwrap().pop();
    });
    let texts = read(&bare).unwrap().warnings;
    assert_mentioned(&texts, &["left hand: has no skin"]);
}

#[test]
fn a_thumb_without_a_skin_is_told() {
    // Twins of the thumb's nodes that move nothing, from the metacarpals, below the wrists, to the tips.
    fn renamed(side: Handedness, joint: usize) -> Option<String> {
        let name = webxr(side, joint)?;
        Some(if joints_of(0).contains(&joint) {
            format!("{name}-mesh")
        } else {
            name
        })
    }
    let glb = edited(&model(renamed), |document| {
        let nodes = document["nodes"].as_array_mut().unwrap();
        for node in 0..nodes.len() {
            let mut copy = nodes[node].clone();
            let name = copy["name"].as_str().unwrap_or_default().to_owned();
            let Some(name) = name.strip_suffix("-mesh") else {
                continue;
            };
            copy["name"] = json!(name);
            let twin = nodes.len();
            if !name.ends_with("tip") {
                copy["children"] = json!([twin + 1]);
            }
            nodes.push(copy);
            if name.ends_with("metacarpal") {
                let wrist = format!("{}-wrist", name.split('-').next().unwrap());
                let wrist = nodes.iter_mut().find(|node| node["name"] == wrist).unwrap();
                wrist["children"].as_array_mut().unwrap().push(json!(twin));
            }
        }
    });
    let texts = read(&glb).unwrap().warnings;
    for side in ["left", "right"] {
        assert_mentioned(&texts, &[side, "hand, thumb: has bones, but they move no skin"]);
    }
}

#[test]
fn bones_outside_of_their_skin_are_told_or_refused_with_the_distance() {
    for (sideways, is_refused) in [(0.018, false), (0.045, true)] {
        // The bind matrices of two bones put them beside the skin.
        let (document, mut buffer) = opened(&Character::new(&Style::PLAIN).glb);
        let nodes = document["nodes"].as_array().unwrap();
        let start = document["bufferViews"][4]["byteOffset"].as_u64().unwrap() as usize;
        for bone in ["intermediate", "distal"] {
            let name = format!("Right-index-finger-phalanx-{bone}");
            let node = nodes.iter().position(|node| node["name"] == name).unwrap();
            let bytes = &mut buffer[start + 64 * node..][..64];
            let numbers = bytes
                .as_chunks()
                .0
                .iter()
                .map(|&number| f32::from_le_bytes(number));
            let bound = Mat4::from_cols_slice(&numbers.collect::<Vec<f32>>()).inverse();
            // Out of the palm or the back of the hand, which is stretched to the side.
            let moved = (Mat4::from_translation(Vec3::Y * sideways) * bound).inverse();
            let moved = moved.to_cols_array().into_iter().flat_map(f32::to_le_bytes);
            bytes.copy_from_slice(&moved.collect::<Vec<u8>>());
        }
        let moved = read(&glb(&document, buffer));
        let texts = if is_refused {
            messages(moved)
        } else {
            moved.unwrap().warnings
        };
        let start = "right hand, index-finger-phalanx-intermediate: is ";
        assert_mentioned(&texts, &[start, "mm from the middle of the skin"]);
    }
}

#[test]
fn bent_fingers_are_told() {
    let bent = |bend| Style { bend, ..Style::PLAIN };
    assert_eq!(warnings(&bent(0.2)), [""; 0]);
    let texts = warnings(&bent(0.6));
    assert_mentioned(&texts, &["right hand, index finger: is bent by 10"]);
}

/// The names of a program or client that calls the bone in the palm the proximal one.
fn shifted(side: Handedness, joint: usize) -> Option<String> {
    let of_finger =
        (1..5).find(|&digit| joints_of(digit).contains(&joint) && joint < index::TIP_OF_DIGIT[digit]);
    match of_finger {
        Some(digit) if joint == index::FIRST_OF_DIGIT[digit] + 3 => Some(format!("{side:?} last {digit}")),
        Some(_) => webxr(side, joint + 1),
        None => webxr(side, joint).filter(|_| joint <= index::TIP_OF_DIGIT[0]),
    }
}

fn index_only(side: Handedness, joint: usize) -> Option<String> {
    webxr(side, joint).filter(|_| joint < index::FIRST_OF_DIGIT[2])
}

fn thumbless(side: Handedness, joint: usize) -> Option<String> {
    webxr(side, joint).filter(|_| !joints_of(0).contains(&joint))
}

/// Little fingers whose bones have other names.
fn spare(side: Handedness, joint: usize) -> Option<String> {
    let name = mixamo(side, joint)?;
    let is_little = joint >= index::FIRST_OF_DIGIT[4];
    Some(if is_little {
        format!("{side:?} spare {}", JOINT_NAMES[joint].len() + joint)
    } else {
        name
    })
}

/// Without the outer bones of the little fingers and the last ones of the thumbs.
fn broken(side: Handedness, joint: usize) -> Option<String> {
    let is_of_little = joint > index::FIRST_OF_DIGIT[4] + 1;
    mixamo(side, joint).filter(|_| !is_of_little && joint != 4)
}

fn swapped(side: Handedness, joint: usize) -> Option<String> {
    mixamo(side.other(), joint)
}

#[test]
fn bones_without_a_size_are_refused_by_their_names() {
    let (document, buffer) = opened(&Character::new(&Style::PLAIN).glb);
    let start = document["bufferViews"][4]["byteOffset"].as_u64().unwrap() as usize;
    let nodes = document["nodes"].as_array().unwrap();
    for number in [0.0, 1e-30, 1e30, f32::NAN] {
        let mut broken = buffer.clone();
        let mut expected = Vec::new();
        for name in ["Left-index-finger-phalanx-distal", "Right-thumb-tip"] {
            let node = nodes.iter().position(|node| node["name"] == name).unwrap();
            // The first column of the matrix that binds the skin.
            let column = start + 64 * node;
            for place in 0..3 {
                broken[column + 4 * place..][..4].copy_from_slice(&f32::to_le_bytes(number));
            }
            expected.push(format!(
                "node \"{name}\": has a scale that is zero, not finite or extreme"
            ));
        }
        assert_eq!(messages(read(&glb(&document, broken))), expected);
    }
}

#[test]
fn hands_that_cannot_hold_are_refused_with_the_place() {
    let fist = Style {
        bend: 1.3,
        ..Style::PLAIN
    };
    let giant = Style {
        size: 100.0,
        ..named(mixamo)
    };
    assert_mentioned(&messages(read_style(&giant)), &["m long, after units"]);
    let cases: [(Style, &[&str]); 7] = [
        (fist, &["hand, middle finger: is bent by 2", "hand open"]),
        (
            named(shifted),
            &["hand, index-finger-phalanx-proximal: is ", "bones in the palm"],
        ),
        (
            named(index_only),
            &["hand: lacks the middle finger, ring finger, little finger"],
        ),
        (named(thumbless), &["hand, thumb: is missing; without a thumb"]),
        (
            named(spare),
            &["hand, little finger: has no nodes with its names", "spare"],
        ),
        (named(broken), &["hand, pinky-finger-phalanx-distal: is missing"]),
        (
            named(swapped),
            &["hand: has fingers that bend backward", "swapped"],
        ),
    ];
    for (style, words) in cases {
        let texts = messages(read_style(&style));
        for side in ["left ", "right "] {
            assert_mentioned(&texts, &[&[side][..], words].concat());
        }
    }
    for (name, count) in [
        (index_only as Name, 2),
        (thumbless, 2),
        (spare, 2),
        (broken, 6),
        (swapped, 2),
    ] {
        let texts = messages(read(&model(name)));
        assert_eq!(texts.len(), count, "{texts:?}");
    }
}

#[test]
fn flesh_that_overlaps_at_rest_is_no_collision() {
    let mut rest = adult_at_rest(Handedness::Right);
    for joint in &mut rest.joints[index::FIRST_OF_DIGIT[1]..] {
        joint.radius *= 1.5;
    }
    let imported = rig_at_rest(&[rest], source(&[])).unwrap();
    for rig in [
        &imported.right.rig,
        &imported.left.rig,
        &imported.right.rig.scaled(1.4),
    ] {
        let stiff = Rig {
            rest_overlaps: None,
            ..rig.clone()
        };
        let mut pose = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: rig.stretched(),
        };
        let solids = HandSolids::of_pose(rig, &pose);
        assert!(self_clearance(&stiff, &solids) < 0.0, "they overlap");
        assert!((self_clearance(rig, &solids) - SOFT_CONTACT).abs() < 1e-6);
        // Fingers that cross go through each other all the same.
        pose.digits[1].base_yaw = 0.45;
        pose.digits[2].base_yaw = -0.45;
        assert!(self_clearance(rig, &HandSolids::of_pose(rig, &pose)) < -0.002);
    }
}

#[test]
fn widths_are_scaled_or_given() {
    let mut radii = [None; JOINT_COUNT];
    let tip = index::TIP_OF_DIGIT[1];
    radii[tip] = Some(0.0123);
    let glb = Character::new(&Style::PLAIN).glb;
    let plain = read(&glb).unwrap();
    let source = RigSource {
        width_scale: 0.8,
        radii,
        ..source(&[])
    };
    let narrow = read_rig(&glb, source, LIMITS).unwrap();
    for (own, measured) in [
        (&narrow.left.rig, &plain.left.rig),
        (&narrow.right.rig, &plain.right.rig),
    ] {
        for joint in 0..JOINT_COUNT {
            let expected = if joint == tip {
                0.0123
            } else {
                0.8 * measured.joint_radii[joint]
            };
            assert!((own.joint_radii[joint] - expected).abs() < 1e-6, "{joint}");
        }
        assert_eq!(own.digits[1].lengths, measured.digits[1].lengths);
    }
    let joints: HandJoints = adult_at_rest(Handedness::Right);
    let given = rig_at_rest(&[joints], source).unwrap().right.rig;
    assert!((given.joint_radii[tip] - 0.0123).abs() < 1e-6);
}

#[test]
fn two_files_make_one_rig_of_the_hands_that_they_show() {
    let of_side = |sides| {
        let style = Style {
            sides,
            ..named(mixamo)
        };
        read_style(&style).unwrap()
    };
    let (left, right) = (of_side(&[Handedness::Left]), of_side(&[Handedness::Right]));
    let both = right.clone().joined(left.clone()).unwrap();
    assert!(both.left.binding.is_some() && both.right.binding.is_some());
    assert!(!both.left.is_mirrored && !both.right.is_mirrored);
    assert_eq!(
        (both.left.rig, both.right.rig),
        (left.left.rig.clone(), right.right.rig.clone())
    );
    let same = right.clone().joined(right.clone()).unwrap_err();
    assert!(same.to_string().contains("same hand"), "{same}");
    let whole = read(&model(mixamo)).unwrap();
    let more = whole.joined(left).unwrap_err();
    assert!(more.to_string().contains("both hands"), "{more}");
}

#[test]
fn impossible_joints_at_rest_are_all_named() {
    let rest = adult_at_rest(Handedness::Right);
    let with = |change: &dyn Fn(&mut [Vec3; 26])| {
        let mut rest = rest.clone();
        let mut positions = rest.joints.map(|joint| joint.pose.position);
        change(&mut positions);
        for (joint, position) in rest.joints.iter_mut().zip(positions) {
            joint.pose.position = position;
        }
        messages(rig_at_rest(&[rest], source(&[])))
    };
    let found = with(&|joints| {
        joints[8] = joints[7];
        joints[14].x = f32::NAN;
        joints[20] = joints[19] + 0.45 * Vec3::Y;
    });
    assert_mentioned(&found, &["index-finger-phalanx-intermediate: is 0.0000 m"]);
    assert_mentioned(&found, &["middle-finger-phalanx-distal: is not at a finite"]);
    assert_mentioned(&found, &["ring-finger-tip: is 0.4500 m"]);
    let among = with(&|joints| {
        let across = joints[17] - joints[2];
        for joint in &mut joints[2..6] {
            *joint += 1.1 * across;
        }
    });
    assert_mentioned(&among, &["among the fingers"]);
    let line = with(&|joints| {
        for digit in 1..5 {
            joints[index::TIP_OF_DIGIT[digit] - 3] = 0.09 * Vec3::Y;
        }
    });
    assert_mentioned(&line, &["no breadth"]);
}

#[test]
fn models_without_a_hand_say_what_is_known() {
    let body = json!({ "asset": { "version": "2.0" }, "nodes": [{ "name": "Hips" }] });
    let found = messages(read(&glb(&body, Vec::new())));
    assert!(found.len() == 1 && found[0].contains("joint_map"), "{found:?}");
    let found = messages(read(b"solid"));
    assert!(found[0].contains("is no glTF"), "{found:?}");
}

#[test]
fn wrong_maps_are_refused_entry_by_entry() {
    let map = |node: &str, joint: &str, side| MappedJoint {
        node: node.to_owned(),
        side,
        joint: joint.to_owned(),
    };
    let map = [
        map("nowhere", "wrist", Some(Handedness::Left)),
        map("Hips", "elbow", Some(Handedness::Left)),
        map("Hips", "wrist", None),
    ];
    let found = messages(read_rig(&model(mixamo), source(&map), LIMITS));
    for (place, what) in ["does not have", "is no joint", "set its handedness"]
        .iter()
        .enumerate()
    {
        assert_mentioned(&found, &[&format!("joint_map[{place}]"), what]);
    }
}

#[test]
fn damaged_models_never_panic() {
    let glb = model(mixamo);
    // Bytes of the text and of the buffer's matrices, at the end.
    for place in (0..4000)
        .step_by(137)
        .chain((glb.len() - 4000..glb.len()).step_by(211))
    {
        let mut damaged = glb.clone();
        damaged[place] ^= 0x5a;
        let _ = read(&damaged);
    }
}
