//! `ValidateGrasp`: found grasps are valid with the same figures, and what is wrong with others is named.

use std::time::Duration;

use glam::Vec3;
use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, validate_grasp_request};
use grasp_synthesis::model::hand::joints::HandJoints;
use grasp_tests::{
    TestServer,
    recorded::{data_folder_or_skip, read_poses},
    wire_pose,
};
use tonic::transport::Channel;

use crate::{
    conventions::engines,
    fixtures::{built_in_request, floating_remote, held_remote},
    hooks::case,
    own_hands::new_rig,
    parts::{hand, with},
};

pub(crate) type Client = GraspServiceClient<Channel>;

/// How far margins may differ: single precision, on the way through the client's frame.
const ROUNDING: f32 = 2e-5;

/// The hand of a grasp without its place at the object.
pub(crate) fn in_client(grasp: &v1::Grasp) -> v1::HandPose {
    v1::HandPose {
        object_from_wrist: None,
        ..hand(grasp).clone()
    }
}

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

/// A metre in the unit of a convention's answers.
pub(crate) fn metre(convention: v1::Convention) -> f32 {
    match convention {
        v1::Convention::Unreal | v1::Convention::UnrealXzy => 100.0,
        _ => 1.0,
    }
}

/// The checks that were failed.
fn failed(answer: &v1::ValidateGraspResponse) -> Vec<v1::Check> {
    let failed = answer.verdicts.iter().filter(|verdict| !verdict.passed);
    failed.map(v1::Verdict::check).collect()
}

