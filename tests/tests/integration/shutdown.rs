//! Shutdown: immediate when idle, and after a bounded drain of running calls.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;
use tokio::{io::AsyncReadExt as _, net::TcpStream};
use tonic::Code;

use crate::fixtures::{bounded, impossible, until};

#[tokio::test(flavor = "multi_thread")]
async fn idle_connections_do_not_delay_shutdown() {
    let server = TestServer::start_with(|config| config.drain = Duration::from_hours(1)).await;
    let mut silent = TcpStream::connect(server.address()).await.unwrap();
    let mut idle = server.objects().await;
    idle.list_objects(v1::ListObjectsRequest::default())
        .await
        .unwrap();
    let address = server.address();
    bounded("the end", server.stop()).await;
    // The server's end of the silent connection is closed, and the port is free.
    let mut buffer = Vec::new();
    bounded("the end of the connection", silent.read_to_end(&mut buffer))
        .await
        .ok();
    assert!(TcpStream::connect(address).await.is_err());
}

#[tokio::test(flavor = "multi_thread")]
async fn running_calls_are_answered_during_the_drain() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_millis(700));
    let mut client = server.grasps().await;
    let call = tokio::spawn(async move { client.find_grasp(request).await });
    until("the search", || server.gauges().searches() == 1).await;
    let stopping = server.begin_stop();
    let answer = call
        .await
        .unwrap()
        .expect("the call is answered while the server drains");
    assert_eq!(answer.into_inner().outcome(), v1::Outcome::BudgetExhausted);
    bounded("the end", stopping.stopped()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_that_outlast_the_drain_are_cancelled() {
    let server = TestServer::start_with(|config| {
        config.drain = Duration::from_millis(50);
        config.budgets.maximum = Duration::from_mins(10);
    })
    .await;
    let request = impossible(&server).await.with_budget(Duration::from_mins(10));
    let mut client = server.grasps().await;
    let call = tokio::spawn(async move { client.find_grasp(request).await });
    until("the search", || server.gauges().searches() == 1).await;
    let stopping = server.begin_stop();
    let gauges = stopping.gauges().clone();
    bounded("the end", stopping.stopped()).await;
    let status = bounded("the end of the call", call).await.unwrap().unwrap_err();
    assert!(
        matches!(status.code(), Code::Unavailable | Code::Unknown | Code::Cancelled),
        "{status}"
    );
    until("the end of the search", || gauges.searches() == 0).await;
}
