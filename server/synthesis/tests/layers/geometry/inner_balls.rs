//! Balls inside meshes, against distances and winding numbers by brute force.

use grasp_synthesis::geometry::inner_balls::{Ball, inner_balls};

use crate::fixtures::meshes::solids;
use crate::prelude::*;

const COUNT: usize = 48;

fn balls_in(mesh: TriangleMesh) -> Vec<Ball> {
    inner_balls(&MeshBvh::build_quick(mesh), COUNT)
}

#[test]
fn balls_lie_inside_the_volume() {
    for (name, mesh) in solids() {
        let balls = balls_in(mesh.clone());
        assert!(
            !balls.is_empty() && balls.len() <= COUNT,
            "{name}: {}",
            balls.len()
        );
        for Ball { centre, radius } in balls {
            assert!(winding_number(&mesh, centre).abs() > 0.5, "{name}: {centre}");
            let distance = distance_to_mesh(&mesh, centre);
            assert!(distance >= f64::from(radius), "{name}: {distance}, not {radius}");
        }
    }
}

#[test]
fn the_largest_ball_is_first_and_fills_a_sphere() {
    let balls = balls_in(sphere(0.03, 20));
    assert!((balls[0].radius - 0.03).abs() < 5e-4, "{:?}", balls[0]);
    let boxed = balls_in(cuboid(Vec3::new(0.1, 0.02, 0.03), 10));
    assert!((boxed[0].radius - 0.02).abs() < 1e-4, "{:?}", boxed[0]);
    assert!(boxed.is_sorted_by(|a, b| a.radius >= b.radius));
}

#[test]
fn a_sheet_has_none() {
    assert_eq!(balls_in(sheet(0.1, 0.0, 8)), []);
}
