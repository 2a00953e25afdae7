//! The distance between opposed places against closed forms and all pairs of triangles.

use grasp_synthesis::geometry::opposed::{OPPOSED_ACCURACY, OpposedDistance, opposed_distance};

use crate::prelude::*;

/// Distance of a mesh's opposed places, which must be neither close nor beyond a metre.
fn apart(mesh: &TriangleMesh) -> f32 {
    match unstopped(|stop| opposed_distance(mesh, |_| true, 0.0, 1.0, stop)) {
        OpposedDistance::Apart(metres) => metres,
        other => panic!("{other:?}"),
    }
}

/// The least distance between points of opposed triangles, over all pairs: not less than the true one.
fn of_all_pairs(mesh: &TriangleMesh) -> f32 {
    let points = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        [a, b, c, (a + b + c) / 3.0]
    };
    let mut least = f32::INFINITY;
    for i in 0..mesh.triangles().len() {
        for j in 0..i {
            if mesh.normal(i).dot(mesh.normal(j)) < -2e-3 {
                for p in points(i) {
                    least = points(j)
                        .into_iter()
                        .fold(least, |least, q| least.min(p.distance(q)));
                }
            }
        }
    }
    least
}

#[test]
fn opposed_faces_of_a_turned_box_are_its_shortest_edge_apart() {
    for cells in [1, 5] {
        let mesh = cuboid(Vec3::new(0.2, 0.15, 0.3), cells);
        let mesh = moved(
            &mesh,
            Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.4),
            Vec3::ONE,
        );
        let distance = apart(&mesh);
        assert!((distance - 0.3).abs() < 0.3 * OPPOSED_ACCURACY, "{distance}");
    }
}

#[test]
fn agrees_with_all_pairs_of_triangles() {
    let meshes = [
        sphere(0.1, 10),
        torus(0.2, 0.06, 10),
        cylinder_mesh(0.1, 0.2, 18, 4),
    ];
    for mesh in meshes {
        let (distance, least) = (apart(&mesh), of_all_pairs(&mesh));
        assert!(distance <= least * (1.0 + OPPOSED_ACCURACY), "{distance} {least}");
        // Points are up to a triangle's size from the nearest ones.
        assert!(distance > 0.6 * least, "{distance}, {least}");
    }
}

#[test]
fn one_thin_place_of_a_large_surface_is_enough() {
    let mesh = cuboid(Vec3::new(0.3, 0.3, 0.04), 8);
    assert_eq!(
        unstopped(|stop| opposed_distance(&mesh, |_| true, 0.1, 0.5, stop)),
        OpposedDistance::CloseOrUnknown
    );
    let is_edge = |triangle: u32| mesh.normal(triangle as usize).z.abs() < 0.5;
    assert_eq!(
        unstopped(|stop| opposed_distance(&mesh, is_edge, 0.1, 0.5, stop)),
        OpposedDistance::BeyondLimit
    );
    assert_eq!(
        unstopped(|stop| opposed_distance(&mesh, |_| false, 0.1, 0.5, stop)),
        OpposedDistance::BeyondLimit
    );
}
