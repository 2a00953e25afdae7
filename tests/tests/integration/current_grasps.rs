//! Current grasps over the wire: kept, adjusted, replaced, aborted, and refused.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdouts;
use grasp_client::{ClientError, built_in::request_for};
use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_tests::TestServer;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{assert_blamed, floating_remote, unaided},
    parts::{hand as hand_of, with},
};

async fn ask(server: &TestServer, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

/// A request for an object of a built-in holdout, by right hands.
fn request(holdout: usize) -> v1::FindGraspRequest {
    request_for(&holdouts()[holdout])
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(10))
        .with_seed(3)
}

/// The same where nobody holds the object.
fn without_giver(holdout: usize) -> v1::FindGraspRequest {
    with(request(holdout), |request| {
        request.holdout_mut().presenting_hand = None;
    })
}

/// The grasp that is found.
async fn find(server: &TestServer, request: &v1::FindGraspRequest) -> v1::Grasp {
    let answer = ask(server, request).await;
    answer.grasp().expect("a grasp").clone()
}

/// The request once more with its answer to hold on to, as it is.
fn again(request: &v1::FindGraspRequest, grasp: &v1::Grasp) -> v1::FindGraspRequest {
    request.clone().with_current(v1::CurrentGrasp {
        grasp: grasp.hand.clone(),
        ..Default::default()
    })
}

fn report(answer: &v1::FindGraspResponse) -> &v1::CurrentGraspReport {
    answer.current.as_ref().expect("the request has one")
}

