//! The end of a server: health, the drain, and the status of what it cuts off.

use std::time::Duration;

use grasp_proto::v1::{self, track_holdout_request::Message, upload_object_request::Part};
use grasp_tests::TestServer;
use tokio::{io::AsyncReadExt as _, net::TcpStream, sync::mpsc};
use tokio_stream::{StreamExt as _, wrappers::ReceiverStream};
use tonic::{Code, Status, Streaming};
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};
use tonic_reflection::pb::v1::{
    ServerReflectionRequest, server_reflection_client::ServerReflectionClient,
    server_reflection_request::MessageRequest,
};

use crate::fixtures::{assert_status, bounded, box_request, floating_remote, impossible, until};

#[tokio::test(flavor = "multi_thread")]
async fn a_watcher_sees_the_shutdown_and_does_not_delay_it() {
    let server = TestServer::start_with(|config| config.drain = Duration::from_hours(1)).await;
    let mut client = HealthClient::new(server.channel().await);
    let request = HealthCheckRequest {
        service: "grasp.v1.GraspService".to_owned(),
    };
    let mut statuses = client.watch(request).await.unwrap().into_inner();
    let first = statuses.message().await.unwrap().unwrap();
    assert_eq!(first.status(), ServingStatus::Serving);
    let stopping = server.begin_stop();
    let second = bounded("the second status", statuses.message())
        .await
        .unwrap()
        .unwrap();
    assert_eq!(second.status(), ServingStatus::NotServing);
    let end = bounded("the end of the watch", statuses.message())
        .await
        .unwrap_err();
    assert_status(&end, Code::Unavailable, "SHUTTING_DOWN");
    bounded("the end", stopping.stopped()).await;
}

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
async fn calls_that_outlast_the_drain_end_with_a_status_that_clients_retry() {
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
    assert_status(&status, Code::Unavailable, "SHUTTING_DOWN");
    until("the end of the search", || gauges.searches() == 0).await;
}

/// Reads a stream to the status that ends it.
async fn end_of<T>(mut stream: Streaming<T>) -> Status {
    let end = async {
        loop {
            match stream.message().await {
                Ok(Some(_)) => {}
                Ok(None) => panic!("the stream ended as if it were complete"),
                Err(status) => return status,
            }
        }
    };
    bounded("the end of a stream", end).await
}

#[tokio::test(flavor = "multi_thread")]
async fn every_stream_ends_with_a_status_that_clients_retry() {
    let server = TestServer::start_with(|config| {
        config.drain = Duration::from_millis(500);
        config.budgets.maximum = Duration::from_mins(10);
    })
    .await;
    let request = impossible(&server).await.with_budget(Duration::from_mins(10));
    let found = server
        .grasps()
        .await
        .stream_grasps(v1::StreamGraspsRequest::from(request))
        .await;
    // Both streams stay open on the side of the client.
    let (tracking, frames) = mpsc::channel(1);
    let track = Some(Message::Track(v1::Track::new("objects/remote")));
    tracking
        .send(v1::TrackHoldoutRequest { message: track })
        .await
        .unwrap();
    let tracked = server
        .grasps()
        .await
        .track_holdout(ReceiverStream::new(frames))
        .await;
    let watched = server
        .objects()
        .await
        .watch_objects(v1::WatchObjectsRequest::default())
        .await;
    let (asking, questions) = mpsc::channel(1);
    let list = Some(MessageRequest::ListServices(String::new()));
    asking
        .send(ServerReflectionRequest {
            message_request: list,
            ..Default::default()
        })
        .await
        .unwrap();
    let mut reflection = ServerReflectionClient::new(server.channel().await);
    let reflected = reflection
        .server_reflection_info(ReceiverStream::new(questions))
        .await;
    let (uploading, parts) = mpsc::channel(1);
    let create = v1::CreateObjectRequest {
        mesh: Vec::new(),
        ..box_request("slow")
    };
    let create = Some(Part::Create(create));
    uploading
        .send(v1::UploadObjectRequest {
            part: create,
            total_bytes: 1000,
        })
        .await
        .unwrap();
    let mut objects = server.objects().await;
    let uploaded = tokio::spawn(async move { objects.upload_object(ReceiverStream::new(parts)).await });
    until("all calls", || server.gauges().calls() == 5).await;
    let stopping = server.begin_stop();
    for (name, end) in [
        ("StreamGrasps", end_of(found.unwrap().into_inner()).await),
        ("TrackHoldout", end_of(tracked.unwrap().into_inner()).await),
        ("WatchObjects", end_of(watched.unwrap().into_inner()).await),
        (
            "ServerReflectionInfo",
            end_of(reflected.unwrap().into_inner()).await,
        ),
        (
            "UploadObject",
            bounded("the upload", uploaded).await.unwrap().unwrap_err(),
        ),
    ] {
        println!("{name}: {end}");
        assert_status(&end, Code::Unavailable, "SHUTTING_DOWN");
    }
    bounded("the end", stopping.stopped()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_that_is_being_read_is_complete_in_spite_of_the_shutdown() {
    let server = TestServer::start().await;
    let request = v1::GetMeshRequest {
        name: "objects/scissors".to_owned(),
    };
    let mut mesh = server
        .objects()
        .await
        .get_mesh(request)
        .await
        .unwrap()
        .into_inner();
    let first = bounded("the first piece", mesh.next()).await.unwrap().unwrap();
    let stopping = server.begin_stop();
    let rest = bounded("the rest", mesh.collect::<Result<Vec<_>, _>>())
        .await
        .unwrap();
    println!(
        "{} pieces, the first of {} bytes",
        1 + rest.len(),
        prost::Message::encoded_len(&first)
    );
    bounded("the end", stopping.stopped()).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_are_answered_during_the_delay_while_probes_already_fail() {
    let server = TestServer::start_with(|config| config.drain_delay = Duration::from_millis(1500)).await;
    let address = server.endpoint();
    let mut health = HealthClient::new(server.channel().await);
    let stopping = server.begin_stop();
    let unready = async {
        while stopping.monitor("/readyz").await != Some((503, "draining\n".to_owned())) {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    bounded("the readiness", unready).await;
    let answer = health
        .check(HealthCheckRequest::default())
        .await
        .unwrap()
        .into_inner();
    assert_eq!(answer.status(), ServingStatus::NotServing);
    assert_eq!(
        stopping.monitor("/livez").await,
        Some((200, "alive\n".to_owned()))
    );
    // A balancer that has not noticed yet opens another connection.
    let client = grasp_client::GraspClient::connect(&address).await.unwrap();
    client.find_grasp(&floating_remote()).await.unwrap();
    bounded("the end", stopping.stopped()).await;
    assert!(grasp_client::GraspClient::connect(&address).await.is_err());
}
