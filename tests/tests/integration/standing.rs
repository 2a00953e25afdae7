//! Standing grasps over the wire: kept, adjusted, replaced, aborted, and refused.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdouts;
use grasp_client::{
    AtlasUse, ClientError, Convention, FallReason, FindAnswer, FindRequest, Grasp, GraspSource, HandAngles,
    Handedness, NoGraspReason, Obstacle, Outcome, Pose, PresentingHand, StandingGrasp, StandingStatus,
    built_in::request_for,
};
use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{assert_blamed, floating_remote, receiving},
};

async fn ask(server: &TestServer, request: &FindRequest) -> FindAnswer {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

/// A request for an object of a built-in holdout, by right hands.
fn request(holdout: usize) -> FindRequest {
    let mut request = FindRequest {
        budget: Some(Duration::from_secs(10)),
        seed: Some(3),
        ..request_for(&holdouts()[holdout])
    };
    request.receiving_hand.handedness = Some(Handedness::Right);
    request
}

/// The request once more with its answer to hold on to.
fn again(request: &FindRequest, grasp: &Grasp) -> FindRequest {
    FindRequest {
        standing: Some(grasp.standing()),
        ..request.clone()
    }
}

fn status(answer: &FindAnswer) -> StandingStatus {
    answer.standing.as_ref().expect("the request has one").status
}

/// The request with the giver's hand where the receiver's is.
fn with_giver_in_the_way(request: &FindRequest, grasp: &Grasp) -> FindRequest {
    request.clone().with_hand(PresentingHand::Angles(HandAngles {
        rig: "adult".to_owned(),
        handedness: grasp.handedness,
        client_from_wrist: grasp.client_from_wrist,
        digits: grasp.digits,
        hand_scale: None,
    }))
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_is_kept_bit_for_bit_in_every_convention() {
    let server = TestServer::start().await;
    for holdout in 0..15 {
        for convention in [
            Convention::OpenXr,
            Convention::Unity,
            Convention::Unreal,
            Convention::Godot,
        ] {
            // Nobody holds it, so that poses need no conversion here.
            let request = FindRequest {
                convention,
                presenting_hand: None,
                client_from_object: Pose::new(Vec3::new(0.1, 0.2, 0.3), Quat::from_rotation_y(0.4)),
                ..request(holdout)
            };
            let mut grasp = ask(&server, &request).await.grasp.expect("a grasp");
            for round in 0..3 {
                let answer = ask(&server, &again(&request, &grasp)).await;
                assert_eq!(
                    status(&answer),
                    StandingStatus::Kept,
                    "{holdout} {convention:?} {answer:?}"
                );
                assert_eq!(answer.report.source, Some(GraspSource::Standing));
                assert_eq!((answer.report.attempts, answer.report.candidates), (0, 1));
                let kept = answer.grasp.expect("it is kept");
                assert_eq!(
                    kept.object_from_wrist, grasp.object_from_wrist,
                    "{holdout} {convention:?} {round}"
                );
                assert_eq!(kept.digits, grasp.digits);
                for (kept, before) in kept.joints.iter().zip(&grasp.joints) {
                    let (kept, before) = (kept.client_from_joint, before.client_from_joint);
                    assert!(
                        kept.orientation.dot(before.orientation) > 0.9999,
                        "the sign is the same"
                    );
                    assert!(kept.position.distance(before.position) < 1e-4);
                }
                let way = answer.standing.and_then(|standing| standing.way).expect("a way");
                assert!(way.distance == 0.0 && way.angle < 1e-5 && way.fingertips == 0.0);
                grasp = kept;
            }
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_depends_on_no_earlier_request() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let request = FindRequest {
        atlas: Some(AtlasUse::None),
        ..request(0)
    };
    let first = ask(&server, &request).await;
    let second = ask(&server, &request).await;
    for answer in [&first, &second] {
        assert_eq!(answer.report.source, Some(GraspSource::Search));
        assert_eq!(answer.standing, None);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fallen_grasp_is_followed_by_a_near_one_unless_committed() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let request = FindRequest {
        presenting_hand: None,
        ..request(0)
    };
    let grasp = ask(&server, &request).await.grasp.expect("a grasp");
    let blocked = with_giver_in_the_way(&again(&request, &grasp), &grasp);
    let answer = ask(&server, &blocked).await;
    let standing = answer.standing.clone().expect("the request has one");
    assert_eq!(standing.status, StandingStatus::Replanned);
    let fall = standing.fall.expect("it fell");
    assert_eq!(fall.reason, FallReason::Giver);
    assert!(fall.figure < Some(0.0) && fall.bound == Some(0.001), "{fall:?}");
    let next = answer.grasp.expect("another grasp");
    assert_eq!(answer.report.source, Some(GraspSource::Atlas));
    let way = standing.way.expect("the same hand");
    let distance = next
        .object_from_wrist
        .position
        .distance(grasp.object_from_wrist.position);
    assert!((way.distance - distance).abs() < 1e-5);

    let mut committed = blocked;
    committed.standing.as_mut().unwrap().committed = true;
    let answer = ask(&server, &committed).await;
    assert_eq!(answer.outcome, Outcome::Aborted);
    assert_eq!((answer.grasp.as_ref(), answer.report.attempts), (None, 0));
    let standing = answer.standing.expect("the request has one");
    assert_eq!(standing.status, StandingStatus::Aborted);
    assert_eq!(standing.fall.expect("it fell").reason, FallReason::Giver);
    let withdrawal = standing.withdrawal.expect("a pose to withdraw to");
    let back = withdrawal
        .object_from_wrist
        .position
        .distance(grasp.object_from_wrist.position);
    assert!((0.1..0.2).contains(&back), "{back}");
    // It is a hand that the service takes as the present one.
    let present = FindRequest {
        standing: Some(StandingGrasp {
            present: Some(withdrawal),
            ..grasp.standing()
        }),
        ..request.clone()
    };
    let answer = ask(&server, &present).await;
    assert_eq!(status(&answer), StandingStatus::Kept);
    let way = answer.standing.and_then(|standing| standing.way).expect("a way");
    assert!((way.distance - back).abs() < 1e-5 && way.fingertips > 0.005);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn fingers_that_are_in_the_way_move_and_the_rest_holds_on() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let request = FindRequest {
        presenting_hand: None,
        ..request(0)
    };
    let mut adjusted = 0;
    for seed in 0..4 {
        let request = FindRequest {
            seed: Some(seed),
            atlas: Some(AtlasUse::None),
            ..request.clone()
        };
        let grasp = ask(&server, &request).await.grasp.expect("a grasp");
        // A ball beyond the tip of each finger.
        for tip in [10, 15, 20, 25] {
            let joint = grasp.joints[tip].client_from_joint;
            let ahead = joint.orientation * Vec3::NEG_Z;
            let centre = joint.position + ahead * 0.004;
            let blocked = again(&request, &grasp).with_obstacle(Obstacle::capsule(centre, centre, 0.005));
            let answer = ask(&server, &blocked).await;
            let standing = answer.standing.expect("the request has one");
            let fall = standing.fall.expect("the ball is in the way");
            assert_eq!(fall.reason, FallReason::Obstacle, "{fall:?}");
            if standing.status == StandingStatus::Adjusted {
                adjusted += 1;
                let moved = answer.grasp.expect("it is adjusted");
                assert_eq!(moved.object_from_wrist, grasp.object_from_wrist);
                assert!(!standing.moved_digits.is_empty());
                for digit in 0..5 {
                    let is_moved = standing.moved_digits.iter().any(|&moved| moved as usize == digit);
                    assert_eq!(moved.digits[digit] != grasp.digits[digit], is_moved);
                }
                let margins = moved.margins.expect("it is physical");
                assert!(margins.obstacle_clearance > Some(0.000_09));
            }
        }
    }
    assert!(adjusted > 3, "{adjusted}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_absence_of_a_grasp_is_explained() {
    let server = TestServer::start().await;
    let request = FindRequest {
        presenting_hand: None,
        budget: Some(Duration::from_millis(50)),
        ..request(0)
    };
    let held = FindRequest {
        budget: Some(Duration::from_secs(10)),
        ..request.clone()
    };
    let grasp = ask(&server, &held).await.grasp.expect("a grasp");
    let heavy = FindRequest {
        object_mass_kg: Some(500.0),
        ..again(&request, &grasp)
    };
    let answer = ask(&server, &heavy).await;
    assert_eq!(answer.outcome, Outcome::BudgetExhausted);
    let standing = answer.standing.expect("the request has one");
    assert_eq!(standing.status, StandingStatus::None);
    assert_eq!(standing.no_grasp, Some(NoGraspReason::CannotBeHeld));
    assert_eq!(standing.fall.expect("it fell").reason, FallReason::NotHeld);
    assert_eq!(standing.way, None);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_of_other_sizes_and_objects_of_other_sizes_are_held_on_to() {
    let server = TestServer::start().await;
    let mut request = FindRequest {
        presenting_hand: None,
        object_scale: Some(1.2),
        plan_key_frames: true,
        ..request(0)
    };
    request.receiving_hand.hand_scale = Some(1.1);
    let grasp = ask(&server, &request).await.grasp.expect("a grasp");
    let mut standing = grasp.standing();
    standing.hand.hand_scale = Some(1.1);
    let answer = ask(
        &server,
        &FindRequest {
            standing: Some(standing),
            ..request.clone()
        },
    )
    .await;
    assert_eq!(status(&answer), StandingStatus::Kept);
    let kept = answer.grasp.expect("it is kept").key_frames;
    assert_eq!(kept.len(), 3);
    for (kept, planned) in kept.iter().zip(&grasp.key_frames) {
        let (kept, planned) = (
            kept.client_from_wrist.position,
            planned.client_from_wrist.position,
        );
        assert!(kept.distance(planned) < 1e-4, "{kept} {planned}");
    }
    // Without the size, it is another hand.
    let error = server.client().await.find_grasp(&again(&request, &grasp)).await;
    assert!(
        matches!(&error, Err(ClientError::InvalidArgument(_))),
        "{error:?}"
    );
    server.stop().await;
}

/// A valid request of a right hand, as a message.
fn message() -> v1::FindGraspRequest {
    let hand = v1::HandAtObject {
        rig: "adult".to_owned(),
        handedness: v1::Handedness::Right.into(),
        hand_scale: None,
        object_from_wrist: None,
        digits: vec![v1::DigitAngles::default(); 5],
    };
    v1::FindGraspRequest {
        receiving_hand: Some(receiving(v1::Handedness::Right)),
        standing: Some(v1::StandingGrasp {
            hand: Some(hand.clone()),
            present: Some(hand),
            better_by: Some(0.1),
            committed: false,
        }),
        ..floating_remote()
    }
}

fn sent(request: &mut v1::FindGraspRequest) -> &mut v1::StandingGrasp {
    request.standing.as_mut().expect("it has one")
}

fn hand(request: &mut v1::FindGraspRequest) -> &mut v1::HandAtObject {
    sent(request).hand.as_mut().expect("it has one")
}

fn present(request: &mut v1::FindGraspRequest) -> &mut v1::HandAtObject {
    sent(request).present.as_mut().expect("it has one")
}

type Mutation = fn(&mut v1::FindGraspRequest);

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_standing_grasp_is_validated() {
    let server = TestServer::start().await;
    let answer = server.grasps().await.find_grasp(message()).await;
    assert!(answer.is_ok(), "the unchanged request is accepted: {answer:?}");
    let left = i32::from(v1::Handedness::Left);
    let table: &[(Mutation, &[&str])] = &[
        (|r| sent(r).hand = None, &["standing.hand"]),
        (|r| sent(r).better_by = Some(-0.1), &["standing.better_by"]),
        (|r| sent(r).better_by = Some(f32::NAN), &["standing.better_by"]),
        (|r| hand(r).rig = "robot".into(), &["standing.hand.rig"]),
        (|r| hand(r).rig = "thesis".into(), &["standing.hand.rig"]),
        (|r| hand(r).hand_scale = Some(1.5), &["standing.hand.hand_scale"]),
        (|r| hand(r).hand_scale = Some(9.0), &["standing.hand.hand_scale"]),
        (|r| hand(r).handedness = 0, &["standing.hand.handedness"]),
        (
            |r| hand(r).digits[2].second_pitch = 3.0,
            &["standing.hand.digits[2].second_pitch"],
        ),
        (
            |r| {
                hand(r).digits.pop();
            },
            &["standing.hand.digits"],
        ),
        (
            |r| {
                hand(r).object_from_wrist = Some(v1::Pose {
                    position: None,
                    orientation: Some(v1::Quaternion::default()),
                });
            },
            &["standing.hand.object_from_wrist.orientation"],
        ),
        (
            |r| {
                present(r).digits[0].base_yaw = f32::INFINITY;
                present(r).rig.clear();
            },
            &["standing.present.rig"],
        ),
        (|r| r.validity = v1::Validity::Thesis.into(), &["standing"]),
        (|r| r.strategy = v1::Strategy::F.into(), &["standing"]),
        (|r| r.hands = v1::Hands::Both.into(), &["standing"]),
        (|r| r.only_attempt = Some(3), &["standing"]),
    ];
    for (place, (mutate, fields)) in table.iter().enumerate() {
        let mut request = message();
        mutate(&mut request);
        if request.validity == i32::from(v1::Validity::Thesis) {
            request.strategy = v1::Strategy::Guided.into();
            request.receiving_hand.as_mut().unwrap().rig = "adult".to_owned();
        }
        println!("row {place}");
        assert_blamed(&server, request, fields).await;
    }
    // The other hand than the receiving one, and than the present one; either may be if the request leaves the choice.
    let mut other = message();
    hand(&mut other).handedness = left;
    assert_blamed(
        &server,
        other.clone(),
        &["standing.hand.handedness", "standing.present.handedness"],
    )
    .await;
    other.receiving_hand = None;
    assert_blamed(&server, other.clone(), &["standing.present.handedness"]).await;
    present(&mut other).handedness = left;
    let answer = server.grasps().await.find_grasp(other).await;
    assert!(answer.is_ok(), "{answer:?}");
    server.stop().await;
}
