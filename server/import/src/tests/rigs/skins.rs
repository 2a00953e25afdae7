//! What is measured of a rig's skin, and how posed nodes move it.

use crate::{
    ImportedHand, RigSource, read_rig, rig_at_rest,
    tests::{
        LIMITS,
        rigs::{adult, adult_at_rest, differences, edited, model, named, opened, read, source},
    },
};
use glam::{Mat4, Quat, Vec3};
use gltf::{Document, scene::Transform};
use grasp_assets::hands::{glb, hand};
use grasp_characters::{Character, Style, names::mixamo};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{DigitAngles, HandPose, Handedness, joints::HandJoints, kinematics::hand_frames},
};
use serde_json::{Value, json};

/// A block of floats of a GLB.
fn floats(document: &Value, buffer: &[u8], accessor: usize) -> Vec<f32> {
    let view =
        &document["bufferViews"][document["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize];
    let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
    buffer[start..start + length]
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect()
}

/// Adds a block of floats with the type of another accessor, and gives its accessor.
fn added(document: &mut Value, buffer: &mut Vec<u8>, like: usize, numbers: &[f32]) -> usize {
    let view = document["bufferViews"].as_array().unwrap().len();
    let start = buffer.len();
    buffer.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    let length = buffer.len() - start;
    document["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
    document["buffers"][0]["byteLength"] = json!(buffer.len());
    let mut accessor = document["accessors"][like].clone();
    accessor["bufferView"] = json!(view);
    let accessors = document["accessors"].as_array_mut().unwrap();
    accessors.push(accessor);
    accessors.len() - 1
}

/// The character in two skins: the first one is of all that does not follow thumbs, the second, which is bound elsewhere and in
/// other units, of thumbs.
fn in_two_skins(glb: &[u8]) -> Vec<u8> {
    let (mut document, mut buffer) = opened(glb);
    let elsewhere = Mat4::from_scale_rotation_translation(
        Vec3::splat(40.0),
        glam::Quat::from_rotation_x(1.1),
        Vec3::new(3.0, -2.0, 7.0),
    );
    let positions = floats(&document, &buffer, 0);
    let weights = floats(&document, &buffer, 2);
    let binds = floats(&document, &buffer, 4);
    let joints_at = document["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize;
    let is_thumb = |joint: usize| {
        document["nodes"][joint]["name"]
            .as_str()
            .unwrap()
            .contains("Thumb")
    };
    let most = |vertex: usize| {
        let place = (0..4)
            .max_by(|&a, &b| weights[4 * vertex + a].total_cmp(&weights[4 * vertex + b]))
            .unwrap();
        let at = joints_at + 8 * vertex + 2 * place;
        usize::from(u16::from_le_bytes([buffer[at], buffer[at + 1]]))
    };
    let of_thumbs: Vec<bool> = (0..weights.len() / 4)
        .map(|vertex| is_thumb(most(vertex)))
        .collect();
    assert!(of_thumbs.contains(&true));
    let kept = |thumbs: bool| -> Vec<f32> {
        let kept = weights.iter().enumerate();
        kept.map(|(place, &weight)| {
            if of_thumbs[place / 4] == thumbs {
                weight
            } else {
                0.0
            }
        })
        .collect()
    };
    let moved: Vec<f32> = positions
        .chunks(3)
        .flat_map(|position| elsewhere.transform_point3(Vec3::from_slice(position)).to_array())
        .collect();
    let moved_binds: Vec<f32> = binds
        .chunks(16)
        .flat_map(|bind| (Mat4::from_cols_slice(bind) * elsewhere.inverse()).to_cols_array())
        .collect();
    let [rest, thumbs] = [kept(false), kept(true)];
    let rest = added(&mut document, &mut buffer, 2, &rest);
    let thumbs = added(&mut document, &mut buffer, 2, &thumbs);
    let moved = added(&mut document, &mut buffer, 0, &moved);
    let binds = added(&mut document, &mut buffer, 4, &moved_binds);
    document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(rest);
    let mut mesh = document["meshes"][0].clone();
    mesh["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(thumbs);
    mesh["primitives"][0]["attributes"]["POSITION"] = json!(moved);
    document["meshes"].as_array_mut().unwrap().push(mesh);
    // The one of the thumbs comes first in the file, though it moves fewer vertices.
    let mut skin = document["skins"][0].clone();
    skin["inverseBindMatrices"] = json!(binds);
    document["skins"].as_array_mut().unwrap().insert(0, skin);
    let nodes = document["nodes"].as_array_mut().unwrap();
    nodes.last_mut().unwrap()["skin"] = json!(1);
    nodes.push(json!({ "name": "Thumbs", "mesh": 1, "skin": 0 }));
    let last = nodes.len() - 1;
    document["scenes"][0]["nodes"]
        .as_array_mut()
        .unwrap()
        .push(json!(last));
    grasp_characters::glb(&document, buffer)
}

#[test]
fn each_skin_is_bound_by_its_own_matrices() {
    let glb = Character::new(&Style {
        units_per_metre: 100.0,
        ..named(mixamo)
    })
    .glb;
    let whole = read(&glb).unwrap();
    let split = read(&in_two_skins(&glb)).unwrap();
    for (own, expected) in [
        (&split.left.rig, &whole.left.rig),
        (&split.right.rig, &whole.right.rig),
    ] {
        differences(own, expected).assert_below([1e-4, 1e-3, 1e-2], "split");
    }
}

#[test]
fn a_skin_that_nothing_shows_binds_nothing() {
    let glb = model(mixamo);
    let whole = read(&glb).unwrap();
    let odd = edited(&glb, |document| {
        let mut skin = document["skins"][0].clone();
        // All bones at the mesh's origin.
        skin.as_object_mut().unwrap().remove("inverseBindMatrices");
        document["skins"].as_array_mut().unwrap().insert(0, skin);
        document["nodes"].as_array_mut().unwrap().last_mut().unwrap()["skin"] = json!(1);
    });
    assert_eq!(read(&odd).unwrap().right.rig, whole.right.rig);
}

#[test]
fn built_in_hands_give_back_their_rigs() {
    for side in [Handedness::Left, Handedness::Right] {
        let file = glb("adult", side).expect("the rig is built in");
        let source = RigSource {
            side: Some(side),
            ..source(&[])
        };
        let rig = read_rig(file, source, LIMITS).unwrap();
        let hands = [(&rig.left, Handedness::Left), (&rig.right, Handedness::Right)];
        for (hand, its_side) in hands {
            assert_eq!(hand.rig.handedness, its_side);
            assert_eq!(
                (hand.is_mirrored, hand.binding.is_none()),
                (its_side != side, its_side != side)
            );
            differences(&hand.rig, adult(its_side)).assert_below([5e-4, 1e-3, 0.2], "adult");
        }
    }
}

#[test]
fn size_follows_the_hand() {
    for size in [0.5, 1.0, 1.6] {
        let read = read(&Character::new(&Style { size, ..Style::PLAIN }).glb).unwrap();
        for hand in [&read.left, &read.right] {
            let adult = adult(hand.rig.handedness);
            assert!((hand.rig.reach / adult.reach / size - 1.0).abs() < 2e-3);
            for (own, other) in hand.rig.joint_radii.iter().zip(adult.joint_radii) {
                assert!(
                    (own / other / size - 1.0).abs() < 0.2,
                    "{own} for {}",
                    other * size
                );
            }
        }
    }
}

#[test]
fn joints_at_rest_give_the_rig_that_they_are_of() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = rig_at_rest(&[adult_at_rest(side)], source(&[])).unwrap();
        for hand in [&rig.left, &rig.right] {
            differences(&hand.rig, adult(hand.rig.handedness)).assert_below([1e-5, 1e-3, 0.02], "at rest");
            assert_eq!(hand.is_mirrored, hand.rig.handedness != side);
        }
    }
}

/// Where a viewer draws the vertices of a GLB's only skin with changed nodes, in its scene.
fn drawn(glb: &[u8], change: impl Fn(&str, Mat4) -> Mat4) -> Vec<(Vec3, Vec<u16>)> {
    let file = gltf::Gltf::from_slice(glb).unwrap();
    let blob = file.blob.as_deref();
    let skin = file.skins().next().unwrap();
    let inverse_binds = skin.reader(|_| blob).read_inverse_bind_matrices().unwrap();
    let matrices: Vec<Mat4> = skin
        .joints()
        .zip(inverse_binds)
        .map(|(joint, inverse)| {
            global(&file.document, joint.index(), &change) * Mat4::from_cols_array_2d(&inverse)
        })
        .collect();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|_| blob);
    let joints = reader.read_joints(0).unwrap().into_u16();
    let weights = reader.read_weights(0).unwrap().into_f32();
    let skinning = joints.zip(weights);
    let vertices = reader.read_positions().unwrap().zip(skinning);
    vertices
        .map(|(position, (joints, weights))| {
            let position = Vec3::from(position);
            let moved = joints.iter().zip(weights);
            let moved = moved
                .map(|(&joint, weight)| weight * matrices[usize::from(joint)].transform_point3(position));
            (moved.sum(), joints.to_vec())
        })
        .collect()
}

fn global(document: &Document, node: usize, change: &impl Fn(&str, Mat4) -> Mat4) -> Mat4 {
    let node = document.nodes().nth(node).unwrap();
    let local = match node.transform() {
        Transform::Matrix { matrix } => Mat4::from_cols_array_2d(&matrix),
        Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => Mat4::from_scale_rotation_translation(
            Vec3::from(scale),
            Quat::from_array(rotation),
            Vec3::from(translation),
        ),
    };
    let parent = document
        .nodes()
        .find(|parent| parent.children().any(|child| child.index() == node.index()));
    let above = parent.map_or(Mat4::IDENTITY, |parent| global(document, parent.index(), change));
    above * change(node.name().unwrap_or_default(), local)
}

fn gripping(hand: &ImportedHand) -> HandPose {
    let mut digits = [DigitAngles::coupled(0.1, 0.7, 0.8); 5];
    digits[0] = DigitAngles {
        base_yaw: 0.6,
        base_pitch: -0.1,
        second_pitch: 0.4,
        third_pitch: 0.5,
    };
    let side = if hand.rig.handedness == Handedness::Left {
        1.0
    } else {
        -1.0
    };
    HandPose {
        frame_from_wrist: Pose::new(
            Vec3::new(0.3 * side, 0.9, 0.2),
            Quat::from_rotation_x(0.8) * Quat::from_rotation_y(2.0 * side),
        ),
        digits,
    }
}

#[test]
fn posed_nodes_draw_the_skin_where_the_rig_has_it() {
    for (what, style) in [
        ("plain", Style::PLAIN),
        (
            "flat",
            Style {
                is_flat: true,
                ..Style::PLAIN
            },
        ),
        (
            "centimetres",
            Style {
                units_per_metre: 100.0,
                ..Style::PLAIN
            },
        ),
        (
            "mixamo",
            Style {
                units_per_metre: 100.0,
                ..named(mixamo)
            },
        ),
    ] {
        let glb = Character::new(&style).glb;
        let imported = read(&glb).unwrap();
        for hand in [&imported.left, &imported.right] {
            let binding = hand.binding.as_ref().unwrap();
            let pose = gripping(hand);
            let frames = hand_frames(&hand.rig, &pose);
            let root = binding.frame_from_root(&frames, 1.0);
            let nodes: Vec<_> = binding.posed(&frames, 1.0).collect();
            assert!(nodes.len() >= 19, "{what}: {}", nodes.len());
            if what == "plain" || what == "mixamo" {
                assert!(
                    nodes.iter().all(|node| node.translation.is_none()),
                    "{what}: {nodes:?}"
                );
            }
            // The armature's own scale remains; the root is put where the answer says.
            let drawn = drawn(&glb, |name, local| {
                let (scale, rotation, translation) = local.to_scale_rotation_translation();
                match nodes.iter().find(|node| node.name == name) {
                    Some(node) => Mat4::from_scale_rotation_translation(
                        scale,
                        node.rotation,
                        node.translation.unwrap_or(translation),
                    ),
                    None if name == binding.root() => {
                        Mat4::from_scale_rotation_translation(scale, rotation, translation)
                    }
                    None => local,
                }
            });
            // Everything is drawn relative to where the root is in the unchanged scene.
            let scene_from_root = {
                let file = gltf::Gltf::from_slice(&glb).unwrap();
                let node = file
                    .nodes()
                    .find(|node| node.name() == Some(binding.root()))
                    .unwrap()
                    .index();
                let (_, rotation, position) = global(&file.document, node, &|_: &str, local: Mat4| local)
                    .to_scale_rotation_translation();
                Pose::new(position, rotation)
            };
            let frame_from_scene = root * scene_from_root.inverse();
            let adult = hand_of(hand.rig.handedness);
            let expected = adult.skin.posed(&HandJoints::of_pose(&hand.rig, &pose));
            let first = match hand.rig.handedness {
                Handedness::Left => 8,
                Handedness::Right => 8 + expected.len(),
            };
            let mut distances: Vec<f32> = drawn[first..][..expected.len()]
                .iter()
                .zip(&expected)
                .map(|((drawn, _), expected)| frame_from_scene.transform_point(*drawn).distance(*expected))
                .collect();
            distances.sort_by(f32::total_cmp);
            let (median, most) = (distances[distances.len() / 2], distances[distances.len() - 1]);
            assert!(
                median < 3e-4 && most < 2.5e-3,
                "{what} {:?}: {median} {most}",
                hand.rig.handedness
            );
        }
    }
}

fn hand_of(side: Handedness) -> &'static grasp_assets::hands::Hand {
    hand("adult", side).expect("the rig is built in")
}
