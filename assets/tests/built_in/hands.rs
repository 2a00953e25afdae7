//! The built-in hands: their files, rigs and skins.

use std::collections::BTreeMap;

use glam::{Mat4, Quat, Vec3};
use grasp_assets::hands::{Hand, RIG_NAMES, glb, hand};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        HandPose, Handedness,
        joints::{JOINT_NAMES, Skin, index, thesis_from_openxr_frame},
        kinematics::hand_frames,
    },
};

/// All built-in hands.
fn all() -> impl Iterator<Item = &'static Hand> {
    RIG_NAMES
        .into_iter()
        .flat_map(|rig| [Handedness::Left, Handedness::Right].map(|side| built_in(rig, side)))
}

fn built_in(rig: &str, handedness: Handedness) -> &'static Hand {
    hand(rig, handedness).expect("the rig is built in")
}

/// A built-in hand's GLB file.
fn file_of(hand: &Hand) -> &'static [u8] {
    glb(&hand.rig.name, hand.rig.handedness).expect("the rig is built in")
}

/// The transform from a node to the scene.
fn global(document: &gltf::Document, node: usize) -> Mat4 {
    let parent = document
        .nodes()
        .find(|candidate| candidate.children().any(|child| child.index() == node));
    let found = document.nodes().nth(node).expect("the node is there");
    let (translation, rotation, scale) = found.transform().decomposed();
    let local = Mat4::from_scale_rotation_translation(
        Vec3::from(scale),
        Quat::from_array(rotation),
        Vec3::from(translation),
    );
    parent.map_or(Mat4::IDENTITY, |parent| global(document, parent.index())) * local
}

#[test]
fn skeletons_have_the_webxr_joints_in_their_bind_pose() {
    for hand in all() {
        let file = gltf::Gltf::from_slice(file_of(hand)).expect("it is a GLB file");
        let skin = file.skins().next().expect("it has a skin");
        let names: Vec<_> = skin
            .joints()
            .map(|joint| joint.name().unwrap_or("").to_owned())
            .collect();
        assert_eq!(names, JOINT_NAMES[1..], "WebXR's 25 joints in their order");
        let inverse_binds: Vec<Mat4> = skin
            .reader(|_| file.blob.as_deref())
            .read_inverse_bind_matrices()
            .expect("it has inverse bind matrices")
            .map(|m| Mat4::from_cols_array_2d(&m))
            .collect();
        for (joint, inverse_bind) in skin.joints().zip(inverse_binds) {
            let product = global(&file.document, joint.index()) * inverse_bind;
            assert!(
                product.abs_diff_eq(Mat4::IDENTITY, 1e-5),
                "the node is not in the bind pose: {:?}",
                joint.name()
            );
        }
    }
}

#[test]
fn thesis_limits_match_table_4_1() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = &built_in("thesis", side).rig;
        for (i, digit) in rig.digits.iter().enumerate() {
            let expected = if i == 0 {
                [[0.0, 45.0], [0.0, 60.0], [-45.0, 45.0]]
            } else {
                [[-5.0, 5.0], [0.0, 90.0], [0.0, 90.0]]
            };
            let limits = digit.limits;
            for (range, [min, max]) in [limits.base_yaw, limits.base_pitch, limits.second_pitch]
                .into_iter()
                .zip(expected)
            {
                assert!((range.min.to_degrees() - min).abs() < 1e-4, "digit {i}");
                assert!((range.max.to_degrees() - max).abs() < 1e-4, "digit {i}");
            }
            // The third joint follows the second by two thirds.
            for (third, second) in [
                (limits.third_pitch.min, limits.second_pitch.min),
                (limits.third_pitch.max, limits.second_pitch.max),
            ] {
                assert!((third - second * 2.0 / 3.0).abs() < 1e-6, "digit {i}");
            }
        }
    }
}