fn assert_same_figures(answer: &v1::ValidateGraspResponse, grasp: &v1::Grasp, what: &str) {
    assert!(answer.valid, "{what}: {:#?}", answer.verdicts);
    assert_eq!(answer.verdicts.len(), 12, "{what}");
    let seen = answer.grasp.as_ref().expect("the grasp is there");
    assert_eq!(seen.margins.len(), grasp.margins.len(), "{what}");
    for (expected, actual) in grasp.margins.iter().zip(&seen.margins) {
        assert_eq!(
            (expected.check, expected.passed),
            (actual.check, actual.passed),
            "{what}"
        );
        let check = expected.check();
        let [expected, actual] = [expected, actual].map(|margin| margin.value.expect("it was measured"));
        let slack = match check {
            // Exact to five hundredths, and contacts that moved by rounding may end its search a step later.
            v1::Check::Closure => 0.06 * expected,
            // Rounding turns contacts at edges by a millionth, and thin objects are squeezed with many times their weight.
            v1::Check::Balance => ROUNDING,
            _ => 0.0,
        };
        let unit = match check {
            v1::Check::Closure | v1::Check::Balance => 1.0,
            _ => metre(hand(grasp).convention()),
        };
        assert!(
            (expected - actual).abs() <= ROUNDING * unit + slack,
            "{what}: {check:?} is {actual}, was {expected}"
        );
        assert_eq!(verdict(answer, check).value, Some(actual), "{what}");
    }
    let (expected, actual) = (grasp.score.unwrap(), seen.score.unwrap());
    assert!(
        (expected - actual).abs() <= 101.0 * ROUNDING,
        "{what}: the score is {actual}, was {expected}"
    );
    assert_eq!(seen.contacts.len(), grasp.contacts.len(), "{what}");
    assert_eq!((seen.r#type, seen.hangs), (grasp.r#type, grasp.hangs), "{what}");
}

/// Finds a grasp, and checks it as it is, and by its place in the client's frame.
async fn assert_found_is_valid(client: &mut Client, holdout: &v1::FindGraspRequest, what: &str) -> bool {
    let found = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
    let Some(grasp) = found.grasp() else {
        return false;
    };
    for pose in [hand(grasp).clone(), in_client(grasp)] {
        let answer = validated(client, request(holdout.clone(), pose)).await;
        assert_same_figures(&answer, grasp, what);
    }
    true
}

#[tokio::test(flavor = "multi_thread")]
async fn found_grasps_are_valid_with_the_same_figures_in_every_convention() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let mut found = 0;
    let mut tried = 0;
    for (place, built_in) in holdouts().iter().enumerate() {
        for side in [v1::Handedness::Left, v1::Handedness::Right] {
            let openxr = built_in_request(built_in)
                .receiving(side)
                .with_budget(Duration::from_secs(3));
            let what = format!("{} {side:?}", built_in.name);
            tried += 1;
            found += usize::from(assert_found_is_valid(&mut client, &openxr, &what).await);
            // One engine each.
            let engines = engines();
            let engine = &engines[place % engines.len()];
            let converted = engine.request(&openxr);
            tried += 1;
            found += usize::from(assert_found_is_valid(&mut client, &converted, &what).await);
        }
    }
    assert!(2 * found > tried, "{found} of {tried}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn known_grasps_are_valid_with_the_same_figures() {
    let (server, _folder) = crate::atlases::with_complete_atlas("remote").await;
    let mut client = server.grasps().await;
    let remotes = holdouts().iter().filter(|holdout| holdout.object == "remote");
    let mut known = 0;
    for built_in in remotes {
        let holdout = built_in_request(built_in);
        let answer = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
        known += usize::from(answer.source() == v1::GraspSource::Atlas);
        let Some(grasp) = answer.grasp() else { continue };
        let answer = validated(&mut client, request(holdout, hand(grasp).clone())).await;
        assert_same_figures(&answer, grasp, &built_in.name);
    }
    assert!(known > 0);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn grasps_of_created_and_scaled_rigs_and_hooks_are_valid() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    server
        .client()
        .await
        .create_rig(&new_rig("mine", 1.1))
        .await
        .unwrap();
    let create = v1::CreateObjectRequest::new("case", case(), 2.0);
    server.objects().await.create_object(create).await.unwrap();
    let mine = with(floating_remote().receiving(v1::Handedness::Left), |request| {
        "rigs/mine".clone_into(&mut request.receiver_mut().rig);
    });
    assert!(assert_found_is_valid(&mut client, &mine, "a created rig").await);
    for without_thumb in [true, false] {
        let hooked = with(floating_remote(), |request| {
            request.holdout_mut().object = "objects/case".to_owned();
            if without_thumb {
                request.requirements_mut().must_not_touch = vec![v1::Digit::Thumb.into()];
            }
        });
        assert!(assert_found_is_valid(&mut client, &hooked, "a hook").await);
    }
    // The hand's size is part of the grasp.
    let scaled = with(floating_remote().receiving(v1::Handedness::Right), |request| {
        request.receiver_mut().scale = Some(0.8);
    });
    let found = client.find_grasp(scaled).await.unwrap().into_inner();
    let grasp = found.grasp().unwrap();
    assert_eq!(hand(grasp).scale, Some(0.8));
    let small = validated(&mut client, request(floating_remote(), hand(grasp).clone())).await;
    assert_same_figures(&small, grasp, "a small hand");
    let unscaled = v1::HandPose {
        scale: None,
        ..hand(grasp).clone()
    };
    let large = validated(&mut client, request(floating_remote(), unscaled)).await;
    assert!(!large.valid, "a larger hand is in the object");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_check_is_made_although_others_fail() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let found = client.find_grasp(held_remote()).await.unwrap().into_inner();
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
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_grasp_near_a_wrong_one_is_found() {
    let (server, _folder) = crate::atlases::with_complete_atlas("remote").await;
    let mut client = server.grasps().await;
    let holdout = floating_remote();
    let found = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
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
    let found = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
    let grasp = found.grasp().expect("the remote can be taken");
    let joints = v1::HandJoints::new(hand(grasp).handedness(), hand(grasp).joints.clone());
    let answer = validated(&mut client, of_joints(holdout, joints)).await;
    let farthest = answer.joint_error.expect("the grasp was given by joints");
    assert!(farthest < 1e-4, "{farthest}");
    let depth = |grasp: &v1::Grasp| grasp.margin(v1::Check::Penetration).unwrap();
    let seen = answer.grasp.as_ref().unwrap();
    assert!((depth(seen) - depth(grasp)).abs() < 1e-4);
    server.stop().await;
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
        }
    }
    server.stop().await;
}
