//! `ValidateGrasp`: found grasps are valid with the same figures, and what is wrong with others is named.

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, grasp_to_validate::Form};
use grasp_synthesis::model::hand::joints::HandJoints;
use grasp_tests::{
    TestServer,
    recorded::{data_folder_or_skip, read_poses},
    wire_pose,
};
use tonic::transport::Channel;

use crate::{
    conventions::engines,
    fixtures::{built_in_request, floating_remote, held_remote, receiving, seconds},
    hooks::case,
    own_hands::new_rig,
};

pub(crate) type Client = GraspServiceClient<Channel>;

/// How far margins may differ: single precision, on the way through the client's frame.
const ROUNDING: f32 = 2e-5;

pub(crate) fn hand_of(grasp: &v1::Grasp) -> v1::HandAtObject {
    v1::HandAtObject {
        rig: grasp.rig.clone(),
        handedness: grasp.handedness,
        hand_scale: None,
        object_from_wrist: grasp.object_from_wrist,
        digits: grasp.digits.clone(),
    }
}

pub(crate) fn angles_of(grasp: &v1::Grasp) -> v1::HandAngles {
    v1::HandAngles {
        rig: grasp.rig.clone(),
        handedness: grasp.handedness,
        client_from_wrist: grasp.client_from_wrist,
        digits: grasp.digits.clone(),
        hand_scale: None,
    }
}

