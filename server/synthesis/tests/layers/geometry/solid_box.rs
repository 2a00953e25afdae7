//! Distances of boxes to points and tapered capsules, against brute force over the points of their surfaces.

use grasp_synthesis::geometry::solid_box::SolidBox;

use crate::prelude::*;

/// Rounding of single precision, in metres.
const ROUNDING: f32 = 2e-6;

fn any_box(random: &mut Random) -> OrientedBox {
    let pose = Pose::new(random.in_cube() * 0.05, random.rotation());
    oriented_box(
        pose,
        Vec3::from_array(std::array::from_fn(|_| random.between(0.002, 0.05))),
    )
}

/// Capsules of every kind, and ones along an edge of the box.
fn any_capsule(random: &mut Random, around: &OrientedBox) -> TaperedCapsule {
    let start = around.object_from_box.position + random.in_cube() * 0.1;
    if random.index(6) > 0 {
        return random.capsule(start);
    }
    let axis = Vec3::AXES[random.index(3)];
    let way = around.object_from_box.transform_vector(axis) * random.between(0.01, 0.12);
    TaperedCapsule::new(start, start + way, 0.01, 0.01)
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
        let floor = SolidBox::new(&oriented_box(
            Pose::new(Vec3::new(0.0, -half_extent, 0.0), glam::Quat::IDENTITY),
            Vec3::splat(half_extent),
        ));
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
        // Along its gradient, the distance grows as fast as the point moves; from inside, up to the face.
        let out = SolidBox::new(&of).outward(point);
        let grown = of.signed_distance(point + out * 1e-4) - distance;
        assert!((grown - 1e-4).abs() < ROUNDING, "{grown} at {point} of {of:?}");
    }
}
