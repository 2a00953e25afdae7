//! Types fit the shape of what is held.

use grasp_synthesis::model::grasp_type::CLEAR_CONFIDENCE;

use super::{
    cases::{LARGE, SMALL, alike, made, outer_links, rod, thumb},
    made_grasps::held,
};
use crate::prelude::*;

const BALLS: [GraspType; 4] = [
    GraspType::PowerSphere,
    GraspType::PrecisionSphere,
    GraspType::Sphere4Finger,
    GraspType::Sphere3Finger,
];
const DISKS: [GraspType; 2] = [GraspType::PowerDisk, GraspType::PrecisionDisk];
const WRAPS: [GraspType; 5] = [
    GraspType::LargeDiameter,
    GraspType::SmallDiameter,
    GraspType::MediumWrap,
    GraspType::AdductedThumb,
    GraspType::LightTool,
];
const PRISMS: [GraspType; 3] = [
    GraspType::Prismatic4Finger,
    GraspType::Prismatic3Finger,
    GraspType::Prismatic2Finger,
];
const PENS: [GraspType; 3] = [
    GraspType::WritingTripod,
    GraspType::TripodVariation,
    GraspType::LateralTripod,
];

/// Searches per object.
const SEEDS: u64 = 24;

/// Grasps found on an object.
fn grasps(mesh: TriangleMesh) -> Vec<Grasp> {
    let holdout = floating(Arc::new(object_of(mesh, &[])));
    let found = (0..SEEDS).filter_map(|seed| guided(&holdout).seed(seed).max_attempts(400).grasp());
    found.collect()
}

#[test]
fn what_is_flat_long_or_round_is_not_held_as_something_else() {
    let rod = |radius| cylinder_mesh(radius, 0.09, 24, 12);
    for (what, mesh, excluded) in [
        (
            "a card",
            cuboid(Vec3::new(0.043, 0.0004, 0.027), 4),
            &[&BALLS[..], &DISKS][..],
        ),
        (
            "a phone",
            cuboid(Vec3::new(0.037, 0.08, 0.004), 4),
            &[&BALLS, &DISKS],
        ),
        (
            "a ruler",
            cuboid(Vec3::new(0.014, 0.001, 0.16), 4),
            &[&BALLS, &DISKS],
        ),
        ("a thin rod", rod(0.004), &[&BALLS]),
        ("a rod", rod(0.015), &[&BALLS]),
        ("a thick rod", rod(0.025), &[&BALLS]),
        ("a bar", cuboid(Vec3::new(0.015, 0.1, 0.01), 4), &[&BALLS]),
        (
            "a small ball",
            sphere(0.015, 16),
            &[&WRAPS, &PRISMS, &PENS, &DISKS],
        ),
        ("a ball", sphere(0.035, 16), &[&WRAPS, &PRISMS, &PENS, &DISKS]),
    ] {
        let grasps = grasps(mesh);
        assert!(grasps.len() as u64 > SEEDS / 2, "{what}: {} grasps", grasps.len());
        for found in grasps.iter().map(|grasp| grasp.classification) {
            let is_excluded = |grasp_type| excluded.iter().any(|types| types.contains(&grasp_type));
            assert!(!found.grasp_type.is_some_and(is_excluded), "{what}: {found:?}");
        }
    }
}

#[test]
fn no_can_is_held_by_its_side_as_a_disk_or_ball() {
    let mut by_side = 0;
    for radius in [0.025, 0.033] {
        for grasp in grasps(cylinder_mesh(radius, 0.06, 24, 8)) {
            let facing = grasp.pose.frame_from_wrist.transform_vector(Vec3::Z);
            // A finger over an end feels its edge.
            let is_over_end = grasp.contacts.iter().any(|contact| contact.normal.y.abs() > 0.5);
            if facing.y.abs() > 0.5 || is_over_end {
                continue;
            }
            by_side += 1;
            let found = grasp.classification;
            let is_curved = |grasp_type| BALLS.contains(&grasp_type) || DISKS.contains(&grasp_type);
            assert!(!found.grasp_type.is_some_and(is_curved), "{found:?}");
        }
    }
    assert!(by_side as u64 > SEEDS / 2, "{by_side}");
}

/// A fist that opens around a rod that thickens in proportion.
#[test]
fn the_diameter_decides_between_wraps_and_confidence_is_continuous() {
    let between = |from: [f32; 4], to: [f32; 4], share: f32| -> [f32; 4] {
        std::array::from_fn(|i| from[i] + (to[i] - from[i]) * share)
    };
    let mut types = Vec::new();
    let mut before: Option<f32> = None;
    for step in 0..=200 {
        let share = step as f32 / 200.0;
        let hand = alike(
            between(thumb::OVER, thumb::FAR, share),
            between(SMALL, LARGE, share),
        );
        let shape = rod(92.0 + 3.0 * share, 24.0 + 26.0 * share, 9.0 + 31.0 * share);
        let found = held(hand, shape, &outer_links(4)).on_palm().classify();
        let grasp_type = found.grasp_type.expect("it has a type");
        if types.last() != Some(&grasp_type) {
            types.push(grasp_type);
        }
        let change = before.map_or(0.0, |before| (found.confidence - before).abs());
        assert!(change < 0.05, "{change} at {share}, {found:?}");
        before = Some(found.confidence);
    }
    assert_eq!(
        types,
        [
            GraspType::SmallDiameter,
            GraspType::MediumWrap,
            GraspType::LargeDiameter
        ]
    );
}

/// Five fingertips around a ball that becomes an egg and then a rod.
#[test]
fn a_ball_that_is_stretched_ceases_to_be_one_gradually() {
    let ball = made(GraspType::PrecisionSphere);
    let mut before = None;
    for step in 0..=300 {
        let factor = 1.0 + step as f32 / 100.0;
        let found = ball.on_stretched(Vec3::X, factor).classify();
        let is_ball = found.grasp_type.is_some_and(|found| BALLS.contains(&found));
        if factor < 1.3 {
            assert!(
                is_ball && found.confidence > CLEAR_CONFIDENCE,
                "{factor}: {found:?}"
            );
        } else if factor > 2.5 {
            assert!(!is_ball, "{factor}: {found:?}");
        }
        let change = before.map_or(0.0, |before: f32| (found.confidence - before).abs());
        assert!(change < 0.06, "{change} at {factor}, {found:?}");
        before = Some(found.confidence);
    }
}
