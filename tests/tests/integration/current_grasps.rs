//! Current grasps over the wire: kept, adjusted, replaced, aborted, and refused.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_assets::holdouts::holdouts;
use grasp_client::built_in::request_for;
use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_tests::TestServer;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{find, hand as hand_of, with},
};

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
async fn found(server: &TestServer, request: &v1::FindGraspRequest) -> v1::Grasp {
    let answer = find(server, request.clone()).await;
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
            let mut grasp = found(&server, &request).await;
            for round in 0..3 {
                let answer = find(&server, again(&request, &grasp)).await;
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
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fallen_grasp_is_followed_by_a_near_one_unless_committed() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let request = without_giver(0);
    let grasp = found(&server, &request).await;
    // The giver's hand is where the receiver's is.
    let blocked = again(&request, &grasp).with_presenting_hand(hand_of(&grasp).clone());
    let answer = find(&server, blocked.clone()).await;
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
    let answer = find(&server, committed.clone()).await;
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
    let answer = find(&server, present.clone()).await;
    assert_eq!(report(&answer).status(), CurrentGraspStatus::Kept);
    let motion = report(&answer).motion.expect("the same hand");
    assert!((motion.distance - back).abs() < 1e-5 && motion.fingertips > 0.005);
}
