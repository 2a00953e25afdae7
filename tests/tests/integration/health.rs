//! The standard health service.

use grasp_tests::TestServer;
use tonic::Code;
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

use crate::fixtures::bounded;

#[tokio::test(flavor = "multi_thread")]
async fn the_server_and_each_service_report_serving() {
    let server = TestServer::start().await;
    let mut client = HealthClient::new(server.channel().await);
    for service in [
        "",
        "grasp.v1.GraspService",
        "grasp.v1.ObjectService",
        "grasp.v1.HandRigService",
    ] {
        let request = HealthCheckRequest {
            service: service.to_owned(),
        };
        let answer = client.check(request).await.unwrap().into_inner();
        assert_eq!(answer.status(), ServingStatus::Serving, "{service:?}");
    }
    let request = HealthCheckRequest {
        service: "grasp.v1.Nothing".to_owned(),
    };
    assert_eq!(client.check(request).await.unwrap_err().code(), Code::NotFound);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_watcher_sees_the_shutdown_and_does_not_delay_it() {
    let server = TestServer::start().await;
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
    bounded("the end", stopping.stopped()).await;
}
