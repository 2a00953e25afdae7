//! Files, read by another implementation.

use std::collections::HashMap;

use glam::{Affine3A, Vec4};
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
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|_| blob.as_deref());
        let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
        let normals: Vec<Vec3> = reader.read_normals().unwrap().map(Vec3::from).collect();
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        let corners = part.triangles.iter().flat_map(|&triangle| part.corners(triangle));
        let corners: Vec<Vec3> = corners.collect();
        let read: Vec<Vec3> = indices.iter().map(|&i| positions[i as usize]).collect();
        assert_eq!(read, corners);
        assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
        for (triangle, face) in indices.chunks(3).zip(corners.chunks(3)) {
            let face = (face[1] - face[0]).cross(face[2] - face[0]);
            assert!(triangle.iter().all(|&i| normals[i as usize].dot(face) > 0.0));
        }
        let [low, high] = [Vec3::min, Vec3::max].map(|bound| corners.iter().copied().reduce(bound).unwrap());
        let bounds = primitive.bounding_box();
        assert_eq!((bounds.min, bounds.max), (low.to_array(), high.to_array()));
        let base = primitive.material().pbr_metallic_roughness().base_color_factor();
        let Some(colours) = reader.read_colors(0) else {
            assert_eq!(base, part.colour.extend(1.0).to_array());
            continue;
        };
        assert_eq!(base, [1.0; 4]);
        for (colour, position) in colours.into_rgb_f32().zip(&positions) {
            assert_eq!(Vec3::from(colour), position.abs().min(Vec3::ONE));
        }
    }
    let root: Value = serde_json::from_slice(&Glb::from_slice(&bytes).unwrap().json).unwrap();
    assert_eq!(root["nodes"][0]["extras"], json!({"force_n": 2.5}));
    // The specification forbids empty arrays.
    let nothing = gltf::Gltf::from_slice(&to_glb(&[])).expect("a valid file");
    assert_eq!((nothing.document.nodes().count(), nothing.blob), (0, None));
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

/// A file with its animation.
struct Played {
    document: gltf::Document,
    blob: Vec<u8>,
    times: Vec<f32>,
    /// A node's own translation, rotation or scale at each moment.
    tracks: HashMap<(usize, &'static str), Vec<Vec4>>,
}

impl Played {
    fn of(bytes: &[u8]) -> Self {
        let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(bytes).expect("a valid file");
        let blob = blob.expect("data");
        let mut times = Vec::new();
        let mut tracks = HashMap::new();
        for channel in document.animations().next().expect("an animation").channels() {
            let reader = channel.reader(|_| Some(&blob));
            times = reader.read_inputs().expect("times").collect();
            let of_vectors = |all: &mut dyn Iterator<Item = [f32; 3]>| -> Vec<Vec4> {
                all.map(|vector| Vec3::from(vector).extend(0.0)).collect()
            };
            let (path, values) = match reader.read_outputs().expect("outputs") {
                ReadOutputs::Translations(mut all) => ("translation", of_vectors(&mut all)),
                ReadOutputs::Rotations(all) => ("rotation", all.into_f32().map(Vec4::from).collect()),
                ReadOutputs::Scales(mut all) => ("scale", of_vectors(&mut all)),
                ReadOutputs::MorphTargetWeights(_) => panic!("nothing morphs"),
            };
            tracks.insert((channel.target().node().index(), path), values);
        }
        Self {
            document,
            blob,
            times,
            tracks,
        }
    }

    fn node(&self, name: &str) -> gltf::Node<'_> {
        let found = self.document.nodes().find(|node| node.name() == Some(name));
        found.unwrap_or_else(|| panic!("no node is named {name}"))
    }

    /// A node's transform in the scene at a moment.
    fn world(&self, node: &gltf::Node<'_>, moment: usize) -> Affine3A {
        let (translation, rotation, scale) = node.transform().decomposed();
        let at = |path, still: Vec4| {
            let track = self.tracks.get(&(node.index(), path));
            track.map_or(still, |all| all[moment])
        };
        let own = Affine3A::from_scale_rotation_translation(
            at("scale", Vec3::from(scale).extend(0.0)).truncate(),
            Quat::from_vec4(at("rotation", rotation.into())),
            at("translation", Vec3::from(translation).extend(0.0)).truncate(),
        );
        let is_child = |child: gltf::Node<'_>| child.index() == node.index();
        let parent = self
            .document
            .nodes()
            .find(|parent| parent.children().any(is_child));
        parent.map_or(own, |parent| self.world(&parent, moment) * own)
    }

    /// The corners of the triangles of a node's mesh at a moment.
    fn corners(&self, name: &str, moment: usize) -> Vec<Vec3> {
        let node = self.node(name);
        let primitive = node.mesh().expect("a mesh").primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&self.blob));
        let positions = reader.read_positions().expect("positions").map(Vec3::from);
        let placed: Vec<Vec3> = if let Some(skin) = node.skin() {
            let inverse_bind = skin.reader(|_| Some(&self.blob)).read_inverse_bind_matrices();
            let joints = skin.joints().zip(inverse_bind.expect("matrices"));
            let matrices = joints.map(|(joint, inverse)| {
                Mat4::from(self.world(&joint, moment)) * Mat4::from_cols_array_2d(&inverse)
            });
            let matrices: Vec<Mat4> = matrices.collect();
            let joints = reader.read_joints(0).expect("joints").into_u16();
            let weights = reader.read_weights(0).expect("weights").into_f32();
            let moved = positions.zip(joints.zip(weights)).map(|(p, (joints, weights))| {
                let moved = |i: usize| weights[i] * matrices[usize::from(joints[i])].transform_point3(p);
                (0..4).map(moved).sum()
            });
            moved.collect()
        } else {
            let world = self.world(&node, moment);
            positions.map(|p| world.transform_point3(p)).collect()
        };
        let indices = reader.read_indices().expect("indices").into_u32();
        indices.map(|index| placed[index as usize]).collect()
    }
}

const MOMENTS: usize = 4;

/// A rod that tumbles, a giver who bends the fingers, and a receiver of another size who is absent for a moment.
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
fn an_absent_hand_has_no_size() {
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
    for ((_, path), values) in &played.tracks {
        if *path == "rotation" {
            assert!(values.iter().all(|rotation| rotation.is_normalized()));
            assert!(values.windows(2).all(|pair| pair[0].dot(pair[1]) >= 0.0));
        }
    }
    let animation = played.document.animations().next().expect("an animation");
    for channel in animation.channels() {
        let output = channel.sampler().output();
        assert_eq!(output.count(), MOMENTS);
        let is_size = channel.target().property() == Property::Scale;
        assert!(is_size || channel.sampler().interpolation() == Interpolation::Linear);
    }
}
