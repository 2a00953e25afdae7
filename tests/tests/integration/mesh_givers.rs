//! Givers of whom only the mesh is known, judged by the mesh itself.

use std::time::Duration;

use glam::Vec3;
use grasp_assets::{
    hands,
    holdouts::{BuiltInHoldout, holdouts},
};
use grasp_client::built_in::request_for;
use grasp_proto::v1;
use grasp_synthesis::{
    geometry::mesh::TriangleMesh,
    model::hand::joints::{HandJoints, index},
};
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{blamed_fields, bounded, floating_remote},
    own_models::winding,
    parts::{hand, with},
};

/// The joints of a hand in the order of `OpenXR`, from the knuckles to the tips: each digit's chain.
const CHAINS: [&[usize]; 5] = [
    &[3, 4, 5],
    &[7, 8, 9, 10],
    &[12, 13, 14, 15],
    &[17, 18, 19, 20],
    &[22, 23, 24, 25],
];

/// Index of the middle finger's knuckle.
const MIDDLE_KNUCKLE: usize = 12;

/// A hand of which only the mesh is known.
#[derive(Clone)]
struct Skin {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    client_from_wrist: Option<v1::Pose>,
}

impl From<&Skin> for v1::PresentingHand {
    fn from(skin: &Skin) -> Self {
        let mesh = v1::HandMesh::new(skin.positions.iter().copied(), skin.triangles.iter().copied());
        let client_from_wrist = skin.client_from_wrist;
        v1::HandMesh {
            client_from_wrist,
            ..mesh
        }
        .into()
    }
}

/// The giver's skin as a viewer draws it.
fn giver_mesh(holdout: &BuiltInHoldout) -> Skin {
    let giver = hands::hand(&holdout.giver_rig, holdout.giver_handedness).expect("the rig is built in");
    let joints = HandJoints::of_pose(&giver.rig, &holdout.giver_pose());
    let wrist = joints.joints[index::WRIST].pose;
    Skin {
        positions: giver.skin.posed(&joints),
        triangles: giver.skin.triangles.clone(),
        client_from_wrist: Some(v1::Pose::new(wrist.position, wrist.orientation)),
    }
}

/// How deep the bones of the receiver's digits, as thick as the answer says, are in the mesh of the giver, in metres: by all
/// vertices, and by the winding number around points on the bones.
fn overlap(mesh: &Skin, grasp: &v1::Grasp) -> f32 {
    let surface = TriangleMesh::without_degenerates(mesh.positions.clone(), &mesh.triangles)
        .expect("the skin is a mesh");
    let mut deepest = 0.0_f32;
    for chain in CHAINS {
        let joint = |index: usize| {
            let joint = &hand(grasp).joints[index];
            (joint.position(), joint.radius)
        };
        let mut joints: Vec<(Vec3, f32)> = chain.iter().map(|&index| joint(index)).collect();
        // The tip is on the skin.
        if let [.., (before, _), (tip, radius)] = &mut joints[..] {
            *tip += (*before - *tip).normalize_or_zero() * *radius;
        }
        for bone in joints.windows(2) {
            let ((start, start_radius), (end, end_radius)) = (bone[0], bone[1]);
            for step in 0..=10_u8 {
                let along = f32::from(step) / 10.0;
                let centre = start.lerp(end, along);
                let radius = start_radius + (end_radius - start_radius) * along;
                let nearest = mesh
                    .positions
                    .iter()
                    .map(|vertex| vertex.distance(centre))
                    .fold(f32::INFINITY, f32::min);
                let is_inside = nearest < 0.05 && winding(&surface, centre).abs() > 0.5;
                deepest = deepest.max(if is_inside {
                    radius + nearest
                } else {
                    radius - nearest
                });
            }
        }
    }
    deepest
}

/// A closed mesh of eight triangles around a point.
fn octahedron(centre: Vec3, radius: f32) -> Skin {
    let directions = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let octants = [[0, 3], [1, 4], [2, 5]];
    let corner = |octant: usize, axis: usize| octants[axis][octant >> axis & 1];
    Skin {
        positions: directions.map(|direction| centre + direction * radius).into(),
        triangles: (0..8)
            .map(|octant| [0, 1, 2].map(|axis| corner(octant, axis)))
            .collect(),
        client_from_wrist: None,
    }
}

