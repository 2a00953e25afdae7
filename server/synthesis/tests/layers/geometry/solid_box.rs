//! Distances of boxes to points and tapered capsules, against brute force over the points of their surfaces.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{oriented_box::OrientedBox, solid_box::SolidBox, tapered_capsule::TaperedCapsule},
};

use crate::fixtures::random::Random;

/// Sample points along each edge of a face, both ends included.
const SAMPLES: u16 = 60;

/// Rounding of single precision, in metres.
const ROUNDING: f32 = 2e-6;

fn any_box(random: &mut Random) -> OrientedBox {
    let mut half = || random.between(0.002, 0.05);
    OrientedBox {
        half_extents: Vec3::new(half(), half(), half()),
        object_from_box: Pose::new(random.in_cube() * 0.05, random.rotation()),
    }
}

/// Capsules of every kind: ordinary ones, cones, balls, nested balls, and ones along an edge of the box.
fn any_capsule(random: &mut Random, around: &OrientedBox) -> TaperedCapsule {
    let start = around.object_from_box.position + random.in_cube() * 0.1;
    let radius = random.between(0.003, 0.016);
    let length = random.between(0.01, 0.12);
    let (way, end_radius) = match random.index(6) {
        0 => (random.direction() * length, radius),
        1 => (Vec3::ZERO, radius),
        2 => (random.direction() * 0.01, radius + 0.02),
        3 => (
            around
                .object_from_box
                .transform_vector(Vec3::AXES[random.index(3)])
                * length,
            radius,
        ),
        4 => (random.direction() * length, 0.0),
        _ => (random.direction() * length, radius * random.between(0.5, 1.5)),
    };
    TaperedCapsule::new(start, start + way, radius, end_radius)
}

/// Points of all six faces, and the largest distance of any other point of the surface from one of them.
fn surface_points(of: &OrientedBox) -> (Vec<Vec3>, f32) {
    let share = |i: u16| 2.0 * f32::from(i) / f32::from(SAMPLES - 1) - 1.0;
    let mut points = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            for i in 0..SAMPLES {
                for j in 0..SAMPLES {
                    let mut local = Vec3::ZERO;
                    local[axis] = side;
                    local[(axis + 1) % 3] = share(i);
                    local[(axis + 2) % 3] = share(j);
                    points.push(of.object_from_box.transform_point(local * of.half_extents));
                }
            }
        }
    }
    (points, of.half_extents.length() / f32::from(SAMPLES - 1))
}

#[test]
fn capsule_distances_match_the_nearest_points_of_the_faces() {
    let mut random = Random::new(51);
    let (mut apart, mut overlapping) = (0, 0);
    for case in 0..500 {
        let of = any_box(&mut random);
        let capsule = any_capsule(&mut random, &of);
        let distance = SolidBox::new(&of).distance(&capsule);
        let (points, slack) = surface_points(&of);
        let nearest = points
            .iter()
            .map(|&point| capsule.signed_distance(point))
            .fold(f32::INFINITY, f32::min);
        let is_inside = of.contains(capsule.start);
        if distance > 0.0 {
            apart += 1;
            assert!(
                distance <= nearest + ROUNDING && distance >= nearest - slack - ROUNDING,
                "{case}: {distance}, brute force says {nearest}, of {of:?} and {capsule:?}"
            );
        } else {
            overlapping += 1;
            assert!(
                nearest <= slack + ROUNDING || is_inside,
                "{case}: {distance}, but the nearest point is {nearest} m off, of {of:?} and {capsule:?}"
            );
        }
    }
    assert!(
        apart > 100 && overlapping > 40,
        "{apart} apart, {overlapping} overlap"
    );
}

#[test]
fn capsule_distances_are_least_over_the_balls_along_the_axis() {
    const BALLS: u16 = 2000;
    let mut random = Random::new(52);
    for case in 0..2000 {
        let of = any_box(&mut random);
        let capsule = any_capsule(&mut random, &of);
        let distance = SolidBox::new(&of).distance(&capsule);
        let least = (0..=BALLS)
            .map(|i| f32::from(i) / f32::from(BALLS))
            .map(|t| of.signed_distance(capsule.at(t)) - capsule.radius_at(t))
            .fold(f32::INFINITY, f32::min);
        let change = capsule.length() + (capsule.end_radius - capsule.start_radius).abs();
        let slack = 0.5 * change / f32::from(BALLS) + ROUNDING;
        assert!(
            distance <= least + ROUNDING && distance >= least - slack,
            "{case}: {distance}, brute force says {least}, of {of:?} and {capsule:?}"
        );
    }
}

#[test]
fn a_wide_floor_is_as_exact_as_a_small_box() {
    let mut random = Random::new(53);
    for half_extent in [2.0, 50.0, 1000.0] {
        let floor = SolidBox::new(&OrientedBox {
            object_from_box: Pose::new(Vec3::new(0.0, -half_extent, 0.0), glam::Quat::IDENTITY),
            half_extents: Vec3::splat(half_extent),
        });
        for _ in 0..300 {
            let start = random.in_cube() * 0.3;
            let end = start + random.direction() * 0.1;
            let capsule = TaperedCapsule::new(start, end, 0.01, 0.008);
            // The ground is the plane y = 0.
            let expected = (start.y - 0.01).min(end.y - 0.008);
            let distance = floor.distance(&capsule);
            assert!(
                (distance - expected).abs() < ROUNDING,
                "{half_extent}: {distance}, not {expected}"
            );
        }
    }
}

#[test]
fn point_distances_are_those_of_the_oriented_box() {
    let mut random = Random::new(54);
    for _ in 0..2000 {
        let of = any_box(&mut random);
        let point = of.object_from_box.position + random.in_cube() * 0.1;
        let distance = SolidBox::new(&of).signed_distance(point);
        assert!((distance - of.signed_distance(point)).abs() < ROUNDING);
    }
}
