//! Closest points of a mesh against all of its triangles.

use crate::prelude::*;

fn compare(name: &str, mesh: &TriangleMesh, bvh: &MeshBvh, count: usize) {
    let mut random = Random::new(3);
    let size = mesh.aabb().diagonal();
    for i in 0..count {
        let point = match random.index(3) {
            0 => random.near(mesh, 0.05),
            1 => random.on_surface(mesh).0,
            _ => random.on_surface(mesh).0 + random.direction() * random.between(0.0, 0.002),
        };
        let expected = distance_to_mesh(mesh, point);
        // Rounding of the closest point's coordinates.
        let tolerance = f64::from(f32::EPSILON * (point.length() + size)) + 1e-6 * expected;
        let limit = [f32::MAX.sqrt(), 0.08, 0.004][random.index(3)];
        match bvh.closest_point_within(point, limit) {
            Some(found) => {
                assert!(found.distance <= limit, "{name} {i}: {found:?}");
                let distance = f64::from(found.distance);
                assert!(
                    (distance - expected).abs() <= tolerance,
                    "{name} {i}: {point} {found:?}, brute force says {expected}"
                );
                assert!(
                    (f64::from(point.distance(found.position)) - distance).abs() <= tolerance,
                    "{name} {i}: {point} {found:?}"
                );
                let off = oracle::distance_to_triangle(mesh.corners(found.triangle as usize), found.position);
                assert!(off <= tolerance, "{name} {i} {found:?} {off}");
            }
            None => assert!(
                expected > f64::from(limit) - tolerance,
                "{name} {i}: {point} is {expected} m away, within {limit} m"
            ),
        }
    }
}

#[test]
fn closest_points_match_brute_force() {
    for (name, mesh) in meshes::all() {
        compare(name, &mesh, &MeshBvh::build(mesh.clone()), cases(10_000) as usize);
        compare(
            name,
            &mesh,
            &MeshBvh::build_quick(mesh.clone()),
            cases(2_000) as usize,
        );
    }
}

#[test]
fn closest_points_of_real_objects_match_brute_force() {
    for (name, mesh) in real_objects() {
        compare(&name, &mesh, &MeshBvh::build(mesh.clone()), cases(1_000) as usize);
    }
}

#[test]
fn the_distance_limit_is_inclusive() {
    let bvh = MeshBvh::build(cuboid(Vec3::splat(0.25), 2));
    let point = Vec3::new(0.5, 0.125, 0.0);
    assert_eq!(
        bvh.closest_point_within(point, 0.25).map(|found| found.distance),
        Some(0.25)
    );
    assert_eq!(bvh.closest_point_within(point, 0.249_99), None);
    let on_surface = Vec3::new(0.25, 0.125, 0.0);
    assert_eq!(
        bvh.closest_point_within(on_surface, 0.0)
            .map(|found| found.position),
        Some(on_surface)
    );
}
