//! Files, read by another implementation.

use std::collections::HashMap;

use glam::Affine3A;
use gltf::animation::{Interpolation, Property, util::ReadOutputs};
use grasp_assets::hands::hand;
use grasp_synthesis::{
    geometry::tapered_capsule::TaperedCapsule,
    model::hand::{DigitAngles, HandPose, Handedness},
};

use super::*;
use crate::parts::{arrow, capsule, linear_from_srgb, sphere};

fn sample() -> Vec<Part> {
    let red = linear_from_srgb(200, 30, 20);
    let mut ball = sphere("ball", Vec3::new(0.1, 0.2, 0.3), 0.05, red);
    ball.extras = Some(json!({"force_n": 2.5}));
    let mut arrow = arrow("arrow", Vec3::ZERO, Vec3::Y, 0.1, red);
    arrow.vertex_colours = arrow.positions.iter().map(|p| p.abs().min(Vec3::ONE)).collect();
    let empty = Part::new("empty", vec![Vec3::ZERO], Vec::new(), red);
    vec![ball, empty, arrow]
}

#[test]
fn preserves_parts() {
    let scene = sample();
    let bytes = to_glb(&scene);
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(&bytes).expect("a valid file");
    let nodes: Vec<_> = document.default_scene().expect("a scene").nodes().collect();
    let parts: Vec<_> = scene.iter().filter(|p| !p.triangles.is_empty()).collect();
    assert_eq!(nodes.len(), parts.len());
    for (node, part) in nodes.iter().zip(parts) {
        assert_eq!(node.name(), Some(part.name.as_str()));
        let mesh = node.mesh().expect("a mesh");
        let primitive = mesh.primitives().next().expect("a primitive");
        let reader = primitive.reader(|_| blob.as_deref());
        let read = reader.read_positions().expect("positions").map(Vec3::from);
        let positions: Vec<Vec3> = read.collect();
        let normals: Vec<Vec3> = reader.read_normals().expect("normals").map(Vec3::from).collect();
        let indices: Vec<u32> = reader.read_indices().expect("indices").into_u32().collect();
        let corners: Vec<Vec3> = part
            .triangles
            .iter()
            .flat_map(|&triangle| part.corners(triangle))
            .collect();
        let read: Vec<Vec3> = indices.iter().map(|&i| positions[i as usize]).collect();
        assert_eq!(read, corners);
        assert_eq!(normals.len(), positions.len());
        assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
        for (triangle, face) in indices.chunks(3).zip(corners.chunks(3)) {
            let face = (face[1] - face[0]).cross(face[2] - face[0]);
            assert!(triangle.iter().all(|&i| normals[i as usize].dot(face) > 0.0));
        }
        let (low, high) = (
            corners.iter().copied().reduce(Vec3::min),
            corners.iter().copied().reduce(Vec3::max),
        );
        let bounds = primitive.bounding_box();
        assert_eq!((Some(bounds.min.into()), Some(bounds.max.into())), (low, high));

        let base = primitive.material().pbr_metallic_roughness().base_color_factor();
        match reader.read_colors(0) {
            None => assert_eq!(base, part.colour.extend(1.0).to_array()),
            Some(colours) => {
                assert_eq!(base, [1.0; 4]);
                for (colour, position) in colours.into_rgb_f32().zip(&positions) {
                    assert_eq!(Vec3::from(colour), position.abs().min(Vec3::ONE));
                }
            }
        }
    }
    let json_length = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let root: Value = serde_json::from_slice(&bytes[20..20 + json_length]).expect("JSON");
    assert_eq!(root["nodes"][0]["extras"], json!({"force_n": 2.5}));
}

#[test]
fn nothing_is_a_valid_file() {
    let nothing = MovingHandover {
        times: Vec::new(),
        client_from_object: Vec::new(),
        ..handover()
    };
    for bytes in [to_glb(&[]), to_moving_glb(&nothing)] {
        let file = gltf::Gltf::from_slice(&bytes).expect("a valid file");
        assert_eq!((file.document.nodes().count(), file.blob), (0, None));
    }
}

#[test]
fn shares_smooth_vertices_and_splits_sharp_ones() {
    let ball = sphere("ball", Vec3::ZERO, 1.0, Vec3::ONE);
    assert_eq!(Vertices::of(&ball).sources.len(), ball.positions.len());
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let tetrahedron = Part::new("sharp", corners.to_vec(), triangles, Vec3::ONE);
    assert_eq!(Vertices::of(&tetrahedron).sources.len(), 12);
}

/// A node's own transform at each moment.
#[derive(Default)]
struct Track {
    translation: Option<Vec<Vec3>>,
    rotation: Option<Vec<Quat>>,
    scale: Option<Vec<Vec3>>,
}