fn position(grasp: &v1::Grasp) -> Vec3 {
    grasp.object_from_wrist().expect("a hand has a wrist").position()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_is_kept_bit_for_bit_in_every_convention() {
    let server = TestServer::start().await;
    for holdout in 0..15 {
        for convention in [
            v1::Convention::Openxr,
            v1::Convention::Unity,
            v1::Convention::Unreal,
            v1::Convention::Godot,
        ] {
            // Nobody holds it, so that poses need no conversion here.
            let at = v1::Pose::new(Vec3::new(0.1, 0.2, 0.3), Quat::from_rotation_y(0.4));
            let request = without_giver(holdout)
                .with_convention(convention)
                .with_client_from_object(at);
            let mut grasp = find(&server, &request).await;
            for round in 0..3 {
                let answer = ask(&server, &again(&request, &grasp)).await;
                assert_eq!(
                    report(&answer).status(),
                    CurrentGraspStatus::Kept,
                    "{holdout} {convention:?} {answer:?}"
                );
                assert_eq!(answer.source(), v1::GraspSource::Current);
                assert_eq!(answer.attempts(), 0);
                let [kept] = &answer.grasps[..] else {
                    panic!("it is kept: {answer:?}");
                };
                let (hand, before) = (hand_of(kept), hand_of(&grasp));
                assert_eq!(
                    hand.object_from_wrist, before.object_from_wrist,
                    "{holdout} {convention:?} {round}"
                );
                assert_eq!(hand.digits(), before.digits());
                for (kept, before) in hand.joints.iter().zip(&before.joints) {
                    assert!(
                        kept.orientation().dot(before.orientation()) > 0.9999,
                        "the sign is the same"
                    );
                    assert!(kept.position().distance(before.position()) < 1e-4);
                }
                let motion = report(&answer).motion.expect("the same hand");
                assert!(motion.distance == 0.0 && motion.angle < 1e-5 && motion.fingertips == 0.0);
                grasp = kept.clone();
            }
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_depends_on_no_earlier_request() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let request = unaided(request(0));
    let first = ask(&server, &request).await;
    let second = ask(&server, &request).await;
    for answer in [&first, &second] {
        assert_eq!(answer.source(), v1::GraspSource::Search);
        assert_eq!(answer.current, None);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fallen_grasp_is_followed_by_a_near_one_unless_committed() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let request = without_giver(0);
    let grasp = find(&server, &request).await;
    // The giver's hand is where the receiver's is.
    let blocked = again(&request, &grasp).with_presenting_hand(hand_of(&grasp).clone());
    let answer = ask(&server, &blocked).await;
    let current = report(&answer);
    assert_eq!(current.status(), CurrentGraspStatus::Replanned);
    let failed = current.failed_check.as_ref().expect("it is not valid");
    assert_eq!(
        (failed.check(), failed.passed),
        (v1::Check::GiverClearance, false)
    );
    assert!(
        failed.value < Some(0.0) && failed.bound == Some(0.001),
        "{failed:?}"
    );
    let next = answer.grasp().expect("another grasp");
    assert_eq!(answer.source(), v1::GraspSource::Atlas);
    let motion = current.motion.expect("the same hand");
    let distance = position(next).distance(position(&grasp));
    assert!((motion.distance - distance).abs() < 1e-5);

    let mut committed = blocked;
    committed.current.as_mut().unwrap().committed = true;
    let answer = ask(&server, &committed).await;
    assert_eq!(answer.outcome(), v1::Outcome::Aborted);
    assert_eq!((answer.grasps.len(), answer.attempts()), (0, 0));
    let current = report(&answer);
    assert_eq!(current.status(), CurrentGraspStatus::Aborted);
    let failed = current.failed_check.as_ref().expect("it is not valid");
    assert_eq!(failed.check(), v1::Check::GiverClearance);
    let withdrawal = current.withdrawal.as_ref().expect("a pose to withdraw to");
    let at = withdrawal.object_from_wrist.expect("a hand has a wrist");
    let back = at.position().distance(position(&grasp));
    assert!((0.1..0.2).contains(&back), "{back}");
    // It is a hand that the service takes as the present one.
    let present = with(again(&request, &grasp), |request| {
        request.current.as_mut().unwrap().hand = Some(withdrawal.clone());
    });
    let answer = ask(&server, &present).await;
    assert_eq!(report(&answer).status(), CurrentGraspStatus::Kept);
    let motion = report(&answer).motion.expect("the same hand");
    assert!((motion.distance - back).abs() < 1e-5 && motion.fingertips > 0.005);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn fingers_that_are_in_the_way_move_and_the_rest_holds_on() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let mut adjusted = 0;
    for seed in 0..4 {
        let request = unaided(without_giver(0)).with_seed(seed);
        let grasp = find(&server, &request).await;
        // A ball beyond the tip of each finger.
        for tip in [10, 15, 20, 25] {
            let joint = hand_of(&grasp).joints[tip];
            let ahead = joint.orientation() * Vec3::NEG_Z;
            let ball = v1::Shape::ball(joint.position() + ahead * 0.004, 0.005);
            let answer = ask(&server, &again(&request, &grasp).with_obstacle(ball)).await;
            let current = report(&answer);
            let failed = current.failed_check.as_ref().expect("the ball is in the way");
            assert_eq!(failed.check(), v1::Check::ObstacleClearance, "{failed:?}");
            if current.status() == CurrentGraspStatus::Adjusted {
                adjusted += 1;
                let moved = answer.grasp().expect("it is adjusted");
                let (hand, before) = (hand_of(moved), hand_of(&grasp));
                assert_eq!(hand.object_from_wrist, before.object_from_wrist);
                assert!(!current.moved_digits.is_empty());
                for digit in 0..5 {
                    let is_moved = current.moved_digits().any(|moved| moved as usize == digit + 1);
                    assert_eq!(hand.digits()[digit] != before.digits()[digit], is_moved);
                }
                assert!(moved.margin(v1::Check::ObstacleClearance) > Some(0.000_09));
            }
        }
    }
    assert!(adjusted > 3, "{adjusted}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_absence_of_a_grasp_is_explained() {
    let server = TestServer::start().await;
    let request = without_giver(0);
    let grasp = find(&server, &request).await;
    let heavy = with(again(&request, &grasp), |request| {
        request.holdout_mut().mass_kg = Some(500.0);
    });
    let answer = ask(&server, &heavy.with_budget(Duration::from_millis(50))).await;
    assert_eq!(answer.outcome(), v1::Outcome::BudgetExhausted);
    let current = report(&answer);
    assert_eq!(current.status(), CurrentGraspStatus::None);
    assert_eq!(current.no_grasp(), v1::Check::Holdable);
    let failed = current.failed_check.as_ref().expect("it is not valid");
    assert!(
        matches!(failed.check(), v1::Check::Closure | v1::Check::Balance),
        "{failed:?}"
    );
    assert_eq!(current.motion, None);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_of_other_sizes_and_objects_of_other_sizes_are_held_on_to() {
    let server = TestServer::start().await;
    let request = with(without_giver(0).with_key_frames(), |request| {
        request.holdout_mut().scale = Some(1.2);
        request.receiver_mut().scale = Some(1.1);
    });
    let grasp = find(&server, &request).await;
    assert_eq!(hand_of(&grasp).scale, Some(1.1));
    let answer = ask(&server, &again(&request, &grasp)).await;
    assert_eq!(report(&answer).status(), CurrentGraspStatus::Kept);
    let kept = &answer.grasp().expect("it is kept").key_frames;
    assert_eq!(kept.len(), 3);
    for (kept, planned) in kept.iter().zip(&grasp.key_frames) {
        let [kept, planned] = [kept, planned].map(|frame| {
            let hand = frame.hand.as_ref().expect("a frame has a hand");
            hand.client_from_wrist.expect("a hand has a wrist").position()
        });
        assert!(kept.distance(planned) < 1e-4, "{kept} {planned}");
    }
    // Without the size, it is another hand.
    let unscaled = with(again(&request, &grasp), |request| hand(request).scale = None);
    let error = server.client().await.find_grasp(&unscaled).await;
    assert!(
        matches!(&error, Err(ClientError::InvalidArgument(_))),
        "{error:?}"
    );
    server.stop().await;
}

/// A valid request of a right hand, as a message.
fn message() -> v1::FindGraspRequest {
    let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Right)
        .with_object_from_wrist(v1::Pose::default())
        .with_digits([Some(v1::DigitAngles::default()); 5]);
    floating_remote()
        .receiving(v1::Handedness::Right)
        .with_current(v1::CurrentGrasp {
            grasp: Some(hand.clone()),
            hand: Some(hand),
            min_score_gain: Some(0.1),
            committed: false,
        })
}

fn sent(request: &mut v1::FindGraspRequest) -> &mut v1::CurrentGrasp {
    request.current.as_mut().expect("it has one")
}

fn hand(request: &mut v1::FindGraspRequest) -> &mut v1::HandPose {
    sent(request).grasp.as_mut().expect("it has one")
}

fn present(request: &mut v1::FindGraspRequest) -> &mut v1::HandPose {
    sent(request).hand.as_mut().expect("it has one")
}

fn thesis(request: &mut v1::FindGraspRequest) -> &mut v1::ThesisOptions {
    request.requirements_mut().thesis.get_or_insert_default()
}

type Mutation = fn(&mut v1::FindGraspRequest);

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_current_grasp_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(message()).await;
    assert!(answer.is_ok(), "the unchanged request is accepted: {answer:?}");
    let left = i32::from(v1::Handedness::Left);
    let table: &[(Mutation, &[&str])] = &[
        (|r| sent(r).grasp = None, &["current.grasp"]),
        (
            |r| sent(r).min_score_gain = Some(-0.1),
            &["current.min_score_gain"],
        ),
        (
            |r| sent(r).min_score_gain = Some(f32::NAN),
            &["current.min_score_gain"],
        ),
        (|r| hand(r).rig = "rigs/robot".into(), &["current.grasp.rig"]),
        (|r| hand(r).rig = "rigs/thesis".into(), &["current.grasp.rig"]),
        (|r| hand(r).rig = "adult".into(), &["current.grasp.rig"]),
        (|r| hand(r).scale = Some(1.5), &["current.grasp.scale"]),
        (|r| hand(r).scale = Some(9.0), &["current.grasp.scale"]),
        (|r| hand(r).handedness = 0, &["current.grasp.handedness"]),
        (|r| hand(r).convention = 9, &["current.grasp.convention"]),
        (
            |r| hand(r).middle.as_mut().unwrap().second_pitch = 3.0,
            &["current.grasp.middle.second_pitch"],
        ),
        (|r| hand(r).little = None, &["current.grasp.little"]),
        (|r| hand(r).object_from_wrist = None, &["current.grasp"]),
        (
            |r| {
                hand(r).object_from_wrist = Some(v1::Pose {
                    position: None,
                    orientation: Some(v1::Quaternion::default()),
                });
            },
            &["current.grasp.object_from_wrist.orientation"],
        ),
        (
            |r| {
                present(r).thumb.as_mut().unwrap().base_yaw = f32::INFINITY;
                present(r).rig.clear();
            },
            &["current.hand.rig"],
        ),
        (|r| present(r).object_from_wrist = None, &["current.hand"]),
        (
            |r| {
                thesis(r).thesis_validity = true;
                thesis(r).strategy = v1::Strategy::Guided.into();
                r.receiver_mut().rig = "rigs/adult".to_owned();
            },
            &["current"],
        ),
        (|r| thesis(r).strategy = v1::Strategy::F.into(), &["current"]),
        (
            |r| {
                r.receiver_mut().handedness = 0;
                r.receiver_mut().both_hands = true;
            },
            &["current"],
        ),
        (|r| r.search_mut().replay_attempt = Some(3), &["current"]),
    ];
    for (place, (mutate, fields)) in table.iter().enumerate() {
        let mut request = message();
        mutate(&mut request);
        println!("row {place}");
        assert_blamed(&server, request, fields).await;
    }
    // The other hand than the receiving one, and than the present one; either may be if the request leaves the choice.
    let mut other = message();
    hand(&mut other).handedness = left;
    assert_blamed(
        &server,
        other.clone(),
        &["current.grasp.handedness", "current.hand.handedness"],
    )
    .await;
    other.receiver = None;
    assert_blamed(&server, other.clone(), &["current.hand.handedness"]).await;
    present(&mut other).handedness = left;
    let answer = server.grasps().await.find_grasp(other).await;
    assert!(answer.is_ok(), "{answer:?}");
    server.stop().await;
}
