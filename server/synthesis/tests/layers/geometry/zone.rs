//! Zones against points sampled on triangles.

use crate::prelude::*;

/// Points along each side of a triangle.
const SAMPLES: usize = 60;

/// Longest side of the triangles: two points next to each other are closer than [`SPACING`].
const SIDE: f32 = 3.0;
const SPACING: f32 = 2.0 * SIDE / SAMPLES as f32;

fn vector(stream: &mut AttemptStream) -> Vec3 {
    stream.in_cube()
}

/// Zones of every kind.
fn zones(stream: &mut AttemptStream) -> [Zone; 5] {
    let turn = Pose::from_orientation(glam::Quat::from_scaled_axis(vector(stream) * 3.0));
    let mut radius = || stream.between(0.2, 1.2);
    let [ball, tube, x, y, z] = [(); 5].map(|()| radius());
    let radii = [(); 3].map(|()| radius());
    let points = [(); 3].map(|()| vector(stream));
    [
        Zone::Ball {
            centre: vector(stream),
            radius: ball,
        },
        Zone::Box(oriented_box(
            Pose::from_position(vector(stream)) * turn,
            Vec3::new(x, y, z),
        )),
        Zone::HalfSpace {
            point: vector(stream),
            normal: vector(stream).normalize_or(Vec3::X),
        },
        Zone::Tube {
            points: (0..4).map(|_| vector(stream)).collect(),
            radius: tube,
        },
        Zone::TaperedTube(
            (0..2)
                .map(|k| TaperedCapsule::new(points[k], points[k + 1], radii[k], radii[k + 1]))
                .collect(),
        ),
    ]
}

/// The same zone with a boundary farther out.
fn inflated(zone: &Zone, by: f32) -> Zone {
    match zone.clone() {
        Zone::Ball { centre, radius } => Zone::Ball {
            centre,
            radius: radius + by,
        },
        Zone::Box(of) => Zone::Box(OrientedBox {
            half_extents: of.half_extents + Vec3::splat(by),
            ..of
        }),
        Zone::HalfSpace { point, normal } => Zone::HalfSpace {
            point: point - normal * by,
            normal,
        },
        Zone::Tube { points, radius } => Zone::Tube {
            points,
            radius: radius + by,
        },
        Zone::TaperedTube(parts) => Zone::TaperedTube(
            parts
                .into_iter()
                .map(|part| TaperedCapsule {
                    start_radius: part.start_radius + by,
                    end_radius: part.end_radius + by,
                    ..part
                })
                .collect(),
        ),
    }
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
fn a_triangle_meets_a_zone_where_one_of_its_points_is_in_it() {
    let mut met = [0; 5];
    for attempt in 0..500 {
        let mut stream = AttemptStream::new(5, attempt);
        let middle = vector(&mut stream);
        let corners = [(); 3].map(|()| middle + vector(&mut stream) * 0.25 * SIDE);
        for (kind, zone) in zones(&mut stream).iter().enumerate() {
            let meets = zone.meets(corners);
            met[kind] += usize::from(meets);
            let any_in = |zone: &Zone| samples(corners).any(|point| zone.contains(point));
            if meets {
                assert!(any_in(&inflated(zone, SPACING)), "{zone:?} {corners:?}");
            } else {
                assert!(!any_in(&inflated(zone, -1e-5)), "{zone:?} {corners:?}");
            }
        }
    }
    // Both cases occur for every kind.
    assert!(met.iter().all(|count| (50..450).contains(count)), "{met:?}");
}

#[test]
fn a_scaled_zone_contains_the_scaled_points() {
    for attempt in 0..200 {
        let mut stream = AttemptStream::new(6, attempt);
        let scale = stream.between(0.3, 3.0);
        for zone in zones(&mut stream) {
            let point = vector(&mut stream);
            // Not at the boundary, where rounding decides.
            if inflated(&zone, 1e-4).contains(point) == inflated(&zone, -1e-4).contains(point) {
                assert_eq!(zone.scaled(scale).contains(point * scale), zone.contains(point));
            }
        }
    }
}
