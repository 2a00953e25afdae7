//! The physical checks over the wire, judged from the answers alone with code that the search does not use.

use std::time::Duration;

use glam::{DVec3, Vec3};
use grasp_assets::{holdouts::holdout, objects::object};
use grasp_client::built_in::request_for;
use grasp_proto::v1;
use grasp_synthesis::geometry::mesh::TriangleMesh;
use grasp_tests::TestServer;

use crate::{fixtures::find, own_hands::distance_to_triangle};

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

/// A request for one of them.
fn request(name: &str) -> v1::FindGraspRequest {
    request_for(holdout(name).expect("a built-in holdout"))
        .with_budget(Duration::from_secs(10))
        .with_seed(1)
}

/// The distance of a point from a mesh, over all triangles.
fn distance_to_mesh(mesh: &TriangleMesh, point: Vec3) -> f32 {
    (0..mesh.triangles().len())
        .map(|triangle| distance_to_triangle(mesh.corners(triangle), point))
        .fold(f32::INFINITY, f32::min)
}

#[tokio::test(flavor = "multi_thread")]
async fn forces_inside_their_cones_hold_the_weight() {
    let server = TestServer::start().await;
    for name in HOLDOUTS {
        let answer = find(&server, request(name)).await;
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
                distance_to_mesh(about.surface.mesh(), contact.position()) < 1e-5,
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
