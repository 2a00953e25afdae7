//! The same request gets the same answer from any server with any number of workers.

use std::sync::Arc;

use grasp_assets::{atlas_folder::complete_atlas, hands::hand, objects::object, primitives::held_primitives};
use grasp_proto::v1;
use grasp_synthesis::{
    base::pose::Pose,
    known::{seed_source::SeedSource, transferred_grips::TransferredGrips},
    model::hand::{Handedness, joints::HandJoints},
};
use grasp_tests::{TestServer, random_holdouts::ClientHoldout, searches::search_from};
use prost::Message as _;

use crate::{
    atlases::with_complete_atlas,
    fixtures::{floating_remote, held_remote, impossible, receiving, seconds},
};

async fn ask(server: &TestServer, request: v1::FindGraspRequest) -> v1::FindGraspResponse {
    server
        .grasps()
        .await
        .find_grasp(request)
        .await
        .expect("the request is valid")
        .into_inner()
}

/// The part of an answer that must not depend on the number of workers.
fn unchanging(answer: v1::FindGraspResponse) -> Vec<u8> {
    let report = answer.report.expect("every answer has a report");
    v1::FindGraspResponse {
        report: Some(v1::SearchReport {
            workers: 0,
            search_time: None,
            ..report
        }),
        ..answer
    }
    .encode_to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_default_answer_is_the_first_grasp_and_may_use_an_atlas() {
    let server = TestServer::start().await;
    let defaults = v1::FindGraspRequest {
        reproducible: true,
        ..floating_remote()
    };
    let answer = ask(&server, defaults.clone()).await;
    let expected = unchanging(answer);
    let explicit = |atlas: v1::AtlasUse| v1::FindGraspRequest {
        choice: v1::Choice::FirstValid.into(),
        atlas: atlas.into(),
        ..defaults.clone()
    };
    let allowed = ask(&server, explicit(v1::AtlasUse::Allowed)).await;
    assert_eq!(unchanging(allowed), expected);
    // Without an atlas, the search answers.
    let fresh = ask(&server, explicit(v1::AtlasUse::None)).await;
    let report = fresh.report.as_ref().expect("every answer has a report");
    assert_eq!(report.source(), v1::GraspSource::Search);
    assert_eq!((report.candidates, report.atlas_entries), (1, 0));
    assert_eq!(report.atlas_stamp, "");
    let again = ask(&server, explicit(v1::AtlasUse::None)).await;
    assert_eq!(unchanging(again), unchanging(fresh));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_workers_gives_the_same_bytes() {
    for request in [floating_remote(), held_remote()] {
        let request = v1::FindGraspRequest {
            reproducible: true,
            ..request
        };
        let mut answers = Vec::new();
        for workers in [1, 2, 3, 8] {
            let server = TestServer::start_with(|config| config.workers = workers.try_into().unwrap()).await;
            let answer = ask(&server, request.clone()).await;
            assert_eq!(answer.outcome(), v1::Outcome::Found, "{}", request.object);
            answers.push(unchanging(answer));
            server.stop().await;
        }
        assert!(answers.windows(2).all(|pair| pair[0] == pair[1]));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_workers_gives_the_same_nearest_miss() {
    let mut answers = Vec::new();
    for workers in [1, 3] {
        let server = TestServer::start_with(|config| config.workers = workers.try_into().unwrap()).await;
        let request = v1::FindGraspRequest {
            reproducible: true,
            max_attempts: Some(1000),
            budget: Some(seconds(10)),
            ..impossible(&server).await
        };
        answers.push(unchanging(ask(&server, request).await));
        server.stop().await;
    }
    assert_eq!(answers[0], answers[1]);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_reported_seed_and_attempt_replay_the_grasp() {
    let server = TestServer::start().await;
    let first = ask(
        &server,
        v1::FindGraspRequest {
            seed: None,
            ..floating_remote()
        },
    )
    .await;
    let report = first.report.unwrap();
    let hand = first.grasp.as_ref().expect("it can be held").handedness();
    let replay = v1::FindGraspRequest {
        seed: Some(report.seed),
        only_attempt: report.attempt,
        receiving_hand: Some(receiving(hand)),
        ..floating_remote()
    };
    let second = ask(&server, replay).await;
    assert_eq!(second.grasp, first.grasp);
    let replayed = second.report.unwrap();
    assert_eq!((replayed.attempts, replayed.attempt), (1, report.attempt));
    server.stop().await;
}

/// The scissors with known grips as givers: some leave no known grip.
fn givers_of_the_scissors() -> impl Iterator<Item = ClientHoldout> {
    let rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
    let known = complete_atlas("scissors", rig);
    (0..known.entries().len()).map(move |index| ClientHoldout {
        client_from_object: Pose::IDENTITY,
        giver: HandJoints::of_pose(rig, &known.entries()[index].grip.pose),
    })
}

/// A reproducible search with such a giver.
fn reproducible_search(holdout: &ClientHoldout) -> v1::FindGraspRequest {
    v1::FindGraspRequest {
        budget: Some(seconds(10)),
        max_attempts: Some(400),
        seed: Some(7),
        reproducible: true,
        receiving_hand: Some(receiving(v1::Handedness::Right)),
        ..holdout.request("objects/scissors")
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn without_an_atlas_transferred_grips_seed_the_search() {
    let server = TestServer::start().await;
    let scissors = &object("scissors").expect("they are built in").object;
    let (hand, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig.handedness == Handedness::Right)
        .expect("there are grips for the right hand");
    let transferred = Arc::new(TransferredGrips::of(scissors, held));
    let search = |holdout: &ClientHoldout, seeds: SeedSource| {
        let holdout = holdout.holdout(Arc::clone(scissors));
        search_from(seeds, &holdout, &hand.rig, 7, 400).report.attempt
    };
    let mut differing = 0;
    for holdout in givers_of_the_scissors().step_by(40).take(12) {
        let request = reproducible_search(&holdout);
        let answer = ask(&server, request.clone()).await;
        let report = answer.report.expect("every answer has a report");
        let expected = search(&holdout, SeedSource::Transferred(Arc::clone(&transferred)));
        assert_eq!(report.attempt, expected);
        assert_eq!(report.atlas_stamp, "");
        differing += usize::from(search(&holdout, SeedSource::Nothing) != expected);
        // The attempt alone gives the same grasp.
        let replay = v1::FindGraspRequest {
            only_attempt: report.attempt,
            max_attempts: None,
            ..request
        };
        if report.attempt.is_some() {
            assert_eq!(ask(&server, replay).await.grasp, answer.grasp);
        }
    }
    assert!(
        differing >= 3,
        "transferred grips change {differing} of 12 answers"
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_perturbed_grip_is_replayed_with_the_same_atlas() {
    let (server, _folder) = with_complete_atlas("scissors").await;
    let replay_of = |request: &v1::FindGraspRequest, report: &v1::SearchReport, atlas: v1::AtlasUse| {
        v1::FindGraspRequest {
            only_attempt: report.attempt,
            max_attempts: None,
            atlas: atlas.into(),
            ..request.clone()
        }
    };
    let mut replayed = 0;
    // Few givers leave no known grip, so each of them is asked for with several seeds.
    let searches = givers_of_the_scissors().flat_map(|holdout| {
        let request = reproducible_search(&holdout);
        (7..12).map(move |seed| v1::FindGraspRequest {
            seed: Some(seed),
            ..request.clone()
        })
    });
    let mut answered_by_atlas = None;
    for request in searches {
        if answered_by_atlas == request.presenting_hand {
            continue;
        }
        let first = ask(&server, request.clone()).await;
        let report = first.report.as_ref().expect("every answer has a report");
        if report.source() == v1::GraspSource::Atlas {
            answered_by_atlas = request.presenting_hand.clone();
        }
        if report.source() != v1::GraspSource::Search {
            continue;
        }
        let again = ask(&server, replay_of(&request, report, v1::AtlasUse::Allowed)).await;
        assert_eq!(again.grasp, first.grasp);
        let replay = again.report.expect("every answer has a report");
        assert_eq!(replay.source(), v1::GraspSource::Search);
        assert_eq!((replay.attempts, replay.atlas_entries), (1, 0));
        assert_eq!(replay.atlas_stamp, report.atlas_stamp);
        assert!(!replay.atlas_stamp.is_empty());
        // Without the atlas, an attempt that perturbs a known grip gives another grasp or, usually, none.
        let without = ask(&server, replay_of(&request, report, v1::AtlasUse::None)).await;
        replayed += usize::from(without.grasp.is_none());
        if replayed == 2 {
            break;
        }
    }
    assert_eq!(replayed, 2);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_absent_seed_is_drawn_per_request() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest {
        seed: None,
        max_attempts: Some(1),
        ..floating_remote()
    };
    let first = ask(&server, request.clone()).await.report.unwrap().seed;
    let second = ask(&server, request).await.report.unwrap().seed;
    assert_ne!(first, second);
    server.stop().await;
}
