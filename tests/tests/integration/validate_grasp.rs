//! `ValidateGrasp`: found grasps are valid with the same figures, and what is wrong with others is named.

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, validate_grasp_request};
use grasp_synthesis::{base::pose::Pose, model::hand::joints::HandJoints};
use grasp_tests::{
    TestServer,
    recorded::{data_folder_or_skip, read_poses},
    wire_pose,
};
use tonic::transport::Channel;

use crate::fixtures::{find, floating_remote, hand, held_remote, with};

pub(crate) type Client = GraspServiceClient<Channel>;

/// A request to check a posed hand.
pub(crate) fn request(holdout: v1::FindGraspRequest, pose: v1::HandPose) -> v1::ValidateGraspRequest {
    v1::ValidateGraspRequest::from(holdout).with_pose(pose)
}

/// A request to check tracked joints.
fn of_joints(holdout: v1::FindGraspRequest, joints: v1::HandJoints) -> v1::ValidateGraspRequest {
    v1::ValidateGraspRequest {
        grasp: Some(validate_grasp_request::Grasp::Joints(joints)),
        ..holdout.into()
    }
}

pub(crate) async fn validated(
    client: &mut Client,
    request: v1::ValidateGraspRequest,
) -> v1::ValidateGraspResponse {
    let answer = client.validate_grasp(request).await;
    answer.expect("the request is valid").into_inner()
}

pub(crate) fn verdict(answer: &v1::ValidateGraspResponse, check: v1::Check) -> &v1::Verdict {
    let mut verdicts = answer.verdicts.iter();
    verdicts
        .find(|verdict| verdict.check() == check)
        .expect("every check has a verdict")
}

