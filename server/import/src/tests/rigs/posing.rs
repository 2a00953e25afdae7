//! The posed nodes of a model move its skin like the rig.

use crate::ImportedHand;
use glam::{Mat4, Quat, Vec3};
use gltf::{Document, scene::Transform};
use grasp_assets::hands::hand;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{DigitAngles, HandPose, Handedness, joints::HandJoints, kinematics::hand_frames},
};

use grasp_characters::{Character, Style, names::mixamo};

use crate::tests::rigs::read;

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
                name: mixamo,
                units_per_metre: 100.0,
                ..Style::PLAIN
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
