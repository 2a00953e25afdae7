//! The physical checks over the wire, judged from the answers alone with code that the search does not use.

use std::time::Duration;

use glam::{DVec3, Vec3};
use grasp_assets::{holdouts::holdout, objects::object};
use grasp_client::{GraspClient, built_in::request_for};
use grasp_proto::v1;
use grasp_synthesis::geometry::mesh::TriangleMesh;
use grasp_tests::TestServer;

use crate::parts::{hand, reproducible, with};

/// Holdouts that are answered quickly.
const HOLDOUTS: [&str; 4] = [
    "remote-genhold3",
    "scalpel-hold2",
    "scissors-hold1",
    "scissors-genhold1",
];

/// The contract's default friction.
const FRICTION: f64 = 0.6;

const GRAVITY: f64 = 9.81;

/// How deep the surface may be below the skin around the answered joints, in metres. The search allows 2 mm, but its
/// flesh is slimmer near the knuckles than a cone between them.
const DEEPEST: f64 = 0.003;

async fn ask(client: &GraspClient, name: &str, seed: u64) -> v1::FindGraspResponse {
    let request = request_for(holdout(name).expect("a built-in holdout"))
        .with_budget(Duration::from_secs(10))
        .with_seed(seed);
    client.find_grasp(&request).await.expect("a valid request")
}

/// The distance of a point from a mesh, over all triangles.
fn distance_to_mesh(mesh: &TriangleMesh, point: DVec3) -> f64 {
    (0..mesh.triangles().len())
        .map(|triangle| distance_to_triangle(mesh.corners(triangle).map(Vec3::as_dvec3), point))
        .fold(f64::INFINITY, f64::min)
}

/// By projection onto the plane and, if that falls outside, onto the edges.
fn distance_to_triangle([a, b, c]: [DVec3; 3], point: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|&(from, to)| (to - from).cross(point - from).dot(normal) >= 0.0);
    if inside {
        return (point - a).dot(normal).abs() / normal.length();
    }
    let to_edge = |from: DVec3, to: DVec3| {
        let along = ((point - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        (from + (to - from) * along).distance(point)
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[tokio::test(flavor = "multi_thread")]
async fn forces_inside_their_cones_hold_the_weight() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for name in HOLDOUTS {
        let answer = ask(&client, name, 1).await;
        assert_eq!(
            answer.outcome(),
            v1::Outcome::Found,
            "{name}: {:?}",
            answer.report
        );
        let grasp = answer.grasp().expect("a grasp");
        let margin = |check| grasp.margin(check).expect("margins of a physical grasp");
        let (residual, epsilon) = (margin(v1::Check::Balance), margin(v1::Check::Closure));
        let built_in = holdout(name).expect("a built-in holdout");
        let about = &object(&built_in.object).expect("a built-in object").object;
        // Closure: 0.02, or for objects too thin for that, a quarter of what friction can do at the surface.
        let half = about.bounding_box.half_extents;
        let thickness = 0.5 * (half.x + half.y + half.z - half.max_element());
        let reachable = 0.25 * about.friction.unwrap_or(0.6) * thickness / half.length();
        assert!(
            residual <= 0.02 && epsilon >= reachable.min(0.02),
            "{name}: {residual}, {epsilon}, {reachable}"
        );

        let weight = f64::from(about.mass) * GRAVITY;
        let up = (built_in.world_from_object.orientation.inverse() * Vec3::Y).as_dvec3();
        let (mut force, mut torque) = (DVec3::ZERO, DVec3::ZERO);
        for contact in &grasp.contacts {
            let pushes = contact.force().as_dvec3();
            let normal = contact.normal().as_dvec3();
            let pressing = -pushes.dot(normal);
            let rubbing = (pushes + normal * pressing).length();
            // A contact that is not needed carries no force.
            assert!(
                pressing >= 0.0 && pushes.length() <= 27.0 + 1e-3,
                "{name}: {pushes}"
            );
            assert!(
                rubbing <= FRICTION * pressing * (1.0 + 1e-3) + 1e-6,
                "{name}: {rubbing} N at {pressing} N"
            );
            let lever = contact.position().as_dvec3() - about.centre_of_mass.as_dvec3();
            force += pushes;
            torque += lever.cross(pushes) - normal * f64::from(contact.torsion);
            assert!(
                distance_to_mesh(about.surface.mesh(), contact.position().as_dvec3()) < 1e-5,
                "{name}"
            );
        }
        let length = f64::from(about.bounding_box.half_extents.length());
        let left = ((force - up * weight).length_squared() + (torque / length).length_squared()).sqrt();
        assert!(
            left <= 0.02 * weight,
            "{name}: {:.1} % unbalanced",
            100.0 * left / weight
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bones_stay_their_radius_less_soft_flesh_away_from_the_object() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for name in HOLDOUTS {
        let answer = ask(&client, name, 2).await;
        let grasp = answer
            .grasp()
            .unwrap_or_else(|| panic!("{name}: {:?}", answer.report));
        let built_in = holdout(name).expect("a built-in holdout");
        let object_from_world = built_in.world_from_object.inverse();
        let mesh = object(&built_in.object)
            .expect("a built-in object")
            .object
            .surface
            .mesh();
        // The OpenXR joints of each finger and of the thumb, metacarpal to tip.
        for chain in [2..=5, 6..=10, 11..=15, 16..=20, 21..=25] {
            let joints: Vec<_> = chain.map(|index| &hand(grasp).joints[index]).collect();
            for bone in joints.windows(2) {
                for step in 0..10 {
                    let share = step as f32 / 10.0;
                    let at = bone[0].position().lerp(bone[1].position(), share);
                    let radius = bone[0].radius + (bone[1].radius - bone[0].radius) * share;
                    let distance = distance_to_mesh(mesh, object_from_world.transform_point(at).as_dvec3());
                    // The last millimetres of a tip are rounder than a cone.
                    let is_tip = std::ptr::eq(bone[1], joints[joints.len() - 1]) && step > 6;
                    assert!(
                        is_tip || distance >= f64::from(radius) - DEEPEST,
                        "{name}: {:.1} mm deep",
                        1e3 * (f64::from(radius) - distance)
                    );
                }
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_physical_grasp_is_replayed_by_seed_and_attempt() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let first = ask(&client, "scissors-hold1", 3).await;
    let origin = first.origin.as_ref().expect("every answer has an origin");
    let request = request_for(holdout("scissors-hold1").expect("a built-in holdout"))
        .with_seed(origin.seed)
        .receiving(first.hand().expect("a grasp").handedness());
    let request = with(request, |request| {
        request.search_mut().replay_attempt = origin.attempt;
    });
    let again = client.find_grasp(&request).await.expect("a valid request");
    assert_eq!(again.grasps, first.grasps);
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_workers_gives_the_same_physical_grasp() {
    let mut grasps = Vec::new();
    for workers in [1, 3] {
        let server = TestServer::start_with(|config| config.workers = workers.try_into().unwrap()).await;
        let request = reproducible(request_for(
            holdout("scissors-hold1").expect("a built-in holdout"),
        ))
        .with_budget(Duration::from_secs(10))
        .with_seed(4);
        let answer = server
            .client()
            .await
            .find_grasp(&request)
            .await
            .expect("a valid request");
        assert!(answer.grasp().is_some(), "{answer:?}");
        grasps.push((answer.grasps, answer.origin));
        server.stop().await;
    }
    assert_eq!(grasps[0], grasps[1]);
}