#[test]
fn the_stretched_middle_finger_has_the_rigs_reach() {
    for (name, reach) in [("thesis", 0.22), ("adult", 0.19)] {
        for side in [Handedness::Left, Handedness::Right] {
            let rig = &built_in(name, side).rig;
            let frames = hand_frames(
                rig,
                &HandPose {
                    frame_from_wrist: Pose::IDENTITY,
                    digits: rig.stretched(),
                },
            );
            // The middle finger's limits contain zero, so it is straight.
            let tip = frames.digits[2].tip;
            assert!((tip.length() - rig.reach).abs() < 1e-6);
            let tolerance = if name == "thesis" { 1e-6 } else { 1e-3 };
            assert!(
                (rig.reach - reach).abs() < tolerance,
                "{name} reaches {}",
                rig.reach
            );
            assert!(tip.y > 0.999 * tip.length(), "the fingers stretch along +y");
        }
    }
}

#[test]
fn skins_are_closed_and_face_outward() {
    for hand in all() {
        let skin = &hand.skin;
        let mut edges = BTreeMap::new();
        for &[a, b, c] in &skin.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for (&(a, b), &count) in &edges {
            assert_eq!(count, 1, "edge {a}-{b} is used twice in one direction");
            assert!(edges.contains_key(&(b, a)), "edge {a}-{b} is open");
        }
        // Euler's formula for a sphere.
        let (v, e, f) = (skin.positions.len(), edges.len() / 2, skin.triangles.len());
        assert_eq!(v + f, e + 2, "the skin has no handles and no holes");
        let volumes = skin.triangles.iter().map(|&triangle| {
            let [a, b, c] = triangle.map(|v| skin.positions[v as usize]);
            a.dot(b.cross(c)) / 6.0
        });
        let litres = 1e3 * volumes.sum::<f32>();
        let size = (hand.rig.reach / 0.19).powi(3);
        // About 0.4 litres for an adult's hand with part of the forearm.
        assert!(
            (0.35..0.55).contains(&(litres / size)),
            "{} holds {litres} litres",
            hand.rig.name
        );
    }
}

/// Distance from a point inside to the skin (Möller and Trumbore).
fn to_skin(skin: &Skin, origin: Vec3, direction: Vec3) -> f32 {
    let crossings = skin.triangles.iter().filter_map(|&triangle| {
        let [a, b, c] = triangle.map(|v| skin.positions[v as usize]);
        let (u, v) = (b - a, c - a);
        let p = direction.cross(v);
        let determinant = u.dot(p);
        let s = (origin - a) / determinant;
        let q = s.cross(u);
        let (x, y) = (s.dot(p), direction.dot(q));
        let t = v.dot(q);
        (x >= 0.0 && y >= 0.0 && x + y <= 1.0 && t > 0.0).then_some(t)
    });
    crossings.fold(f32::INFINITY, f32::min)
}

#[test]
fn phalanges_are_as_thick_as_the_rigs_links() {
    for hand in all() {
        for digit in 0..5 {
            for link in usize::from(digit == 0)..3 {
                let first = index::TIP_OF_DIGIT[digit] - 3;
                let frame = thesis_from_openxr_frame(hand.skin.bind.joints[first + link].pose);
                let length = hand.rig.digits[digit].lengths[link];
                let radius = 0.5 * hand.rig.digits[digit].diameters[link];
                // The first half of the first phalanx is in the palm, and the last third of the last one is rounded.
                let shares: &[f32] = match link {
                    0 => &[0.65, 0.8],
                    1 if digit == 0 => &[0.5, 0.75],
                    1 => &[0.3, 0.5, 0.7],
                    _ => &[0.25, 0.45, 0.6],
                };
                for share in shares {
                    let origin = frame.transform_point(Vec3::new(0.0, share * length, 0.0));
                    let distance = to_skin(&hand.skin, origin, frame.transform_vector(Vec3::Z));
                    let tolerance = 1.5e-3 * hand.rig.reach / 0.19;
                    assert!(
                        (distance - radius).abs() < tolerance,
                        "{} digit {digit} link {link} at {share}: {distance} m to the skin, radius {radius}",
                        hand.rig.name
                    );
                }
            }
        }
    }
}
