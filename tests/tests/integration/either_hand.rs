//! The choice of the receiving hand over the wire.

use grasp_assets::holdouts::holdouts;
use grasp_client::{FindAnswer, FindRequest, Handedness, Outcome, Validity, built_in::request_for};
use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{assert_blamed, floating_remote, receiving};

/// A reproducible request without known grips, for a hand or the better of both.
fn request(holdout: usize, hand: Option<Handedness>) -> FindRequest {
    let mut request = FindRequest {
        seed: Some(11),
        reproducible: true,
        budget: Some(std::time::Duration::from_secs(10)),
        ..request_for(&holdouts()[holdout])
    };
    request.receiving_hand.handedness = hand;
    request
}

async fn ask(server: &TestServer, request: &FindRequest) -> FindAnswer {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

/// The holdouts' numbers that these tests use: givers that leave different sides.
const HOLDOUTS: [usize; 4] = [0, 5, 9, 13];

#[tokio::test(flavor = "multi_thread")]
async fn a_request_without_a_hand_is_answered_with_either_and_names_it() {
    let server = TestServer::start().await;
    let mut hands = Vec::new();
    for number in (0..15).step_by(2) {
        let either = ask(&server, &request(number, None)).await;
        assert_eq!(either.outcome, Outcome::Found);
        let grasp = either.grasp.expect("a grasp was found");
        let attempt = either.report.attempt.expect("an attempt found it");
        // The same attempt of the same hand alone.
        let replay = FindRequest {
            only_attempt: Some(attempt),
            ..request(number, Some(grasp.handedness))
        };
        let replayed = ask(&server, &replay).await;
        assert_eq!(replayed.grasp.as_ref(), Some(&grasp), "{number}");
        hands.push(grasp.handedness);
    }
    for side in [Handedness::Left, Handedness::Right] {
        assert!(hands.contains(&side), "{hands:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_valid_attempt_of_either_hand_precedes_those_of_each_alone() {
    let server = TestServer::start().await;
    let first = |hand| {
        let request = FindRequest {
            improvement: Some(std::time::Duration::ZERO),
            ..request(HOLDOUTS[1], hand)
        };
        let server = &server;
        async move { ask(server, &request).await.report.attempt.expect("it is found") }
    };
    let alone = [
        first(Some(Handedness::Left)).await,
        first(Some(Handedness::Right)).await,
    ];
    assert_eq!(first(None).await, alone[0].min(alone[1]));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_best_of_both_hands_is_ranked_among_both() {
    let server = TestServer::start().await;
    let mut best = FindRequest {
        choice: Some(grasp_client::Choice::BestWithinBudget),
        reproducible: false,
        budget: Some(std::time::Duration::from_millis(600)),
        ..request(HOLDOUTS[0], None)
    };
    let of_both = ask(&server, &best).await;
    assert!(of_both.report.candidates > 1 && of_both.grasp.is_some());
    best.budget = None;
    let answer = ask(&server, &best).await;
    assert_eq!(answer.outcome, Outcome::Found, "patience finds one");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_without_a_grasp_names_the_hand_of_its_nearest_miss() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest {
        max_attempts: Some(100),
        reproducible: true,
        ..crate::fixtures::impossible(&server).await
    };
    let answer = server
        .grasps()
        .await
        .find_grasp(request)
        .await
        .unwrap()
        .into_inner();
    let report = answer.report.unwrap();
    assert_eq!(report.attempts, 100);
    let miss = report.nearest_miss.expect("an attempt came closest");
    assert!(miss.handedness() != v1::Handedness::Unspecified);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_replay_needs_a_hand_unless_the_validity_has_one() {
    let server = TestServer::start().await;
    let replay = v1::FindGraspRequest {
        only_attempt: Some(3),
        ..floating_remote()
    };
    assert_blamed(&server, replay.clone(), &["receiving_hand.handedness"]).await;
    for request in [
        v1::FindGraspRequest {
            receiving_hand: Some(receiving(v1::Handedness::Left)),
            ..replay.clone()
        },
        v1::FindGraspRequest {
            validity: v1::Validity::Thesis.into(),
            ..replay.clone()
        },
        v1::FindGraspRequest {
            hands: v1::Hands::Both.into(),
            ..replay
        },
    ] {
        let answer = server.grasps().await.find_grasp(request).await;
        assert!(answer.is_ok(), "{answer:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn thesis_validity_takes_the_right_hand() {
    let server = TestServer::start().await;
    for number in HOLDOUTS {
        let request = FindRequest {
            validity: Some(Validity::Thesis),
            ..request(number, None)
        };
        let grasp = ask(&server, &request).await.grasp.expect("it can be taken");
        assert_eq!(grasp.handedness, Handedness::Right);
    }
    server.stop().await;
}
