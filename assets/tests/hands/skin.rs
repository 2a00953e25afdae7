//! The skin as a mesh: closed, outward, in one piece, sensibly weighted, and what posing does to it.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        DigitAngles, HandPose, Handedness,
        joints::{HandJoints, index},
        rig::Rig,
        skin::Skin,
    },
};

use crate::{all, built_in};

/// Volume within a closed mesh in cubic metres.
fn volume(positions: &[Vec3], triangles: &[[u32; 3]]) -> f32 {
    triangles
        .iter()
        .map(|&triangle| {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}

fn posed(skin: &Skin, rig: &Rig, digits: [DigitAngles; 5]) -> Vec<Vec3> {
    skin.posed(&HandJoints::of_pose(
        rig,
        &HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits,
        },
    ))
}

#[test]
fn is_closed_and_faces_outward() {
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
        let litres = 1e3 * volume(&skin.positions, &skin.triangles);
        let size = (hand.rig.reach / 0.19).powi(3);
        // About 0.4 litres for an adult's hand with a piece of the forearm.
        assert!(
            (0.35..0.55).contains(&(litres / size)),
            "{} holds {litres} litres",
            hand.rig.name
        );
    }
}

/// The representative of a vertex's piece.
fn root(group: &mut [usize], mut v: usize) -> usize {
    while group[v] != v {
        group[v] = group[group[v]];
        v = group[v];
    }
    v
}

#[test]
fn is_one_piece_that_uses_every_vertex() {
    for hand in all() {
        let skin = &hand.skin;
        let mut group: Vec<usize> = (0..skin.positions.len()).collect();
        for triangle in &skin.triangles {
            let [a, b, c] = triangle.map(|v| root(&mut group, v as usize));
            group[b] = a;
            let c = root(&mut group, c);
            group[c] = root(&mut group, a);
        }
        let roots: BTreeSet<usize> = (0..group.len()).map(|v| root(&mut group, v)).collect();
        assert_eq!(roots.len(), 1);
        assert!((3000..7000).contains(&skin.triangles.len()));
    }
}

#[test]
fn has_no_slivers() {
    for hand in all() {
        for &triangle in &hand.skin.triangles {
            let [a, b, c] = triangle.map(|v| hand.skin.positions[v as usize]);
            let area = 0.5 * (b - a).cross(c - a).length();
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            assert!(longest < 0.02, "an edge is {longest} m long");
            // Height over the longest edge.
            assert!(
                2.0 * area / longest > 0.1 * longest,
                "a triangle at {a} is a sliver"
            );
        }
    }
}

#[test]
fn weights_sum_to_one_and_stay_on_their_finger() {
    for hand in all() {
        let skin = &hand.skin;
        assert_eq!(skin.weights.len(), skin.positions.len());
        for ((joints, weights), position) in skin.joint_indices.iter().zip(&skin.weights).zip(&skin.positions)
        {
            let sum: f32 = weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-5 && weights.iter().all(|w| (0.0..=1.0).contains(w)));
            let used = || joints.iter().zip(weights).filter(|&(_, &w)| w > 0.0);
            assert!(used().all(|(&j, _)| usize::from(j) != index::PALM));
            // Which digits' phalanges move this vertex, by joint past the metacarpal.
            let phalanges = |d: usize| index::FIRST_OF_DIGIT[d] + 1..=index::TIP_OF_DIGIT[d];
            let digit_of = |joint: u8| (0..5).find(|&d| phalanges(d).contains(&usize::from(joint)));
            let digits: BTreeSet<usize> = used().filter_map(|(&joint, _)| digit_of(joint)).collect();
            if digits.len() > 1 {
                // Only in a web: closer to the knuckles than the middle of the first phalanx.
                assert_eq!(digits.len(), 2, "{position} hangs on the digits {digits:?}");
                for digit in digits {
                    assert!(digit > 0, "{position} hangs on the thumb and a finger");
                    let knuckle = skin.bind.joints[index::FIRST_OF_DIGIT[digit] + 1].pose;
                    let past = -knuckle.inverse().transform_point(*position).z;
                    assert!(
                        past < 0.6 * hand.rig.digits[digit].lengths[0],
                        "{position}, {past} m past a knuckle, hangs on two fingers: {joints:?} {weights:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn bind_pose_gives_the_skin_as_it_is() {
    for hand in all() {
        for (found, expected) in hand.skin.posed(&hand.skin.bind).iter().zip(&hand.skin.positions) {
            assert!(found.distance(*expected) < 1e-6, "{found} instead of {expected}");
        }
    }
}

#[test]
fn moves_with_the_wrist() {
    let a_from_b = Pose::new(
        Vec3::new(0.4, -1.0, 2.0),
        Quat::from_xyzw(0.3, 0.1, -0.6, 0.7).normalize(),
    );
    for hand in all() {
        let joints = HandJoints::of_pose(
            &hand.rig,
            &HandPose {
                frame_from_wrist: Pose::IDENTITY,
                digits: hand.rig.stretched(),
            },
        );
        let there = hand.skin.posed(&joints.transformed(a_from_b));
        for (here, there) in hand.skin.posed(&joints).iter().zip(there) {
            assert!(a_from_b.transform_point(*here).distance(there) < 5e-6);
        }
    }
}

#[test]
fn grows_with_its_joints() {
    for hand in all() {
        for scale in [0.8, 1.25] {
            let mut joints = hand.skin.bind.clone();
            for joint in &mut joints.joints {
                joint.pose.position *= scale;
                joint.radius *= scale;
            }
            for (found, bind) in hand.skin.posed(&joints).iter().zip(&hand.skin.positions) {
                assert!(
                    found.distance(scale * *bind) < 1e-5,
                    "{found} instead of {}",
                    scale * *bind
                );
            }
        }
    }
}

#[test]
fn stretches_to_the_hand_of_the_other_rig() {
    // The adult's skin on the joints of the thesis' larger hand is the skin of that hand.
    let (small, large) = (
        built_in("adult", Handedness::Right),
        built_in("thesis", Handedness::Right),
    );
    let on_large = small.skin.posed(&large.skin.bind);
    let ratio =
        volume(&on_large, &small.skin.triangles) / volume(&large.skin.positions, &large.skin.triangles);
    assert!((ratio - 1.0).abs() < 0.02, "the volumes' ratio is {ratio}");
}

#[test]
fn keeps_its_volume_when_it_bends() {
    let bent = |degrees: [f32; 3]| {
        let [first, second, third] = degrees.map(f32::to_radians);
        DigitAngles {
            base_yaw: 0.0,
            base_pitch: first,
            second_pitch: second,
            third_pitch: third,
        }
    };
    for hand in all() {
        let straight = volume(&hand.skin.positions, &hand.skin.triangles);
        for (name, fingers) in [
            ("flat", bent([0.0, 0.0, 0.0])),
            ("hook", bent([0.0, 90.0, 60.0])),
            ("fist", bent([85.0, 90.0, 60.0])),
        ] {
            let mut digits = [fingers; 5];
            digits[0] = bent([10.0, 20.0, 15.0]);
            let ratio = volume(&posed(&hand.skin, &hand.rig, digits), &hand.skin.triangles) / straight;
            println!("{} {name}: {ratio:.3} of the volume", hand.rig.name);
            assert!((0.93..1.07).contains(&ratio), "{name} has {ratio} of the volume");
        }
    }
}
