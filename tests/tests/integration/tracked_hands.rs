//! Tracked hands as headsets send them: lost joints are rejected by name, missing radii are repaired.

use glam::{Quat, Vec3};
use grasp_assets::hands::hand;
use grasp_proto::v1::{self, presenting_hand::Form};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{Handedness, joints::HandJoints},
};
use grasp_tests::{
    TestServer,
    recorded::{data_folder_or_skip, read_poses},
    wire_pose,
};

use crate::{
    fixtures::{assert_blamed, floating_remote, unaided},
    parts::{reproducible, with},
};

/// A request with the first attempt only: what is tested is whether the hand is accepted.
fn held_by(hand: &HandJoints, set: JointSet) -> v1::FindGraspRequest {
    let handedness = match hand.handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    };
    let joints = hand.joints[set.first()..]
        .iter()
        .map(|joint| v1::JointPose::new(wire_pose(joint.pose), joint.radius));
    let giver = v1::HandJoints::new(handedness, joints.collect::<Vec<_>>());
    with(floating_remote().with_presenting_hand(giver), |request| {
        request.search_mut().max_attempts = Some(1);
    })
}

/// Which joints a headset sends.
#[derive(Clone, Copy)]
enum JointSet {
    /// The 26 of `XR_EXT_hand_tracking`.
    OpenXr,
    /// The 25 of `WebXR`: without the palm.
    WebXr,
}

impl JointSet {
    /// The first among all 26.
    fn first(self) -> usize {
        match self {
            Self::OpenXr => 0,
            Self::WebXr => 1,
        }
    }
}

fn joints_of(request: &mut v1::FindGraspRequest) -> &mut Vec<v1::JointPose> {
    let giver = request.holdout_mut().presenting_hand.as_mut();
    match giver.and_then(|giver| giver.form.as_mut()) {
        Some(Form::Joints(joints)) => &mut joints.joints,
        _ => panic!("the request has joints"),
    }
}

/// A relaxed left hand, some way from the client's origin.
fn relaxed_hand() -> HandJoints {
    let rig = &hand("adult", Handedness::Left).expect("the rig is built in").rig;
    let pose = grasp_synthesis::model::hand::HandPose {
        frame_from_wrist: Pose::new(Vec3::new(0.3, 0.2, -0.35), Quat::from_rotation_x(1.2)),
        digits: rig.stretched(),
    };
    HandJoints::of_pose(rig, &pose)
}

#[tokio::test(flavor = "multi_thread")]
async fn every_lost_joint_is_named() {
    let server = TestServer::start().await;
    let lost = v1::Pose {
        position: Some(v1::Vector3::default()),
        orientation: None,
    };
    for places in [vec![10], vec![0], vec![1], vec![5, 8, 21]] {
        let mut request = held_by(&relaxed_hand(), JointSet::OpenXr);
        for &place in &places {
            joints_of(&mut request)[place].pose = Some(lost);
        }
        let fields: Vec<_> = places
            .iter()
            .map(|place| format!("holdout.presenting_hand.joints.joints[{place}]"))
            .collect();
        let fields: Vec<_> = fields.iter().map(String::as_str).collect();
        assert_blamed(&server, request, &fields).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn turned_joints_and_the_other_hand_are_named() {
    let server = TestServer::start().await;
    let mut hand = relaxed_hand();
    for joint in [7, 19] {
        hand.joints[joint].pose.orientation *= Quat::from_rotation_y(std::f32::consts::PI);
    }
    let fields = [
        "holdout.presenting_hand.joints.joints[7]",
        "holdout.presenting_hand.joints.joints[19]",
    ];
    assert_blamed(&server, held_by(&hand, JointSet::OpenXr), &fields).await;
    let mislabelled = HandJoints {
        handedness: Handedness::Right,
        ..relaxed_hand()
    };
    let request = held_by(&mislabelled, JointSet::WebXr);
    assert_blamed(&server, request, &["holdout.presenting_hand.joints.handedness"]).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_numbers_of_joints_are_named() {
    let server = TestServer::start().await;
    for count in [0, 24, 27] {
        let request = with(held_by(&relaxed_hand(), JointSet::OpenXr), |request| {
            let joints = joints_of(request);
            let last = joints[25];
            joints.resize(count, last);
        });
        assert_blamed(&server, request, &["holdout.presenting_hand.joints.joints"]).await;
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn missing_radii_are_derived_with_a_warning() {
    let server = TestServer::start().await;
    let whole = unaided(reproducible(held_by(&relaxed_hand(), JointSet::OpenXr)));
    let whole = with(whole, |request| request.search_mut().max_attempts = Some(200));
    let ask = async |request: v1::FindGraspRequest| {
        let answer = server.grasps().await.find_grasp(request).await;
        answer.expect("the hand is accepted").into_inner()
    };
    let expected = ask(whole.clone()).await;
    assert!(expected.report.as_ref().unwrap().warnings.is_empty());
    let mut without_tips = whole.clone();
    for tip in [5, 10, 15, 20, 25] {
        joints_of(&mut without_tips)[tip].radius = 0.0;
    }
    let answer = ask(without_tips).await;
    let warnings = &answer
        .report
        .as_ref()
        .expect("every answer has a report")
        .warnings;
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0].starts_with("holdout.presenting_hand.joints.joints: 5 radii are 0"),
        "{warnings:?}"
    );
    // The hand is the adult rig's, so the derived radii are the rig's own, but for rounding.
    let wrist = |answer: &v1::FindGraspResponse| Some(answer.grasp()?.client_from_wrist()?.position());
    match (wrist(&answer), wrist(&expected)) {
        (Some(a), Some(b)) => assert!(a.distance(b) < 1e-3),
        (a, b) => assert_eq!(a, b),
    }
    let mut negative = whole;
    joints_of(&mut negative)[10].radius = -0.001;
    assert_blamed(
        &server,
        negative,
        &["holdout.presenting_hand.joints.joints[10].radius"],
    )
    .await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_recorded_pose_is_accepted() {
    let Some(folder) = data_folder_or_skip("every_recorded_pose_is_accepted") else {
        return;
    };
    let server = TestServer::start().await;
    let radii = hand("adult", Handedness::Right)
        .expect("the rig is built in")
        .rig
        .joint_radii;
    let client_from_wrist = Pose::new(Vec3::new(-0.2, 1.3, 0.5), Quat::from_rotation_z(2.0));
    let mut accepted = 0;
    for file in ["handy-work_poses.json", "godot_xr_tools_poses.json"] {
        for pose in read_poses(&folder.join("poses").join(file), &radii) {
            for frame in [Pose::IDENTITY, client_from_wrist] {
                let request = held_by(&pose.joints.transformed(frame), JointSet::WebXr);
                let answer = server.grasps().await.find_grasp(request).await;
                assert!(answer.is_ok(), "{file}, {}: {answer:?}", pose.name);
                accepted += 1;
            }
        }
    }
    assert!(accepted >= 2 * 84, "{accepted}");
    server.stop().await;
}