/// The checks that were failed.
fn failed(answer: &v1::ValidateGraspResponse) -> Vec<v1::Check> {
    let failed = answer.verdicts.iter().filter(|verdict| !verdict.passed);
    failed.map(v1::Verdict::check).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_check_is_made_although_others_fail() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let found = find(&server, held_remote()).await;
    // A hand moved 3 cm into the object, with a finger bent too far.
    let mut sunk = found.hand().expect("the remote can be taken").clone();
    let wrist = sunk.object_from_wrist.unwrap();
    let palm = wrist.orientation() * Vec3::NEG_Y;
    sunk.object_from_wrist = Some(v1::Pose::new(wrist.position() + 0.03 * palm, wrist.orientation()));
    sunk.middle.as_mut().unwrap().second_pitch = 2.5;
    // An obstacle around the whole hand, and another far away before it.
    let ball = |x: f32, radius: f32| {
        let end = |z: f32| Vec3::new(x, 1.2, z);
        v1::Shape::capsule(end(0.0), end(0.01), radius)
    };
    let shoulder = Vec3::new(2.0, 1.2, 0.0);
    let holdout = with(held_remote(), |request| {
        request.holdout_mut().obstacles = vec![ball(5.0, 0.1), ball(0.3, 0.5)];
        request.requirements_mut().thesis = Some(v1::ThesisOptions {
            max_comfort: Some(0.0),
            ..Default::default()
        });
        request.receiver = Some(v1::Receiver::with_shoulder(shoulder));
    });
    let answer = validated(&mut client, request(holdout, sunk)).await;
    let failed = failed(&answer);
    for check in [
        v1::Check::JointLimits,
        v1::Check::Penetration,
        v1::Check::ObstacleClearance,
        v1::Check::Reach,
    ] {
        assert!(failed.contains(&check), "{check:?} is not among {failed:?}");
    }
    assert!(!answer.valid && answer.grasp.as_ref().unwrap().score.is_none());
    let limits = verdict(&answer, v1::Check::JointLimits);
    assert!(
        limits
            .description
            .contains("second_pitch of the middle finger is 2.500 rad"),
        "{}",
        limits.description
    );
    let obstacle = verdict(&answer, v1::Check::ObstacleClearance);
    assert_eq!(obstacle.subject, "holdout.obstacles[1]");
    assert!(obstacle.value.unwrap() < -0.3);
    let giver = verdict(&answer, v1::Check::GiverClearance);
    assert_eq!(giver.subject, "holdout.presenting_hand");
    // From the shoulder to the wrist, less both bones.
    let wrist = answer.grasp.as_ref().unwrap().client_from_wrist().unwrap();
    let away = wrist.position().distance(shoulder);
    let reach = verdict(&answer, v1::Check::Reach).value.unwrap();
    assert!((reach - (away - 0.56)).abs() < 1e-4, "{reach} {away}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_grasp_near_a_wrong_one_is_found() {
    let (server, _folder) = crate::atlases::with_complete_atlas("remote").await;
    let mut client = server.grasps().await;
    let holdout = floating_remote();
    let found = find(&server, holdout.clone()).await;
    let grasp = found.grasp().expect("the remote can be taken");
    // Fingers opened: nothing touches.
    let opened = hand(grasp).digits().map(|digit| {
        Some(v1::DigitAngles {
            base_pitch: 0.0,
            second_pitch: 0.1,
            third_pitch: None,
            ..*digit?
        })
    });
    let opened = v1::HandPose {
        thumb: hand(grasp).thumb,
        ..hand(grasp).clone().with_digits(opened)
    };
    let nearest_budget = holdout.search.as_ref().unwrap().budget;
    let near = v1::ValidateGraspRequest {
        nearest_budget,
        ..request(holdout.clone(), opened)
    };
    let answer = validated(&mut client, near).await;
    assert!(!answer.valid && failed(&answer).contains(&v1::Check::Closure));
    let nearest = answer.nearest.expect("there are known grips");
    let motion = answer.nearest_motion.unwrap();
    let position = |grasp: &v1::Grasp| grasp.object_from_wrist().unwrap().position();
    assert!((position(&nearest).distance(position(grasp)) - motion.distance).abs() < 1e-5);
    assert!(motion.distance < 0.05 && motion.fingertips > 0.005, "{motion:?}");
    let again = validated(&mut client, request(holdout.clone(), hand(&nearest).clone())).await;
    assert!(again.valid, "{:#?}", again.verdicts);
    // A valid grasp needs none.
    let valid = v1::ValidateGraspRequest {
        nearest_budget,
        ..request(holdout, hand(grasp).clone())
    };
    let answer = validated(&mut client, valid).await;
    assert!(answer.valid && answer.nearest.is_none() && answer.nearest_motion.is_none());
    server.stop().await;
}

/// Joints as a headset sends them.
fn sent(joints: &HandJoints, handedness: v1::Handedness) -> v1::HandJoints {
    let joints = joints.joints.iter();
    let joints = joints.map(|joint| v1::JointPose::new(wire_pose(joint.pose), joint.radius));
    v1::HandJoints::new(handedness, joints.collect::<Vec<_>>())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_joints_of_a_found_grasp_are_valid() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let holdout = held_remote();
    let found = find(&server, holdout.clone()).await;
    let grasp = found.grasp().expect("the remote can be taken");
    let joints = v1::HandJoints::new(hand(grasp).handedness(), hand(grasp).joints.clone());
    let answer = validated(&mut client, of_joints(holdout, joints)).await;
    let farthest = answer.joint_error.expect("the grasp was given by joints");
    assert!(farthest < 1e-4, "{farthest}");
    let depth = |grasp: &v1::Grasp| grasp.margin(v1::Check::Penetration).unwrap();
    let seen = answer.grasp.as_ref().unwrap();
    assert!((depth(seen) - depth(grasp)).abs() < 1e-4);
}

#[tokio::test(flavor = "multi_thread")]
async fn recorded_hands_are_posed_with_the_rig() {
    let Some(folder) = data_folder_or_skip("recorded_hands_are_posed_with_the_rig") else {
        return;
    };
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let adult = grasp_assets::hands::hand("adult", grasp_synthesis::model::hand::Handedness::Right);
    let radii = adult.expect("the rig is built in").rig.joint_radii;
    for file in ["handy-work_poses.json", "godot_xr_tools_poses.json"] {
        for pose in read_poses(&folder.join("poses").join(file), &radii) {
            let side = match pose.joints.handedness {
                grasp_synthesis::model::hand::Handedness::Left => v1::Handedness::Left,
                grasp_synthesis::model::hand::Handedness::Right => v1::Handedness::Right,
            };
            let joints = sent(&pose.joints, side);
            let answer = validated(&mut client, of_joints(floating_remote(), joints)).await;
            let farthest = answer.joint_error.expect("the grasp was given by joints");
            // Hands differ in size, and the rig does not bend as far back as some poses.
            assert!(farthest < 0.04, "{}: {farthest} m", pose.name);
            assert!(verdict(&answer, v1::Check::JointLimits).passed, "{}", pose.name);
            assert_eq!(hand(&answer.grasp.unwrap()).handedness(), side);
            // As WebXR sends them, without the palm, they give.
            let elsewhere = Pose::new(Vec3::new(-0.2, 1.3, 0.5), Quat::from_rotation_z(2.0));
            let mut giver = sent(&pose.joints.transformed(elsewhere), side);
            giver.joints.remove(0);
            let held = with(floating_remote().with_presenting_hand(giver), |request| {
                request.search_mut().max_attempts = Some(1);
            });
            find(&server, held).await;
        }
    }
}
