//! Real meshes, held by recorded hands, over real gRPC.
//!
//! Every request is kept as JSON in cargo's folder for temporary test files, for a look at its answer: create the
//! object with `grasp objects create`, then `grasp find --request FILE --png FILE`.

use std::{path::Path, time::Duration};

use glam::{Quat, Vec3};
use grasp_assets::hands::hand;
use grasp_cases::cases;
use grasp_client::{GraspClient, json::to_json};
use grasp_proto::v1;
use grasp_synthesis::model::hand::{Handedness, joints};
use grasp_tests::{
    TestServer,
    random_holdouts::{GiverPlacement, place_giver},
    recorded::{RecordedPose, data_folder_or_skip, object_of, read_poses},
    wire_pose,
};

/// Files of `objects/` with typical masses in kilograms.
const OBJECTS: [(&str, f32); 11] = [
    ("osim_banana", 0.12),
    ("osim_hammer", 0.5),
    ("osim_knife", 0.08),
    ("osim_mug", 0.3),
    ("osim_phone", 0.18),
    ("osim_scissors", 0.05),
    ("osim_toothbrush", 0.02),
    ("osim_wineglass", 0.15),
    ("xr_google-daydream", 0.04),
    ("xr_logitech-mx-ink", 0.03),
    ("xr_oculus-go", 0.11),
];

/// Recorded poses whose fingers surround something.
const POSES: [(&str, &str, Handedness); 5] = [
    ("handy-work_poses.json", "relax", Handedness::Right),
    ("handy-work_poses.json", "fist", Handedness::Left),
    ("godot_xr_tools_poses.json", "Grip 5", Handedness::Right),
    ("godot_xr_tools_poses.json", "Pinch Large", Handedness::Right),
    ("godot_xr_tools_poses.json", "Cup", Handedness::Left),
];

/// Least number of poses with a grasp, per object.
const ANSWERED_AT_LEAST: usize = 3;

/// Fewest poses that are tried.
const FEW_POSES: usize = 12;

fn recorded_poses(folder: &Path) -> Vec<RecordedPose> {
    let adult = hand("adult", Handedness::Right).expect("the adult rig is built in");
    POSES
        .iter()
        .map(|&(file, name, handedness)| {
            read_poses(&folder.join("poses").join(file), &adult.rig.joint_radii)
                .into_iter()
                .find(|pose| pose.name == name && pose.joints.handedness == handedness)
                .unwrap_or_else(|| panic!("{file} has no {handedness:?} {name}"))
        })
        .collect()
}

/// The pose of the object for a giver at -Z, whose forearm comes from there and slightly from below.
fn client_from_object(placement: &GiverPlacement) -> v1::Pose {
    let forearm = placement.object_from_wrist.transform_vector(Vec3::Z);
    let orientation = Quat::from_rotation_arc(forearm, Vec3::new(0.0, -0.3, -1.0).normalize_or(Vec3::NEG_Z));
    v1::Pose::new(Vec3::new(0.1, 1.2, 0.4), orientation)
}

fn webxr_joints(
    pose: &RecordedPose,
    placement: &GiverPlacement,
    client_from_object: v1::Pose,
) -> v1::HandJoints {
    let handedness = match pose.joints.handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    };
    let joints = pose.joints.joints[joints::index::WRIST..].iter().map(|joint| {
        let object_from_joint = wire_pose(placement.object_from_wrist * joint.pose);
        v1::JointPose::new(client_from_object * object_from_joint, joint.radius)
    });
    v1::HandJoints::new(handedness, joints.collect::<Vec<_>>())
}

/// Asks with strategy F, then with D where F finds nothing in time.
async fn ask(
    client: &GraspClient,
    object: &str,
    giver: v1::HandJoints,
    client_from_object: v1::Pose,
) -> (v1::FindGraspRequest, v1::FindGraspResponse) {
    let mut request = v1::FindGraspRequest::new(object)
        .with_client_from_object(client_from_object)
        .with_presenting_hand(giver)
        .with_budget(Duration::from_secs(5))
        .with_seed(1);
    let mut with_strategy = async |strategy: v1::Strategy| {
        request.requirements_mut().thesis = Some(v1::ThesisOptions {
            strategy: strategy.into(),
            ..Default::default()
        });
        client.find_grasp(&request).await.expect("the request is valid")
    };
    let mut answer = with_strategy(v1::Strategy::F).await;
    if answer.outcome() != v1::Outcome::Found {
        answer = with_strategy(v1::Strategy::D).await;
    }
    // A replay of the winning attempt gives the same grasp.
    request.search_mut().replay_attempt = answer.origin.as_ref().and_then(|origin| origin.attempt);
    request.receiver_mut().handedness = answer.hand().map_or(0, |hand| hand.handedness);
    (request, answer)
}

/// Saves a request for people to look at.
fn keep(name: &str, request: &v1::FindGraspRequest) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("real-input");
    std::fs::create_dir_all(&folder).expect("the folder for temporary files can be written");
    let json = to_json(request).expect("it is a message of the contract");
    let json = format!("{json:#}");
    std::fs::write(folder.join(format!("{}.json", name.replace(' ', "_"))), json).expect("it can be written");
}

#[tokio::test(flavor = "multi_thread")]
async fn every_real_mesh_is_received_from_recorded_givers() {
    let Some(folder) = data_folder_or_skip("every_real_mesh_is_received_from_recorded_givers") else {
        return;
    };
    let server = TestServer::start().await;
    let client = server.client().await;
    let mut poses = recorded_poses(&folder);
    let every = poses.len() / (cases(poses.len() as u32) as usize).max(FEW_POSES);
    let mut place = 0..;
    poses.retain(|_| {
        place
            .next()
            .is_some_and(|place: usize| place.is_multiple_of(every.max(1)))
    });
    let mut failures = Vec::new();
    for (file, mass) in OBJECTS {
        let obj =
            std::fs::read(folder.join("objects").join(format!("{file}.obj"))).expect("the mesh is there");
        let id = file.replace('_', "-");
        let created = client
            .create_object(&v1::CreateObjectRequest::new(&id, obj.as_slice(), mass))
            .await
            .unwrap_or_else(|error| panic!("{file} cannot be created: {error}"));
        let object = object_of(&obj, mass);
        assert_eq!(
            created.triangle_count as usize,
            object.surface.mesh().triangles().len(),
            "{file}"
        );

        let mut answered = 0;
        for (seed, pose) in poses.iter().enumerate() {
            let placement = place_giver(&object, &pose.joints, seed as u64);
            let client_from_object = client_from_object(&placement);
            let giver = webxr_joints(pose, &placement, client_from_object);
            let (request, answer) = ask(&client, &created.name, giver, client_from_object).await;
            keep(
                &format!("{file} {} {:?}", pose.name, pose.joints.handedness),
                &request,
            );
            println!(
                "{file} held by {:?} {}: {} digits touch, {:.1} mm deep; {:?} after {} attempts",
                pose.joints.handedness,
                pose.name,
                placement.touching_digits,
                placement.penetration * 1000.0,
                answer.outcome(),
                answer.attempts(),
            );
            if let Some(grasp) = answer.grasp() {
                answered += 1;
                assert!(grasp.contacts.len() >= 2, "{file}, {}", pose.name);
            }
        }
        if answered < ANSWERED_AT_LEAST {
            failures.push(format!("{file}: {answered} of {}", poses.len()));
        }
    }
    assert!(failures.is_empty(), "too few givers were answered: {failures:?}");
}
