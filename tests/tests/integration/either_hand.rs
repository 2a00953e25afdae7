//! The choice of the receiving hand over the wire.

use std::time::Duration;

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, Handedness};
use grasp_tests::TestServer;

use crate::{
    fixtures::{assert_blamed, built_in_request, floating_remote, impossible, of_thesis},
    parts::{hand as hand_of, reproducible, with},
};

/// A reproducible request without known grips, for a hand or the better of both.
fn request(holdout: usize, hand: Handedness) -> v1::FindGraspRequest {
    let request = built_in_request(&holdouts()[holdout]);
    reproducible(request.with_seed(11).receiving(hand))
}

/// The request for one attempt alone.
fn replaying(request: v1::FindGraspRequest, attempt: u64) -> v1::FindGraspRequest {
    with(request, |request| {
        request.search_mut().replay_attempt = Some(attempt);
    })
}

async fn ask(server: &TestServer, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    let client = server.client().await;
    client.find_grasp(request).await.expect("the request is valid")
}

/// The number of the attempt that found an answer's grasp.
fn attempt_of(answer: &v1::FindGraspResponse) -> u64 {
    let origin = answer.origin.as_ref().expect("every answer has an origin");
    origin.attempt.expect("an attempt found it")
}

/// The holdouts' numbers that these tests use: givers that leave different sides.
const HOLDOUTS: [usize; 4] = [0, 5, 9, 13];

#[tokio::test(flavor = "multi_thread")]
async fn a_request_without_a_hand_is_answered_with_either_and_names_it() {
    let server = TestServer::start().await;
    let mut hands = Vec::new();
    for number in (0..15).step_by(2) {
        let either = ask(&server, &request(number, Handedness::Unspecified)).await;
        assert_eq!(either.outcome(), v1::Outcome::Found);
        let grasp = either.grasp().expect("a grasp was found");
        let handedness = hand_of(grasp).handedness();
        // The same attempt of the same hand alone.
        let replay = replaying(request(number, handedness), attempt_of(&either));
        let replayed = ask(&server, &replay).await;
        assert_eq!(replayed.grasp(), Some(grasp), "{number}");
        hands.push(handedness);
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
        let request = with(request(HOLDOUTS[1], hand), |request| {
            request.search_mut().refinement_time = Some(prost_types::Duration::default());
        });
        let server = &server;
        async move { attempt_of(&ask(server, &request).await) }
    };
    let alone = [first(Handedness::Left).await, first(Handedness::Right).await];
    assert_eq!(first(Handedness::Unspecified).await, alone[0].min(alone[1]));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_best_of_both_hands_is_ranked_among_both() {
    const BUDGET: Duration = Duration::from_millis(600);
    let server = TestServer::start().await;
    let mut best = with(request(HOLDOUTS[0], Handedness::Unspecified), |request| {
        request.search_mut().choice = v1::GraspChoice::BestWithinBudget.into();
    })
    .with_budget(BUDGET);
    let of_both = ask(&server, &best).await;
    assert!(of_both.grasp().is_some());
    let took = of_both.search_time();
    assert!(took >= BUDGET / 2, "{took:?}");
    best.search_mut().budget = None;
    let answer = ask(&server, &best).await;
    assert_eq!(answer.outcome(), v1::Outcome::Found, "patience finds one");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_without_a_grasp_names_the_hand_of_its_nearest_miss() {
    let server = TestServer::start().await;
    let request = with(reproducible(impossible(&server).await), |request| {
        request.search_mut().max_attempts = Some(100);
    });
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
    let hand = miss.hand.expect("it has a hand");
    assert_ne!(hand.handedness(), Handedness::Unspecified);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_replay_needs_a_hand_unless_the_validity_has_one() {
    let server = TestServer::start().await;
    let replay = replaying(floating_remote(), 3);
    assert_blamed(&server, replay.clone(), &["receiver.handedness"]).await;
    let both_hands = with(replay.clone(), |request| {
        request.receiver_mut().both_hands = true;
    });
    for request in [
        replay.clone().receiving(Handedness::Left),
        of_thesis(replay),
        both_hands,
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
        let request = of_thesis(request(number, Handedness::Unspecified));
        let answer = ask(&server, &request).await;
        let grasp = answer.grasp().expect("it can be taken");
        assert_eq!(hand_of(grasp).handedness(), Handedness::Right);
    }
    server.stop().await;
}
