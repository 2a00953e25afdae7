//! Skins agree with their rigs: widths, radii, palm, collision segments.

use glam::Vec3;
use grasp_assets::hands::Hand;
use grasp_synthesis::model::hand::{
    joints::{index, thesis_from_openxr_frame},
    skin::Skin,
};

use super::all;

/// Distances at which a ray meets the skin, ascending (Möller and Trumbore).
fn crossings(skin: &Skin, origin: Vec3, direction: Vec3) -> Vec<f32> {
    let mut found: Vec<f32> = skin
        .triangles
        .iter()
        .filter_map(|&triangle| {
            let [a, b, c] = triangle.map(|v| skin.positions[v as usize]);
            let (u, v) = (b - a, c - a);
            let p = direction.cross(v);
            let determinant = u.dot(p);
            let s = (origin - a) / determinant;
            let q = s.cross(u);
            let (x, y) = (s.dot(p), direction.dot(q));
            let t = v.dot(q);
            (x >= 0.0 && y >= 0.0 && x + y <= 1.0 && t > 0.0).then_some(t)
        })
        .collect();
    found.sort_by(f32::total_cmp);
    found
}

/// Distance from a point inside to the skin.
fn to_skin(skin: &Skin, origin: Vec3, direction: Vec3) -> f32 {
    crossings(skin, origin, direction)
        .first()
        .copied()
        .unwrap_or(f32::INFINITY)
}

/// A millimetre of an adult's hand, in metres, at the scale of this one.
fn mm(hand: &Hand) -> f32 {
    1e-3 * hand.rig.reach / 0.19
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
                    assert!(
                        (distance - radius).abs() < 1.5 * mm(hand),
                        "{} digit {digit} link {link} at {share}: {distance} m to the skin, radius {radius}",
                        hand.rig.name
                    );
                }
            }
        }
    }
}

#[test]
fn joint_radii_reach_the_skin() {
    for hand in all() {
        for joint in 0..26 {
            let frame = hand.skin.bind.joints[joint].pose;
            let distance = if joint == index::WRIST || index::FIRST_OF_DIGIT.contains(&joint) {
                // Deep in the hand: the nearest skin in any direction.
                let to = |p: &Vec3| p.distance(frame.position);
                hand.skin.positions.iter().map(to).fold(f32::INFINITY, f32::min)
            } else if index::TIP_OF_DIGIT.contains(&joint) {
                continue;
            } else {
                to_skin(&hand.skin, frame.position, frame.transform_vector(Vec3::NEG_Y))
            };
            let radius = hand.rig.joint_radii[joint];
            let tolerance = if joint == index::FIRST_OF_DIGIT[0] + 1 {
                // The ball of the thumb bulges over the thumb's MCP.
                3.5
            } else {
                2.0
            };
            assert!(
                (distance - radius).abs() < tolerance * mm(hand),
                "{} joint {joint}: {distance} m to the skin, radius {radius}",
                hand.rig.name
            );
        }
    }
}

#[test]
fn tips_end_at_the_skin() {
    for hand in all() {
        for tip in index::TIP_OF_DIGIT {
            let frame = hand.skin.bind.joints[tip].pose;
            let inside = frame.transform_point(Vec3::new(0.0, 0.0, 0.5 * hand.rig.joint_radii[tip]));
            let distance = to_skin(&hand.skin, inside, frame.transform_vector(Vec3::NEG_Z));
            assert!(
                (distance - 0.5 * hand.rig.joint_radii[tip]).abs() < 1.0 * mm(hand),
                "{} joint {tip} is {distance} m before the skin",
                hand.rig.name
            );
        }
    }
}

#[test]
fn the_palm_point_lies_on_the_palms_skin() {
    for hand in all() {
        let inner = hand.rig.palm - Vec3::new(0.0, 0.0, 0.01);
        let over = to_skin(&hand.skin, inner, Vec3::Z) - 0.01;
        assert!(over.abs() < 1.0 * mm(hand), "the palm's skin is {over} m over H");
    }
}

#[test]
fn palm_segments_lie_about_half_a_centimetre_under_the_skin() {
    for hand in all() {
        for (i, segment) in hand.rig.palm_segments.iter().enumerate() {
            let outward = if i < 5 { Vec3::Z } else { Vec3::NEG_Z };
            for share in [0.0, 0.5, 1.0] {
                let point = segment.start.lerp(segment.end, share);
                let depths = crossings(&hand.skin, point, outward);
                assert_eq!(depths.len() % 2, 1, "segment {i} at {share} is outside");
                assert!(
                    (2.0..9.0).contains(&(depths[0] / mm(hand))),
                    "{} segment {i} at {share} lies {} m deep",
                    hand.rig.name,
                    depths[0]
                );
            }
        }
    }
}
