//! `ValidateGrasp` and `EvaluateHoldout`: found grasps are valid with the same figures, failed checks are named, and holdouts are rated by
//! how many known grips remain valid.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, validate_grasp_request};
use grasp_synthesis::{base::pose::Pose, model::hand::joints::HandJoints};
use grasp_tests::{
    TestServer,
    recorded::{data_folder_or_skip, read_poses},
    wire_pose,
};
use tonic::transport::Channel;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{built_in_request, find, floating_remote, hand, held_remote, impossible, with},
};

type Client = GraspServiceClient<Channel>;

/// A request to check a posed hand.
fn request(holdout: v1::FindGraspRequest, pose: v1::HandPose) -> v1::ValidateGraspRequest {
    v1::ValidateGraspRequest::from(holdout).with_pose(pose)
}

/// A request to check tracked joints.
fn of_joints(holdout: v1::FindGraspRequest, joints: v1::HandJoints) -> v1::ValidateGraspRequest {
    v1::ValidateGraspRequest {
        grasp: Some(validate_grasp_request::Grasp::Joints(joints)),
        ..holdout.into()
    }
}

async fn validated(client: &mut Client, request: v1::ValidateGraspRequest) -> v1::ValidateGraspResponse {
    let answer = client.validate_grasp(request).await;
    answer.expect("the request is valid").into_inner()
}

fn verdict(answer: &v1::ValidateGraspResponse, check: v1::Check) -> &v1::Verdict {
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
    // Distance from the shoulder to the wrist, less both bones.
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
            // The same hand can be a giver, also as WebXR sends it, without the palm.
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

async fn evaluated(client: &mut Client, request: v1::EvaluateHoldoutRequest) -> v1::EvaluateHoldoutResponse {
    let answer = client.evaluate_holdout(request).await;
    answer.expect("the request is valid").into_inner()
}

/// The known grasps of a rating, and how many of them are valid.
fn counts(rating: &v1::HoldoutRating) -> (u32, u32) {
    let sides = rating.sides.iter();
    sides.fold((0, 0), |(known, valid), side| {
        (known + side.known, valid + side.valid)
    })
}

fn valid_share(rating: &v1::HoldoutRating) -> f32 {
    let (known, valid) = counts(rating);
    valid as f32 / known.max(1) as f32
}

fn is_receivable(rating: &v1::HoldoutRating) -> bool {
    rating.no_grasp() == v1::Check::Unspecified
}

/// The counts of a rating agree with each other.
fn assert_consistent(rating: &v1::HoldoutRating) {
    assert_eq!(rating.sides.len(), 6);
    let (known, valid) = counts(rating);
    let hindered: u64 = rating.hindrances.iter().map(|hindrance| hindrance.count).sum();
    assert_eq!(hindered, u64::from(known - valid), "{rating:?}");
    assert!(is_receivable(rating) || valid == 0, "{rating:?}");
    let best = rating
        .sides
        .iter()
        .map(|side| side.best_score)
        .fold(0.0, f32::max);
    assert!(rating.best_score >= best);
    for side in &rating.sides {
        let v1::Vector3 { x, y, z } = side.direction.expect("a side has a direction");
        let mut lengths = [x, y, z].map(f32::abs);
        lengths.sort_by(f32::total_cmp);
        assert_eq!(lengths, [0.0, 0.0, 1.0]);
        assert!(side.valid <= side.known && (side.valid > 0) == (side.best_score > 0.0));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn givers_and_obstacles_take_grips_away() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let mut client = server.grasps().await;
    let right = |request: v1::FindGraspRequest| {
        v1::EvaluateHoldoutRequest::from(request.receiving(v1::Handedness::Right))
    };
    let free = evaluated(&mut client, right(floating_remote())).await;
    let [free_rating] = free.ratings.as_slice() else {
        panic!("{free:?}")
    };
    assert_consistent(free_rating);
    let (free_known, free_valid) = counts(free_rating);
    assert!(is_receivable(free_rating) && free_known > 100 && valid_share(free_rating) > 0.5);
    let [atlas] = free.atlases.as_slice() else {
        panic!("{:?}", free.atlases)
    };
    assert_eq!(atlas.name, "objects/remote/atlases/right");
    let remotes: Vec<_> = holdouts()
        .iter()
        .filter(|holdout| holdout.object == "remote")
        .collect();
    let giver = |request: v1::FindGraspRequest| request.holdout?.presenting_hand;
    let held = v1::EvaluateHoldoutRequest {
        other_presenting_hands: remotes[1..]
            .iter()
            .filter_map(|holdout| giver(built_in_request(holdout)))
            .collect(),
        ..right(built_in_request(remotes[0]))
    };
    let answer = evaluated(&mut client, held).await;
    for rating in &answer.ratings {
        assert_consistent(rating);
        let (known, valid) = counts(rating);
        assert_eq!(known, free_known);
        assert!(valid < free_valid);
        assert_eq!(rating.hindrances[0].check(), v1::Check::GiverClearance);
    }
    // Each giver's hand is rated once, and the best come first.
    let mut hands: Vec<_> = answer
        .ratings
        .iter()
        .map(|rating| rating.presenting_hand as usize)
        .collect();
    hands.sort_unstable();
    assert_eq!(hands, (0..remotes.len()).collect::<Vec<_>>());
    let order = |rating: &v1::HoldoutRating| (is_receivable(rating), valid_share(rating), rating.best_score);
    assert!(
        answer.ratings.is_sorted_by(|a, b| order(a) >= order(b)),
        "{:?}",
        answer.ratings
    );
    // Both hands together have more known grips than one.
    let both = evaluated(&mut client, built_in_request(remotes[0]).into()).await;
    assert!(counts(&both.ratings[0]).0 > free_known);
    let handedness: Vec<_> = both.atlases.iter().map(v1::Atlas::handedness).collect();
    assert_eq!(handedness.len(), 2);
    assert_ne!(handedness[0], handedness[1]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_known_grips_a_search_decides() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let free = evaluated(&mut client, floating_remote().into()).await;
    let rating = &free.ratings[0];
    assert_consistent(rating);
    assert!(is_receivable(rating) && rating.best_score > 0.0);
    assert_eq!(counts(rating), (0, 0));
    assert_eq!(free.atlases, []);
    let untouchable = impossible(&server).await.with_budget(Duration::from_millis(30));
    let answer = evaluated(&mut client, untouchable.into()).await;
    assert_eq!(answer.ratings[0].no_grasp(), v1::Check::Holdable);
}
