//! Balls inside meshes, against distances and winding numbers by brute force.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{
        inner_balls::{Ball, inner_balls},
        mesh::TriangleMesh,
        mesh_bvh::MeshBvh,
    },
    model::hand::{HandPose, joints::HandJoints},
};

use crate::fixtures::{
    hands::built_in_hand,
    meshes::{gridded_box, sheet, solids, sphere},
    oracle::{distance_to_mesh, winding_number},
    random::Random,
};

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
    let boxed = balls_in(gridded_box(Vec3::new(0.1, 0.02, 0.03), 10));
    assert!((boxed[0].radius - 0.02).abs() < 1e-4, "{:?}", boxed[0]);
    assert!(boxed.is_sorted_by(|a, b| a.radius >= b.radius));
}

#[test]
fn a_sheet_has_none() {
    assert_eq!(balls_in(sheet(0.1, 0.0, 8)), []);
}

#[test]
fn balls_fill_most_of_a_hand() {
    let hand = built_in_hand("adult", grasp_synthesis::model::hand::Handedness::Right);
    let joints = HandJoints::of_pose(
        &hand.rig,
        &HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: hand.rig.stretched(),
        },
    );
    let mesh = TriangleMesh::without_degenerates(hand.skin.posed(&joints), &hand.skin.triangles)
        .expect("the skin is a mesh");
    let balls = balls_in(mesh.clone());
    let mut random = Random::new(3);
    let (mut inside, mut covered) = (0, 0);
    while inside < 300 {
        let point = random.near(&mesh, 0.0);
        if winding_number(&mesh, point).abs() < 0.5 {
            continue;
        }
        inside += 1;
        covered += u32::from(balls.iter().any(|ball| ball.centre.distance(point) < ball.radius));
    }
    assert!(covered > 150, "{covered} of {inside}");
}
