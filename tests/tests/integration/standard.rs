//! Standard services: health and reflection, and a start when the server is ready.

use std::{env, process::Command};

use grasp_assets::hands::{RIG_NAMES, hand};
use grasp_synthesis::{model::hand::Handedness, propose::prepared::PreparedRig};
use grasp_tests::TestServer;
use prost::Message as _;
use tokio_stream::once;
use tonic::Code;
use tonic_health::pb::{
    HealthCheckRequest, health_check_response::ServingStatus, health_client::HealthClient,
};

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
}

/// Services that must be listed.
const SERVICES: [&str; 4] = [
    "grasp.v1.GraspService",
    "grasp.v1.ObjectService",
    "grasp.v1.HandRigService",
    "grpc.health.v1.Health",
];

/// Tests one version of the protocol; both have the same messages, in different packages.
macro_rules! reflection_test {
    ($test:ident, $version:ident) => {
        #[tokio::test(flavor = "multi_thread")]
        async fn $test() {
            use tonic_reflection::pb::$version::{
                ServerReflectionRequest, server_reflection_client::ServerReflectionClient,
                server_reflection_request::MessageRequest, server_reflection_response::MessageResponse,
            };
            let server = TestServer::start().await;
            let mut client = ServerReflectionClient::new(server.channel().await);
            let mut ask = async |request| {
                let request = once(ServerReflectionRequest {
                    host: String::new(),
                    message_request: Some(request),
                });
                let mut answers = client
                    .server_reflection_info(request)
                    .await
                    .unwrap()
                    .into_inner();
                let answer = answers.message().await.unwrap().expect("an answer");
                answer.message_response.expect("it is set")
            };
            let list = ask(MessageRequest::ListServices(String::new())).await;
            let MessageResponse::ListServicesResponse(list) = list else {
                panic!("not a list: {list:?}");
            };
            for name in SERVICES {
                assert!(
                    list.service.iter().any(|service| service.name == name),
                    "{name}"
                );
                let answer = ask(MessageRequest::FileContainingSymbol(name.to_owned())).await;
                let MessageResponse::FileDescriptorResponse(files) = answer else {
                    panic!("no file for {name}: {answer:?}");
                };
                let file =
                    prost_types::FileDescriptorProto::decode(&*files.file_descriptor_proto[0]).unwrap();
                let mut services = file
                    .service
                    .iter()
                    .map(|service| format!("{}.{}", file.package(), service.name()));
                assert!(services.any(|service| service == name), "{name}");
            }
            server.stop().await;
        }
    };
}

reflection_test!(lists_and_describes_services_by_v1, v1);
reflection_test!(lists_and_describes_services_by_v1alpha, v1alpha);

/// The rig of each built-in hand.
fn rigs() -> impl Iterator<Item = &'static PreparedRig> {
    let names = RIG_NAMES.into_iter();
    names.flat_map(|rig| {
        [Handedness::Left, Handedness::Right]
            .map(|handedness| &hand(rig, handedness).expect("it is built in").rig)
    })
}

/// Set for the process in which the test runs alone.
const ALONE: &str = "GRASP_TEST_ALONE";

#[tokio::test]
async fn hands_are_prepared_before_the_server_serves() {
    if env::var_os(ALONE).is_none() {
        let mut test = Command::new(env::current_exe().expect("the test is a program"));
        test.args(["--exact", "standard::hands_are_prepared_before_the_server_serves"]);
        let output = test.env(ALONE, "1").output().expect("it runs again");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && text.contains("1 passed"), "{text}");
        return;
    }
    assert_eq!(rigs().filter(|rig| rig.is_derived()).count(), 0);
    let _server = TestServer::start().await;
    for rig in rigs() {
        assert!(rig.is_derived());
    }
}
