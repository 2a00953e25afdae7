//! The built-in holdouts: names and types of the thesis, sound hands that touch and do not sink in, givers at -Z.

use std::collections::BTreeSet;

use glam::Vec3;
use grasp_assets::{
    hands::{Hand, hand},
    holdouts::{BuiltInHoldout, Origin, holdout, holdouts},
    objects::object,
};
use grasp_synthesis::{
    geometry::mesh_bvh::MeshBvh,
    model::hand::{
        HandPose,
        joints::{HandJoints, index},
        kinematics::hand_frames,
    },
};

/// Names and types in the captions of the thesis' Figures 5.2 to 5.4.
const THESIS: [(&str, &str); 15] = [
    ("remote-genhold1", "Prismatic 4 Finger"),
    ("remote-genhold2", "Medium Wrap"),
    ("remote-genhold3", "Ring"),
    ("remote-hold1", "Light Tool"),
    ("remote-hold2", "Index Finger Extension"),
    ("scalpel-genhold1", "Ring"),
    ("scalpel-genhold2", "Small Diameter"),
    ("scalpel-genhold3", "Palmar Pinch"),
    ("scalpel-hold1", "Prismatic 2 Finger"),
    ("scalpel-hold2", "Adduction Grip"),
    ("scissors-genhold1", "Palmar Pinch"),
    ("scissors-genhold2", "Prismatic 2 Finger"),
    ("scissors-genhold3", "Writing Tripod"),
    ("scissors-hold1", "Lateral"),
    ("scissors-hold2", "Adducted Thumb"),
];

fn giver(holdout: &BuiltInHoldout) -> &'static Hand {
    hand(&holdout.giver_rig, holdout.giver_handedness).expect("the giver's rig is built in")
}

/// The giver's hand in the object's frame.
fn giver_in_object(holdout: &BuiltInHoldout) -> HandPose {
    HandPose {
        frame_from_wrist: holdout.world_from_object.inverse() * holdout.world_from_giver_wrist,
        digits: holdout.giver_digits,
    }
}

fn surface(holdout: &BuiltInHoldout) -> &'static MeshBvh {
    &object(&holdout.object)
        .expect("the object is built in")
        .object
        .surface
}

/// Depth of a point below a surface, in metres; 0 outside.
fn depth(surface: &MeshBvh, point: Vec3) -> f32 {
    if surface.contains(point) {
        surface
            .closest_point_within(point, 1.0)
            .map_or(0.0, |closest| closest.distance)
    } else {
        0.0
    }
}

#[test]
fn holdouts_are_the_fifteen_of_the_thesis() {
    let named: Vec<_> = holdouts()
        .iter()
        .map(|h| (h.name.as_str(), h.grasp_type.as_str()))
        .collect();
    assert_eq!(named, THESIS);
    for built_in in holdouts() {
        assert!(
            built_in.name.starts_with(&format!("{}-", built_in.object)),
            "{}",
            built_in.name
        );
        assert_eq!(holdout(&built_in.name), Some(built_in));
        let synthesized = matches!(built_in.origin, Origin::Synthesized { .. });
        assert_eq!(
            synthesized,
            built_in.name.contains("-genhold"),
            "{}",
            built_in.name
        );
    }
    assert_eq!(holdout("remote-hold3"), None);
}

#[test]
fn givers_touch_with_two_digits_without_sinking_in() {
    for built_in in holdouts() {
        let name = &built_in.name;
        let (hand, pose, surface) = (giver(built_in), giver_in_object(built_in), surface(built_in));

        // The bones, as the thesis' collision segments, stay outside.
        let frames = hand_frames(&hand.rig, &pose);
        for (digit, chain) in frames.digits.iter().enumerate() {
            for (link, frame) in chain.links.iter().enumerate() {
                for step in 0_u8..=10 {
                    let along = hand.rig.digits[digit].lengths[link] * f32::from(step) / 10.0;
                    let deep = depth(surface, frame.transform_point(Vec3::Y * along));
                    assert!(deep < 0.0005, "{name}: bone {digit}.{link} is {deep} m deep");
                }
            }
        }
        for segment in &hand.rig.palm_segments {
            for step in 0_u8..=10 {
                let point = segment.start.lerp(segment.end, f32::from(step) / 10.0);
                let deep = depth(surface, pose.frame_from_wrist.transform_point(point));
                assert!(deep < 0.0005, "{name}: the palm is {deep} m deep");
            }
        }

        // The skin touches, and is not pressed in deeper than flesh gives way.
        let skin = hand.skin.posed(&HandJoints::of_pose(&hand.rig, &pose));
        let mut touching = BTreeSet::new();
        for (vertex, &point) in skin.iter().enumerate() {
            let deep = depth(surface, point);
            assert!(deep < 0.005, "{name}: skin is {deep} m deep");
            let near = surface.closest_point_within(point, 0.003).is_some() || deep > 0.0;
            let (&joint, _) = hand.skin.joint_indices[vertex]
                .iter()
                .zip(hand.skin.weights[vertex])
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .expect("a vertex has four weights");
            let digit = (0..5).find(|&d| {
                (index::FIRST_OF_DIGIT[d] + usize::from(d > 0)..=index::TIP_OF_DIGIT[d])
                    .contains(&usize::from(joint))
            });
            if near {
                touching.extend(digit);
            }
        }
        assert!(touching.len() >= 2, "{name}: only digits {touching:?} touch");
    }
}
