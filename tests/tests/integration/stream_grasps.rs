//! Streams of grasps: better ones as they are found, or the best that differ.

use std::{collections::HashSet, time::Duration};

use grasp_proto::v1::{self, stream_grasps_request::Sent};
use grasp_tests::TestServer;
use tokio::time::Instant;
use tonic::{Code, Status};

use crate::fixtures::{assert_status, bounded, find, floating_remote, held_remote, impossible, until, with};

/// What a stream consists of.
#[derive(Debug)]
struct Streamed {
    /// Every message but the last, with a grasp each.
    messages: Vec<v1::FindGraspResponse>,
    /// When each came.
    times: Vec<Instant>,
    /// The last message: how the search ended.
    end: v1::FindGraspResponse,
}

impl Streamed {
    fn grasps(&self) -> Vec<&v1::Grasp> {
        self.messages
            .iter()
            .map(|message| message.grasp().expect("it has a grasp"))
            .collect()
    }

    fn scores(&self) -> Vec<f32> {
        let grasps = self.grasps().into_iter();
        grasps.map(|grasp| grasp.score.expect("it is rated")).collect()
    }
}

/// Reads a stream to its end.
async fn stream(server: &TestServer, request: v1::StreamGraspsRequest) -> Result<Streamed, Status> {
    let mut client = server.grasps().await;
    let mut messages = client.stream_grasps(request).await?.into_inner();
    let (mut streamed, mut times, mut end) = (Vec::new(), Vec::new(), None);
    while let Some(message) = bounded("a message", messages.message()).await? {
        assert!(end.is_none(), "the outcome is in the last message");
        assert!(message.report.is_some() && message.origin.is_some() && message.current.is_none());
        if message.outcome() == v1::Outcome::Unspecified {
            assert_eq!(message.grasps.len(), 1, "{message:?}");
            times.push(Instant::now());
            streamed.push(message);
        } else {
            assert_eq!(message.grasps, []);
            end = Some(message);
        }
    }
    Ok(Streamed {
        messages: streamed,
        times,
        end: end.expect("an outcome ends the stream"),
    })
}

/// As many attempts as need no end by the clock, so that the search is the same each time.
fn attempts(number: u64, request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    with(request.with_budget(Duration::from_secs(10)), |request| {
        request.search_mut().max_attempts = Some(number);
    })
}

fn at_most(rate_hz: f32, request: v1::FindGraspRequest) -> v1::StreamGraspsRequest {
    v1::StreamGraspsRequest {
        sent: Some(Sent::MaxRateHz(rate_hz)),
        ..request.into()
    }
}

fn every_better(request: v1::FindGraspRequest) -> v1::StreamGraspsRequest {
    at_most(1000.0, request)
}

fn alternatives(request: v1::FindGraspRequest, count: u32, by: &[v1::DifferBy]) -> v1::StreamGraspsRequest {
    v1::StreamGraspsRequest {
        sent: Some(Sent::Alternatives(v1::Alternatives {
            count,
            differ_by: by.iter().map(|&by| by.into()).collect(),
        })),
        ..request.into()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_grasp_is_better_and_the_last_is_the_best() {
    let server = TestServer::start().await;
    let mut streamed_grasps = 0;
    for (seed, request) in [(1, floating_remote()), (2, held_remote()), (3, held_remote())] {
        let request = attempts(400, request.with_seed(seed));
        let streamed = stream(&server, every_better(request.clone())).await.unwrap();
        let scores = streamed.scores();
        assert!(scores.is_sorted_by(|a, b| a < b), "{scores:?}");
        streamed_grasps += scores.len();
        let messages = streamed.messages.iter();
        let times: Vec<_> = messages.map(v1::FindGraspResponse::search_time).collect();
        assert!(times.is_sorted() && times[0] > Duration::ZERO, "{times:?}");
        assert_eq!(streamed.end.outcome(), v1::Outcome::Found);
        // The same attempts in one answer.
        let found = with(request, |request| {
            request.search_mut().choice = v1::GraspChoice::BestWithinBudget.into();
        });
        let found = find(&server, found).await;
        let last = streamed.messages.last().unwrap();
        assert_eq!(found.grasps, last.grasps);
        assert_eq!(found.attempts(), streamed.end.attempts());
        assert_eq!(last.origin, streamed.end.origin);
    }
    assert!(streamed_grasps > 6, "{streamed_grasps}");
}

#[tokio::test(flavor = "multi_thread")]
async fn no_more_grasps_are_sent_than_wanted_per_second() {
    let server = TestServer::start().await;
    let mut skipped = 0;
    for seed in 0..4 {
        let request = attempts(300, held_remote().with_seed(seed));
        let all = stream(&server, every_better(request.clone())).await.unwrap();
        let streamed = stream(&server, at_most(2.0, request)).await.unwrap();
        // The last one comes when the search ends.
        let (_, but_last) = streamed.times.split_last().unwrap();
        for pair in but_last.windows(2) {
            assert!(pair[1] - pair[0] > Duration::from_millis(450), "{pair:?}");
        }
        assert!(streamed.scores().is_sorted_by(|a, b| a < b));
        assert_eq!(streamed.scores().last(), all.scores().last());
        skipped += all.messages.len().saturating_sub(streamed.messages.len());
    }
    assert!(skipped > 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn alternatives_differ_and_the_best_comes_first() {
    use v1::DifferBy::{Approach, Region, Type};
    let server = TestServer::start().await;
    let holdout = attempts(400, held_remote());
    let best = stream(&server, every_better(holdout.clone())).await.unwrap();
    let best = best.grasps()[best.messages.len() - 1].clone();
    for by in [&[][..], &[Type], &[Approach, Type], &[Region]] {
        let streamed = stream(&server, alternatives(holdout.clone(), 6, by))
            .await
            .unwrap();
        let grasps = streamed.grasps();
        assert!((2..=6).contains(&grasps.len()), "{by:?}: {}", grasps.len());
        let scores = streamed.scores();
        assert!(scores.is_sorted_by(|a, b| a >= b), "{scores:?}");
        assert_eq!(grasps[0], &best, "{by:?}");
        let types: HashSet<_> = grasps.iter().map(|grasp| grasp.r#type).collect();
        assert!(by != [Type] || types.len() == grasps.len(), "{types:?}");
        // Fewer are the first of more.
        let fewer = stream(&server, alternatives(holdout.clone(), 2, by))
            .await
            .unwrap();
        assert_eq!(fewer.grasps(), grasps[..2], "{by:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn shutdown_ends_streams() {
    let server = TestServer::start().await;
    let request = every_better(impossible(&server).await.with_budget(Duration::from_secs(10)));
    let mut messages = server
        .grasps()
        .await
        .stream_grasps(request)
        .await
        .unwrap()
        .into_inner();
    until("the search", || server.gauges().searches() == 1).await;
    let stopping = server.begin_stop();
    let status = bounded("the end of the stream", messages.message())
        .await
        .unwrap_err();
    assert_status(&status, Code::Unavailable, "SHUTTING_DOWN");
    bounded("the end of the server", stopping.stopped()).await;
}
