//! `EvaluateHoldout`: how many known grips remain valid, and what is in the way of the others.

use std::time::Duration;

use grasp_assets::holdouts::holdouts;
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_tests::TestServer;
use tonic::transport::Channel;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{built_in_request, floating_remote, impossible},
};

type Client = GraspServiceClient<Channel>;

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
    // Both hands together know more grips than one.
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
