//! Boxes and zones against brute force.

use crate::prelude::*;
use grasp_synthesis::geometry::boxes::{Aabb, SolidBox};

fn check(name: &str, mesh: &TriangleMesh) -> OrientedBox {
    let fitted = OrientedBox::around(mesh);
    let aabb = mesh.aabb();
    let rounding = 1e-6 * (aabb.diagonal() + aabb.centre().length());
    assert!(
        fitted.volume() <= (aabb.extents() + rounding).element_product(),
        "{name}: {fitted:?} is larger than {aabb:?}"
    );
    let touched = mesh.positions().iter().fold(Aabb::EMPTY, |touched, &position| {
        assert!(fitted.contains(position), "{name} {position} {fitted:?}");
        touched.including(fitted.object_from_box.inverse().transform_point(position))
    });
    let slack = (fitted.half_extents - touched.max)
        .abs()
        .max((fitted.half_extents + touched.min).abs());
    assert!(
        slack.max_element() < 4e-6 * (1.0 + aabb.centre().length()),
        "{name}: {fitted:?} has slack {slack}"
    );
    assert_eq!(fitted, OrientedBox::around(mesh), "{name}");
    fitted
}

fn sorted(extents: Vec3) -> [f32; 3] {
    let mut sorted = extents.to_array();
    sorted.sort_by(f32::total_cmp);
    sorted
}

#[test]
fn boxes_fit_their_meshes_tightly() {
    for (name, mesh) in meshes::all_and_real() {
        check(&name, &mesh);
    }
    let tilt = Random::new(10).rotation();
    let flat = moved(&sheet(0.1, 0.0, 2), tilt, Vec3::ZERO);
    assert!(check("a tilted sheet", &flat).half_extents.min_element() < 1e-6);
}

#[test]
fn turned_boxes_are_recovered() {
    let mut random = Random::new(6);
    for i in 0..60 {
        let half = match i % 4 {
            0 => Vec3::splat(0.04),
            1 => Vec3::new(0.04, 0.04, 0.01),
            _ => Vec3::splat(0.001) + 0.1 * random.in_cube().abs(),
        };
        let turned = moved(&cuboid(half, 4), random.rotation(), random.in_cube());
        let fitted = check("turned box", &turned);
        for (found, expected) in sorted(fitted.half_extents).into_iter().zip(sorted(half)) {
            assert!(
                (found - expected).abs() < 0.01 * expected + 1e-6,
                "{:?} is not {half}",
                fitted.half_extents
            );
        }
        let aabb = turned.aabb().extents().element_product();
        assert!(fitted.volume() < 0.99 * aabb || i < 4, "{aabb} {fitted:?}");
    }
}

#[test]
fn distances_to_the_box_match_its_surface() {
    let rotation = Quat::from_axis_angle(Vec3::new(0.0, 0.6, 0.8), 1.1);
    let half = Vec3::new(0.05, 0.03, 0.02);
    let mesh = moved(&cuboid(half, 1), rotation, Vec3::new(0.1, 0.2, -0.1));
    let fitted = check("box", &mesh);
    let mut random = Random::new(11);
    for _ in 0..2_000 {
        let point = random.near(&mesh, 0.05);
        let expected = distance_to_mesh(&mesh, point) as f32;
        let signed = fitted.signed_distance(point);
        assert!(
            (signed.abs() - expected).abs() < 1e-5,
            "{point}: {signed} {expected}"
        );
        assert_eq!(signed <= 0.0, fitted.contains(point), "{point}: {signed}");
        assert_eq!(fitted.distance(point), signed.max(0.0), "{point}");
        let solid = SolidBox::new(&fitted);
        assert!((solid.signed_distance(point) - signed).abs() < ROUNDING);
        // Along its gradient, the distance grows as fast as the point moves; from inside, up to the face.
        let grown = fitted.signed_distance(point + solid.outward(point) * 1e-4) - signed;
        assert!((grown - 1e-4).abs() < ROUNDING, "{grown} at {point}");
    }
}

/// Rounding of single precision, in metres.
const ROUNDING: f32 = 2e-6;

fn any_box(random: &mut Random) -> OrientedBox {
    let pose = Pose::new(random.in_cube() * 0.05, random.rotation());
    oriented_box(
        pose,
        Vec3::from_array(std::array::from_fn(|_| random.between(0.002, 0.05))),
    )
}

/// Capsules of every kind, some along an edge of the box.
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
        let least = balls(&capsule, BALLS)
            .map(|(at, radius)| of.signed_distance(at) - radius)
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

/// Points along each side of a triangle.
const SAMPLES: usize = 60;

/// Longest side of the triangles: two points next to each other are closer than [`SPACING`].
const SIDE: f32 = 3.0;
const SPACING: f32 = 2.0 * SIDE / SAMPLES as f32;

fn vector(stream: &mut AttemptStream) -> Vec3 {
    stream.in_cube()
}

/// A random zone of every kind, with its boundary this much farther out.
fn zones(attempt: u64, by: f32) -> [Zone; 5] {
    let mut stream = AttemptStream::new(5, attempt);
    let mut length = || stream.between(0.2, 1.2) + by;
    let radii = [(); 5].map(|()| length());
    let half_extents = Vec3::from_array([(); 3].map(|()| length()));
    let points = [(); 4].map(|()| vector(&mut stream));
    let turn = Quat::from_scaled_axis(vector(&mut stream) * 3.0);
    let normal = vector(&mut stream).normalize_or(Vec3::X);
    let part = |k: usize| TaperedCapsule::new(points[k], points[k + 1], radii[k], radii[k + 1]);
    [
        Zone::Ball {
            centre: points[0],
            radius: radii[3],
        },
        Zone::Box(oriented_box(Pose::new(points[1], turn), half_extents)),
        half_space(points[2] - normal * by, normal),
        Zone::Tube {
            points: points.to_vec(),
            radius: radii[4],
        },
        Zone::TaperedTube(vec![part(0), part(1)]),
    ]
}

fn samples([a, b, c]: [Vec3; 3]) -> impl Iterator<Item = Vec3> {
    (0..=SAMPLES).flat_map(move |i| {
        (0..=SAMPLES - i).map(move |j| {
            let [u, v] = [i, j].map(|n| n as f32 / SAMPLES as f32);
            a + (b - a) * u + (c - a) * v
        })
    })
}

#[test]
fn a_triangle_meets_a_zone_where_one_of_its_points_is_in_it_at_any_scale() {
    let mut met = [0; 5];
    for attempt in 0..500 {
        let mut stream = AttemptStream::new(6, attempt);
        let middle = vector(&mut stream);
        let corners = [(); 3].map(|()| middle + vector(&mut stream) * 0.25 * SIDE);
        let (scale, point) = (stream.between(0.3, 3.0), vector(&mut stream));
        let [wider, narrower] = [SPACING, -1e-5].map(|by| zones(attempt, by));
        for (kind, zone) in zones(attempt, 0.0).iter().enumerate() {
            let meets = zone.meets(corners);
            met[kind] += usize::from(meets);
            let other = if meets { &wider[kind] } else { &narrower[kind] };
            let any_in = samples(corners).any(|point| other.contains(point));
            assert_eq!(any_in, meets, "{zone:?} {corners:?}");
            // Not at the boundary, where rounding decides.
            if wider[kind].contains(point) == narrower[kind].contains(point) {
                assert_eq!(zone.scaled(scale).contains(point * scale), zone.contains(point));
            }
        }
    }
    // Both cases occur for every kind.
    assert!(met.iter().all(|count| (50..450).contains(count)), "{met:?}");
}
