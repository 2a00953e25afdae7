//! `EvaluateHoldout`: how many known grips remain valid, and what is in the way of the others.

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_tests::TestServer;
use tonic::transport::Channel;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{built_in_request, floating_remote, impossible, milliseconds, receiving},
};

type Client = GraspServiceClient<Channel>;

async fn evaluated(client: &mut Client, request: v1::EvaluateHoldoutRequest) -> v1::EvaluateHoldoutResponse {
    let answer = client.evaluate_holdout(request).await;
    answer.expect("the request is valid").into_inner()
}

fn alone(holdout: v1::FindGraspRequest) -> v1::EvaluateHoldoutRequest {
    v1::EvaluateHoldoutRequest {
        holdout: Some(holdout),
        other_presenting_hands: Vec::new(),
    }
}

/// The counts of a rating agree with each other.
fn assert_consistent(rating: &v1::HoldoutRating) {
    assert_eq!(rating.sides.len(), 6);
    assert_eq!(
        rating.sides.iter().map(|side| side.known).sum::<u32>(),
        rating.known
    );
    assert_eq!(
        rating.sides.iter().map(|side| side.valid).sum::<u32>(),
        rating.valid
    );
    assert!((rating.valid_share - rating.valid as f32 / rating.known.max(1) as f32).abs() < 1e-6);
    let hindered: f32 = rating.hindrances.iter().map(|hindrance| hindrance.share).sum();
    let others = if rating.known == 0 {
        0.0
    } else {
        1.0 - rating.valid_share
    };
    assert!((hindered - others).abs() < 1e-4, "{rating:?}");
    let best = rating
        .sides
        .iter()
        .map(|side| side.best_score)
        .fold(0.0, f32::max);
    assert!(rating.best_score >= best);
    for side in &rating.sides {
        let length = |v: v1::Vector3| v.x.hypot(v.y).hypot(v.z);
        assert!((length(side.client_direction.unwrap()) - 1.0).abs() < 1e-5);
        assert!(side.valid <= side.known && (side.valid > 0) == (side.best_score > 0.0));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn givers_and_obstacles_take_grips_away() {
    let (server, _folder) = with_complete_atlas("remote").await;
    let mut client = server.grasps().await;
    let right = |holdout| v1::FindGraspRequest {
        receiving_hand: Some(receiving(v1::Handedness::Right)),
        ..holdout
    };
    let free = evaluated(&mut client, alone(right(floating_remote()))).await;
    let [free_rating] = free.ratings.as_slice() else {
        panic!("{free:?}")
    };
    assert_consistent(free_rating);
    assert!(free_rating.receivable && free_rating.known > 100 && free_rating.valid_share > 0.5);
    assert_eq!(free.atlas_stamps.len(), 1);
    let remotes: Vec<_> = holdouts()
        .iter()
        .filter(|holdout| holdout.object == "remote")
        .collect();
    let held = v1::EvaluateHoldoutRequest {
        holdout: Some(right(built_in_request(remotes[0]))),
        other_presenting_hands: remotes[1..]
            .iter()
            .filter_map(|holdout| built_in_request(holdout).presenting_hand)
            .collect(),
    };
    let answer = evaluated(&mut client, held.clone()).await;
    assert_eq!(answer.ratings.len(), remotes.len());
    for (place, rating) in answer.ratings.iter().enumerate() {
        assert_consistent(rating);
        assert_eq!(
            (rating.presenting_hand as usize, rating.known),
            (place, free_rating.known)
        );
        assert!(rating.valid < free_rating.valid);
        assert_eq!(rating.hindrances[0].what(), v1::InTheWay::PresentingHand);
    }
    let mut ranking = answer.ranking.clone();
    let shares: Vec<f32> = ranking
        .iter()
        .map(|&place| answer.ratings[place as usize].valid_share)
        .collect();
    assert!(shares.is_sorted_by(|a, b| a >= b), "{shares:?}");
    ranking.sort_unstable();
    assert_eq!(ranking, (0..remotes.len() as u32).collect::<Vec<_>>());
    // Each is rated as if it were alone.
    let mut second = held.clone();
    let giver = second.other_presenting_hands.remove(0);
    second.holdout.as_mut().unwrap().presenting_hand = Some(giver);
    second.other_presenting_hands.clear();
    let known_only = |rating: &v1::HoldoutRating| v1::HoldoutRating {
        presenting_hand: 0,
        // Without a valid known grip, a search with a random seed decides.
        best_score: if rating.valid > 0 { rating.best_score } else { 0.0 },
        ..rating.clone()
    };
    let alone_rating = evaluated(&mut client, second).await.ratings.remove(0);
    assert_eq!(known_only(&alone_rating), known_only(&answer.ratings[1]));
    // Both hands together know as many grips as each.
    let both = evaluated(&mut client, alone(built_in_request(remotes[0]))).await;
    assert!(both.ratings[0].known > answer.ratings[0].known && both.atlas_stamps.len() == 2);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_known_grips_a_search_decides() {
    let server = TestServer::start().await;
    let mut client = server.grasps().await;
    let free = evaluated(&mut client, alone(floating_remote())).await;
    let rating = &free.ratings[0];
    assert_consistent(rating);
    assert!(rating.receivable && rating.known == 0 && rating.best_score > 0.0);
    assert!(free.atlas_stamps.is_empty() && rating.reason() == v1::NoGraspReason::Unspecified);
    let untouchable = v1::FindGraspRequest {
        budget: Some(milliseconds(30)),
        ..impossible(&server).await
    };
    let answer = evaluated(&mut client, alone(untouchable)).await;
    assert!(!answer.ratings[0].receivable);
    assert_eq!(answer.ratings[0].reason(), v1::NoGraspReason::CannotBeHeld);
    server.stop().await;
}