pub(crate) fn request(holdout: v1::FindGraspRequest, form: Form) -> v1::ValidateGraspRequest {
    v1::ValidateGraspRequest {
        holdout: Some(holdout),
        grasp: Some(v1::GraspToValidate { form: Some(form) }),
        find_nearest: false,
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

fn assert_same_figures(answer: &v1::ValidateGraspResponse, grasp: &v1::Grasp, what: &str) {
    assert!(answer.valid, "{what}: {:#?}", answer.verdicts);
    assert_eq!(answer.verdicts.len(), 12, "{what}");
    let seen = answer.grasp.as_ref().expect("the grasp is there");
    let (expected, actual) = (grasp.margins.unwrap(), seen.margins.unwrap());
    let pairs = [
        ("penetration", expected.penetration, actual.penetration),
        ("epsilon", expected.epsilon, actual.epsilon),
        ("residual", expected.residual, actual.residual),
        (
            "giver clearance",
            expected.giver_clearance.unwrap_or_default(),
            actual.giver_clearance.unwrap_or_default(),
        ),
        (
            "obstacle clearance",
            expected.obstacle_clearance.unwrap_or_default(),
            actual.obstacle_clearance.unwrap_or_default(),
        ),
        (
            "score",
            grasp.score.as_ref().unwrap().total,
            seen.score.as_ref().unwrap().total,
        ),
    ];
    for (name, expected, actual) in pairs {
        let slack = match name {
            // Exact to five hundredths, and contacts that moved by rounding may end its search a step later.
            "epsilon" => 0.06 * expected,
            // Rounding turns contacts at edges by a millionth, and thin objects are squeezed with many times their weight.
            "residual" => ROUNDING,
            "score" => 100.0 * ROUNDING,
            _ => 0.0,
        };
        assert!(
            (expected - actual).abs() <= ROUNDING + slack,
            "{what}: {name} is {actual}, was {expected}"
        );
    }
    assert_eq!(seen.contacts.len(), grasp.contacts.len(), "{what}");
    assert_eq!((seen.r#type, seen.hangs), (grasp.r#type, grasp.hangs), "{what}");
    let depth = verdict(answer, v1::Check::Penetration);
    assert_eq!(depth.figure, Some(actual.penetration), "{what}");
    assert_eq!(
        verdict(answer, v1::Check::GiverClearance).figure,
        actual.giver_clearance,
        "{what}"
    );
    assert_eq!(
        verdict(answer, v1::Check::Closure).figure,
        Some(actual.epsilon),
        "{what}"
    );
}

/// Finds a grasp, and checks it in both forms.
async fn assert_found_is_valid(client: &mut Client, holdout: &v1::FindGraspRequest, what: &str) -> bool {
    let found = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
    let Some(grasp) = found.grasp else {
        return false;
    };
    for form in [Form::Hand(hand_of(&grasp)), Form::Angles(angles_of(&grasp))] {
        let answer = validated(client, request(holdout.clone(), form)).await;
        assert_same_figures(&answer, &grasp, what);
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
            let openxr = v1::FindGraspRequest {
                receiving_hand: Some(receiving(side)),
                budget: Some(seconds(3)),
                ..built_in_request(built_in)
            };
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
        known += usize::from(answer.report.unwrap().source() == v1::GraspSource::Atlas);
        let Some(grasp) = answer.grasp else { continue };
        let answer = validated(&mut client, request(holdout, Form::Hand(hand_of(&grasp)))).await;
        assert_same_figures(&answer, &grasp, &built_in.name);
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
    let create = v1::CreateObjectRequest {
        object_id: "case".to_owned(),
        mesh: case().into_bytes(),
        mass_kg: 2.0,
        ..Default::default()
    };
    server.objects().await.create_object(create).await.unwrap();
    let mine = v1::FindGraspRequest {
        receiving_hand: Some(v1::ReceivingHand {
            rig: "rigs/mine".to_owned(),
            ..receiving(v1::Handedness::Left)
        }),
        ..floating_remote()
    };
    assert!(assert_found_is_valid(&mut client, &mine, "a created rig").await);
    for without_thumb in [true, false] {
        let hooked = v1::FindGraspRequest {
            object: "objects/case".to_owned(),
            constraints: Some(v1::Constraints {
                must_not_touch: if without_thumb {
                    vec![v1::Digit::Thumb.into()]
                } else {
                    Vec::new()
                },
                ..Default::default()
            }),
            ..floating_remote()
        };
        assert!(assert_found_is_valid(&mut client, &hooked, "a hook").await);
    }
    // The hand's size is part of the grasp.
    let scaled = v1::FindGraspRequest {
        receiving_hand: Some(v1::ReceivingHand {
            hand_scale: Some(0.8),
            ..receiving(v1::Handedness::Right)
        }),
        ..floating_remote()
    };
    let grasp = client
        .find_grasp(scaled)
        .await
        .unwrap()
        .into_inner()
        .grasp
        .unwrap();
    let hand = |hand_scale| v1::HandAtObject {
        hand_scale,
        ..hand_of(&grasp)
    };
    let small = validated(
        &mut client,
        request(floating_remote(), Form::Hand(hand(Some(0.8)))),
    )
    .await;
    assert_same_figures(&small, &grasp, "a small hand");
    let large = validated(&mut client, request(floating_remote(), Form::Hand(hand(None)))).await;
    assert!(!large.valid, "a larger hand is in the object");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_check_is_made_although_others_fail() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let holdout = held_remote();
    let grasp = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
    let grasp = grasp.grasp.expect("the remote can be taken");
    // A hand moved 3 cm into the object, with a finger bent too far.
    let mut sunk = hand_of(&grasp);
    let position = sunk
        .object_from_wrist
        .as_mut()
        .unwrap()
        .position
        .as_mut()
        .unwrap();
    let q = grasp.object_from_wrist.unwrap().orientation.unwrap();
    let palm = glam::Quat::from_xyzw(q.x, q.y, q.z, q.w) * glam::Vec3::NEG_Y;
    position.x += 0.03 * palm.x;
    position.y += 0.03 * palm.y;
    position.z += 0.03 * palm.z;
    sunk.digits[2].second_pitch = 2.5;
    let mut holdout = holdout;
    // An obstacle around the whole hand, and another far away before it.
    let ball = |x: f32, radius: f32| v1::Obstacle {
        shape: Some(v1::obstacle::Shape::Capsule(v1::CapsuleShape {
            client_start: Some(v1::Vector3 { x, y: 1.2, z: 0.0 }),
            client_end: Some(v1::Vector3 { x, y: 1.2, z: 0.01 }),
            radius,
            end_radius: None,
        })),
    };
    holdout.obstacles = vec![ball(5.0, 0.1), ball(0.3, 0.5)];
    holdout.constraints = Some(v1::Constraints {
        max_comfort_e: Some(0.0),
        ..Default::default()
    });
    holdout.receiver = Some(v1::Receiver {
        body: Some(v1::receiver::Body::ClientShoulder(v1::Vector3 {
            x: 2.0,
            y: 1.2,
            z: 0.0,
        })),
        ..Default::default()
    });
    let answer = validated(&mut client, request(holdout, Form::Hand(sunk))).await;
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
    assert_eq!(limits.digit(), v1::Digit::Middle);
    assert!(
        limits
            .description
            .contains("second_pitch of the middle finger is 2.500 rad"),
        "{}",
        limits.description
    );
    let obstacle = verdict(&answer, v1::Check::ObstacleClearance);
    assert_eq!(obstacle.other, "obstacles[1]");
    assert!(obstacle.figure.unwrap() < -0.3);
    let giver = verdict(&answer, v1::Check::GiverClearance);
    assert_eq!(giver.other, "presenting_hand");
    // From the shoulder at x = 2 to the wrist, less both bones.
    let wrist = answer
        .grasp
        .as_ref()
        .unwrap()
        .client_from_wrist
        .unwrap()
        .position
        .unwrap();
    let away = glam::Vec3::new(wrist.x - 2.0, wrist.y - 1.2, wrist.z).length();
    let reach = verdict(&answer, v1::Check::Reach).figure.unwrap();
    assert!((reach - (away - 0.56)).abs() < 1e-4, "{reach} {away}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_grasp_near_a_wrong_one_is_found() {
    let (server, _folder) = crate::atlases::with_complete_atlas("remote").await;
    let mut client = server.grasps().await;
    let holdout = floating_remote();
    let grasp = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
    let grasp = grasp.grasp.expect("the remote can be taken");
    // Fingers opened: nothing touches.
    let mut opened = hand_of(&grasp);
    for digit in &mut opened.digits[1..] {
        digit.base_pitch = 0.0;
        digit.second_pitch = 0.1;
        digit.third_pitch = None;
    }
    let near = v1::ValidateGraspRequest {
        find_nearest: true,
        ..request(holdout.clone(), Form::Hand(opened))
    };
    let answer = validated(&mut client, near).await;
    assert!(!answer.valid && failed(&answer).contains(&v1::Check::Closure));
    let nearest = answer.nearest.expect("there are known grips");
    let way = answer.way_to_nearest.unwrap();
    let position = |grasp: &v1::Grasp| {
        let p = grasp.object_from_wrist.unwrap().position.unwrap();
        glam::Vec3::new(p.x, p.y, p.z)
    };
    assert!((position(&nearest).distance(position(&grasp)) - way.distance).abs() < 1e-5);
    assert!(way.distance < 0.05 && way.fingertips > 0.005, "{way:?}");
    let again = validated(
        &mut client,
        request(holdout.clone(), Form::Hand(hand_of(&nearest))),
    )
    .await;
    assert!(again.valid, "{:#?}", again.verdicts);
    // A valid grasp needs none.
    let valid = v1::ValidateGraspRequest {
        find_nearest: true,
        ..request(holdout, Form::Hand(hand_of(&grasp)))
    };
    let answer = validated(&mut client, valid).await;
    assert!(answer.valid && answer.nearest.is_none() && answer.way_to_nearest.is_none());
    server.stop().await;
}

/// Joints as a headset sends them.
fn sent(joints: &HandJoints, handedness: v1::Handedness) -> v1::HandJoints {
    v1::HandJoints {
        handedness: handedness.into(),
        joint_set: v1::JointSet::Openxr26.into(),
        joints: joints
            .joints
            .iter()
            .map(|joint| v1::JointPose {
                client_from_joint: Some(wire_pose(joint.pose)),
                radius: joint.radius,
            })
            .collect(),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_joints_of_a_found_grasp_are_valid() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let holdout = held_remote();
    let grasp = client.find_grasp(holdout.clone()).await.unwrap().into_inner();
    let grasp = grasp.grasp.expect("the remote can be taken");
    let joints = v1::HandJoints {
        handedness: grasp.handedness,
        joint_set: v1::JointSet::Openxr26.into(),
        joints: grasp.joints.clone(),
    };
    let answer = validated(&mut client, request(holdout, Form::Joints(joints))).await;
    let farthest = answer.farthest_joint.expect("the grasp was given by joints");
    assert!(farthest < 1e-4, "{farthest}");
    let depth = |grasp: &v1::Grasp| grasp.margins.unwrap().penetration;
    let seen = answer.grasp.as_ref().unwrap();
    assert!((depth(seen) - depth(&grasp)).abs() < 1e-4);
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
            let form = Form::Joints(sent(&pose.joints, side));
            let answer = validated(&mut client, request(floating_remote(), form)).await;
            let farthest = answer.farthest_joint.expect("the grasp was given by joints");
            // Hands differ in size, and the rig does not bend as far back as some poses.
            assert!(farthest < 0.04, "{}: {farthest} m", pose.name);
            assert!(verdict(&answer, v1::Check::JointLimits).passed, "{}", pose.name);
            assert_eq!(answer.grasp.unwrap().handedness(), side);
        }
    }
    server.stop().await;
}
