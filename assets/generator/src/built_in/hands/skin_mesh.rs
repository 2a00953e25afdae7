//! The skins as meshes: closed, outward, in one piece, sensibly weighted.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;
use grasp_synthesis::model::hand::joints::index;

use super::all;

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
        let litres = 1e3 * volume(&skin.positions, &skin.triangles);
        let size = (hand.rig.reach / 0.19).powi(3);
        // About 0.4 litres for an adult's hand with part of the forearm.
        assert!(
            (0.35..0.55).contains(&(litres / size)),
            "{} holds {litres} litres",
            hand.rig.name
        );
    }
}

/// The representative of a vertex' piece.
fn root(group: &mut [usize], mut v: usize) -> usize {
    while group[v] != v {
        group[v] = group[group[v]];
        v = group[v];
    }
    v
}

#[test]
fn skins_are_one_piece_and_use_every_vertex() {
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
fn skins_have_no_slivers() {
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
fn weights_sum_to_one_and_stay_on_one_finger() {
    for hand in all() {
        let skin = &hand.skin;
        assert_eq!(skin.weights.len(), skin.positions.len());
        for ((joints, weights), position) in skin.joint_indices.iter().zip(&skin.weights).zip(&skin.positions)
        {
            let sum: f32 = weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-5 && weights.iter().all(|w| (0.0..=1.0).contains(w)));
            let used = || joints.iter().zip(weights).filter(|&(_, &w)| w > 0.0);
            assert!(used().all(|(&j, _)| usize::from(j) != index::PALM));
            // The digits whose phalanges move this vertex.
            let phalanges = |d: usize| index::FIRST_OF_DIGIT[d] + 1..=index::TIP_OF_DIGIT[d];
            let digit_of = |joint: u8| (0..5).find(|&d| phalanges(d).contains(&usize::from(joint)));
            let digits: BTreeSet<usize> = used().filter_map(|(&joint, _)| digit_of(joint)).collect();
            if digits.len() > 1 {
                // Only in the web between two fingers: nearer to the knuckles than the middle of the first phalanx.
                assert_eq!(digits.len(), 2, "{position} depends on the digits {digits:?}");
                for digit in digits {
                    assert!(digit > 0, "{position} depends on the thumb and a finger");
                    let knuckle = skin.bind.joints[index::FIRST_OF_DIGIT[digit] + 1].pose;
                    let past = -knuckle.inverse().transform_point(*position).z;
                    assert!(
                        past < 0.6 * hand.rig.digits[digit].lengths[0],
                        "{position}, {past} m past a knuckle, depends on two fingers: {joints:?} {weights:?}"
                    );
                }
            }
        }
    }
}