fn request(holdout: &BuiltInHoldout, giver: Option<&Skin>) -> v1::FindGraspRequest {
    let request = with(request_for(holdout), |request| {
        request.holdout_mut().presenting_hand = giver.map(v1::PresentingHand::from);
    });
    request
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(10))
        .with_seed(1)
}

#[tokio::test(flavor = "multi_thread")]
async fn grasps_keep_clear_of_a_givers_mesh() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut without_giver = Vec::new();
    for holdout in holdouts().iter().step_by(2) {
        let mesh = giver_mesh(holdout);
        let found = client.find_grasp(&request(holdout, Some(&mesh))).await.unwrap();
        let grasp = found
            .grasp()
            .unwrap_or_else(|| panic!("{}: {:?}", holdout.name, found.report));
        assert!(
            grasp.margin(v1::Check::GiverClearance) >= Some(0.001),
            "{}: {:?}",
            holdout.name,
            grasp.margins
        );
        let deep = overlap(&mesh, grasp);
        assert!(deep <= 0.0, "{}: {deep} m", holdout.name);
        let free = client.find_grasp(&request(holdout, None)).await.unwrap();
        without_giver.extend(free.grasp().map(|grasp| overlap(&mesh, grasp)));
    }
    // Whoever does not look at the giver touches it often.
    let touched = without_giver.iter().filter(|&&deep| deep > 0.005).count();
    assert!(2 * touched > without_giver.len(), "{without_giver:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_with_a_hole_at_the_wrist_is_as_good_and_may_be_the_second_hand() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let holdout = &holdouts()[0];
    let mut mesh = giver_mesh(holdout);
    let wrist = mesh.client_from_wrist.expect("it is known").position();
    let whole = mesh.triangles.len();
    let positions = &mesh.positions;
    mesh.triangles.retain(|corners| {
        corners
            .iter()
            .all(|&corner| positions[corner as usize].distance(wrist) > 0.035)
    });
    assert!(mesh.triangles.len() < whole);
    let mut request = request(holdout, Some(&mesh));
    let found = client.find_grasp(&request).await.unwrap();
    let grasp = found.grasp().expect("there is one");
    assert!(overlap(&mesh, grasp) <= 0.0);

    // The second hand is a paw where the first answer was.
    let paw = octahedron(hand(grasp).joints[MIDDLE_KNUCKLE].position(), 0.04);
    assert!(overlap(&paw, grasp) > 0.0);
    request.holdout_mut().other_hands.push((&paw).into());
    let second = client.find_grasp(&request).await.unwrap();
    if let Some(grasp) = second.grasp() {
        assert!(overlap(&mesh, grasp) <= 0.0 && overlap(&paw, grasp) <= 0.0);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn loose_triangles_are_no_hand() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let loose = |count: u16| {
        let corner = |number: u16| {
            let place = f32::from(number) * 1e-4;
            [place, 0.0, 0.0, place, 0.1, 0.0, place, 0.0, 0.1]
        };
        v1::HandMesh {
            client_coordinates: (0..count).flat_map(corner).collect(),
            triangles: (0..3 * u32::from(count)).collect(),
            client_from_wrist: None,
        }
    };
    let request = |mesh: v1::HandMesh| floating_remote().with_presenting_hand(mesh);
    let refused = client.find_grasp(request(loose(1000))).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
    assert_eq!(blamed_fields(&refused), ["holdout.presenting_hand.mesh"]);
    let flat = v1::HandMesh {
        client_coordinates: vec![0.0; 9],
        triangles: vec![0, 1, 2],
        client_from_wrist: None,
    };
    let refused = client.find_grasp(request(flat)).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
    // A few are a bad hand, but one that can be kept clear of.
    bounded("an answer", client.find_grasp(request(loose(30))))
        .await
        .unwrap();
    server.stop().await;
}
