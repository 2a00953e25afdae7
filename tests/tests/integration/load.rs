//! Concurrent calls, up to the limits and beyond.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::fixtures::{bounded, floating_remote, impossible, reason, until};

/// Longer than any test takes.
const LONG: Duration = Duration::from_secs(10);

#[tokio::test(flavor = "multi_thread")]
async fn concurrent_calls_are_all_answered() {
    let server = TestServer::start().await;
    let client = server.grasps().await;
    let calls: Vec<_> = (0..32_u64)
        .map(|seed| {
            let mut client = client.clone();
            tokio::spawn(async move { client.find_grasp(floating_remote().with_seed(seed)).await })
        })
        .collect();
    for (seed, call) in calls.into_iter().enumerate() {
        let answer = bounded("an answer", call).await.unwrap().unwrap().into_inner();
        assert_eq!(answer.outcome(), v1::Outcome::Found);
        assert_eq!(answer.origin.unwrap().seed, seed as u64);
    }
    until("the end of all searches", || server.gauges().searches() == 0).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_search_does_not_block_others() {
    let server = TestServer::start().await;
    let hopeless = impossible(&server).await.with_budget(LONG);
    let mut client = server.grasps().await;
    let long = tokio::spawn(async move { client.find_grasp(hopeless).await });
    until("the long search", || server.gauges().searches() == 1).await;
    let answer = server
        .grasps()
        .await
        .find_grasp(floating_remote())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.outcome(), v1::Outcome::Found);
    assert!(
        !long.is_finished(),
        "the short search was answered only after the long one"
    );
    long.abort();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn searches_beyond_the_limit_are_rejected_with_a_retry_delay() {
    let server = TestServer::start_with(|config| config.maximum_searches = 1.try_into().unwrap()).await;
    let request = impossible(&server).await.with_budget(LONG);
    let mut client = server.grasps().await;
    let first = tokio::spawn({
        let request = request.clone();
        async move { client.find_grasp(request).await }
    });
    until("the first search", || server.gauges().searches() == 1).await;
    let status = server.grasps().await.find_grasp(request).await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_SEARCHES".to_owned())
    );
    let details = status.get_error_details();
    assert!(details.retry_info().unwrap().retry_delay > Some(Duration::ZERO));
    assert!(status.metadata().contains_key("grpc-retry-pushback-ms"));
    first.abort();
    until("the end of the search", || server.gauges().searches() == 0).await;
    let after = floating_remote().with_budget(Duration::from_millis(500));
    server
        .grasps()
        .await
        .find_grasp(after)
        .await
        .expect("the place is free again");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_beyond_the_limit_wait() {
    let server = TestServer::start_with(|config| config.maximum_connections = 1.try_into().unwrap()).await;
    let mut first = server.objects().await;
    let list = v1::ListObjectsRequest::default;
    first
        .list_objects(list())
        .await
        .expect("the first connection has a place");
    let mut second = server.objects_lazily();
    let waiting = tokio::spawn(async move { second.list_objects(list()).await });
    for _ in 0..50 {
        first
            .list_objects(list())
            .await
            .expect("the first connection keeps its place");
    }
    assert!(
        !waiting.is_finished(),
        "the second connection was served along with the first"
    );
    drop(first);
    bounded("the second connection's answer", waiting)
        .await
        .unwrap()
        .expect("the place is free");
    server.stop().await;
}