/// A file with what moves.
struct Played {
    document: gltf::Document,
    blob: Vec<u8>,
    times: Vec<f32>,
    tracks: HashMap<usize, Track>,
    parents: HashMap<usize, usize>,
}

impl Played {
    fn of(bytes: &[u8]) -> Self {
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes).expect("a valid file");
        let blob = blob.expect("data");
        let mut times = Vec::new();
        let mut tracks: HashMap<usize, Track> = HashMap::new();
        let animation = document.animations().next().expect("an animation");
        for channel in animation.channels() {
            let reader = channel.reader(|_| Some(&blob));
            times = reader.read_inputs().expect("times").collect();
            let target = channel.target();
            let track = tracks.entry(target.node().index()).or_default();
            match reader.read_outputs().expect("outputs") {
                ReadOutputs::Translations(all) => track.translation = Some(all.map(Vec3::from).collect()),
                ReadOutputs::Rotations(all) => {
                    track.rotation = Some(all.into_f32().map(Quat::from_array).collect());
                }
                ReadOutputs::Scales(all) => track.scale = Some(all.map(Vec3::from).collect()),
                ReadOutputs::MorphTargetWeights(_) => panic!("nothing morphs"),
            }
        }
        let children = |node: gltf::Node<'_>| {
            let index = node.index();
            node.children()
                .map(move |child| (child.index(), index))
                .collect::<Vec<_>>()
        };
        let parents = document.nodes().flat_map(children).collect();
        Self {
            document,
            blob,
            times,
            tracks,
            parents,
        }
    }

    fn node(&self, name: &str) -> gltf::Node<'_> {
        let found = self.document.nodes().find(|node| node.name() == Some(name));
        found.unwrap_or_else(|| panic!("no node is named {name}"))
    }

    /// A node's transform in the scene at a moment.
    fn world(&self, node: usize, moment: usize) -> Affine3A {
        let (translation, rotation, scale) = self
            .document
            .nodes()
            .nth(node)
            .expect("a node")
            .transform()
            .decomposed();
        let track = self.tracks.get(&node);
        let at = |all: Option<&Vec<Vec3>>, still: [f32; 3]| all.map_or(Vec3::from(still), |all| all[moment]);
        let rotations = track.and_then(|track| track.rotation.as_ref());
        let own = Affine3A::from_scale_rotation_translation(
            at(track.and_then(|track| track.scale.as_ref()), scale),
            rotations.map_or(Quat::from_array(rotation), |all| all[moment]),
            at(track.and_then(|track| track.translation.as_ref()), translation),
        );
        self.parents
            .get(&node)
            .map_or(own, |&parent| self.world(parent, moment) * own)
    }

    /// The corners of the triangles of a node's mesh at a moment.
    fn corners(&self, name: &str, moment: usize) -> Vec<Vec3> {
        let node = self.node(name);
        let primitive = node
            .mesh()
            .expect("a mesh")
            .primitives()
            .next()
            .expect("a primitive");
        let reader = primitive.reader(|_| Some(&self.blob));
        let positions = reader.read_positions().expect("positions").map(Vec3::from);
        let placed: Vec<Vec3> = match node.skin() {
            None => {
                let world = self.world(node.index(), moment);
                positions.map(|p| world.transform_point3(p)).collect()
            }
            Some(skin) => {
                let inverse_bind = skin.reader(|_| Some(&self.blob)).read_inverse_bind_matrices();
                let matrices: Vec<Mat4> = skin
                    .joints()
                    .zip(inverse_bind.expect("matrices"))
                    .map(|(joint, inverse)| {
                        Mat4::from(self.world(joint.index(), moment)) * Mat4::from_cols_array_2d(&inverse)
                    })
                    .collect();
                let joints = reader.read_joints(0).expect("joints").into_u16();
                let weights = reader.read_weights(0).expect("weights").into_f32();
                positions
                    .zip(joints.zip(weights))
                    .map(|(p, (joints, weights))| {
                        let moved = joints
                            .into_iter()
                            .zip(weights)
                            .map(|(joint, weight)| weight * matrices[usize::from(joint)].transform_point3(p));
                        moved.sum()
                    })
                    .collect()
            }
        };
        let indices = reader.read_indices().expect("indices").into_u32();
        indices.map(|index| placed[index as usize]).collect()
    }
}

const MOMENTS: usize = 4;

