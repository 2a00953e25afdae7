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

use crate::{atlases::with_complete_atlas, fixtures::assert_blamed};

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