/// A rod that tumbles, a giver who bends the fingers, and a receiver of another size who is gone for a moment.
fn handover() -> MovingHandover {
    let rod = TaperedCapsule::new(Vec3::NEG_X * 0.1, Vec3::X * 0.1, 0.012, 0.012);
    let place = |moment: usize| {
        // Past half a turn, where quaternions change sign.
        let turn = Quat::from_rotation_y(1.9 * moment as f32) * Quat::from_rotation_z(0.3);
        Pose::new(Vec3::new(0.1 * moment as f32, 0.2, -0.3), turn)
    };
    let posed = |rig: &str, handedness, scale: f32, moment: usize| {
        let hand = hand(rig, handedness).expect("a built-in hand");
        let bent = |digit: DigitAngles| DigitAngles {
            base_pitch: digit.base_pitch + 0.2 * moment as f32,
            second_pitch: digit.second_pitch + 0.3 * moment as f32,
            ..digit
        };
        let pose = HandPose {
            frame_from_wrist: place(moment) * Pose::from_position(Vec3::new(0.0, 0.0, 0.08)),
            digits: hand.rig.stretched().map(bent),
        };
        HandJoints::of_pose(&hand.rig.scaled(scale), &pose)
    };
    let skin = |rig: &str, handedness| &*hand(rig, handedness).expect("a built-in hand").skin;
    let giver = (0..MOMENTS).map(|moment| Some(posed("thesis", Handedness::Right, 1.0, moment)));
    let receiver = (0..MOMENTS).map(|moment| {
        let scale = 0.9 + 0.05 * moment as f32;
        (moment != 2).then(|| posed("adult", Handedness::Left, scale, moment))
    });
    MovingHandover {
        object: capsule("object", &rod, Vec3::ONE),
        times: (0..MOMENTS).map(|moment| 0.25 * moment as f32).collect(),
        client_from_object: (0..MOMENTS).map(place).collect(),
        hands: vec![
            MovingHand {
                name: "giver".into(),
                person: Person::Giver,
                skin: skin("thesis", Handedness::Right),
                joints: giver.collect(),
            },
            MovingHand {
                name: "receiver".into(),
                person: Person::Receiver,
                skin: skin("adult", Handedness::Left),
                joints: receiver.collect(),
            },
        ],
    }
}

#[test]
fn animation_shows_object_and_skins_of_every_moment() {
    let handover = handover();
    let played = Played::of(&to_moving_glb(&handover));
    assert_eq!(played.times, handover.times);
    let assert_same = |name: &str, moment: usize, triangles: &[[u32; 3]], positions: &[Vec3]| {
        let found = played.corners(name, moment);
        assert_eq!(found.len(), 3 * triangles.len());
        for (found, &vertex) in found.iter().zip(triangles.as_flattened()) {
            let distance = found.distance(positions[vertex as usize]);
            assert!(distance < 2e-5, "{name} at {moment}: {distance} m off");
        }
    };
    for moment in 0..MOMENTS {
        let object = &handover.object;
        let place = |p: &Vec3| handover.client_from_object[moment].transform_point(*p);
        let placed: Vec<Vec3> = object.positions.iter().map(place).collect();
        assert_same("object", moment, &object.triangles, &placed);
        for hand in &handover.hands {
            if let Some(joints) = &hand.joints[moment] {
                let name = format!("{}_hand", hand.name);
                assert_same(&name, moment, &hand.skin.triangles, &hand.skin.posed(joints));
            }
        }
    }
}

#[test]
fn a_hand_that_is_not_there_has_no_size() {
    let handover = handover();
    let played = Played::of(&to_moving_glb(&handover));
    let animation = played.document.animations().next().expect("an animation");
    let root = played.node("receiver").index();
    let sampler = animation
        .channels()
        .find(|channel| channel.target().node().index() == root)
        .expect("the hand comes and goes")
        .sampler();
    assert_eq!(sampler.interpolation(), Interpolation::Step);
    for part in ["receiver_hand", "receiver_sleeve"] {
        let size = |moment| {
            let corners = played.corners(part, moment);
            let farthest = corners.iter().map(|corner| corner.distance(corners[0]));
            farthest.fold(0.0, f32::max)
        };
        assert_eq!(size(2), 0.0);
        assert!(size(1) > 0.01 && size(3) > 0.01);
    }
}

#[test]
fn rotations_take_the_short_way_and_channels_have_every_moment() {
    let handover = handover();
    let played = Played::of(&to_moving_glb(&handover));
    for track in played.tracks.values() {
        let rotations = track.rotation.as_deref().unwrap_or_default();
        assert!(rotations.iter().all(|rotation| rotation.is_normalized()));
        assert!(rotations.windows(2).all(|pair| pair[0].dot(pair[1]) >= 0.0));
    }
    let animation = played.document.animations().next().expect("an animation");
    for channel in animation.channels() {
        let output = channel.sampler().output();
        assert_eq!(output.count(), MOMENTS);
        let is_size = channel.target().property() == Property::Scale;
        assert!(is_size || channel.sampler().interpolation() == Interpolation::Linear);
    }
}
