//! Reflection, in the current version and in the older one that many tools still use.

use grasp_tests::TestServer;
use prost::Message as _;
use tokio_stream::once;

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
            let mut requests = vec![MessageRequest::ListServices(String::new())];
            requests.extend(SERVICES.map(|name| MessageRequest::FileContainingSymbol(name.to_owned())));
            let mut responses = Vec::new();
            for request in requests {
                let request = ServerReflectionRequest {
                    host: String::new(),
                    message_request: Some(request),
                };
                let mut stream = client
                    .server_reflection_info(once(request))
                    .await
                    .unwrap()
                    .into_inner();
                responses.push(
                    stream
                        .message()
                        .await
                        .unwrap()
                        .unwrap()
                        .message_response
                        .unwrap(),
                );
            }
            let MessageResponse::ListServicesResponse(list) = &responses[0] else {
                panic!("not a list: {:?}", responses[0]);
            };
            for name in SERVICES {
                assert!(
                    list.service.iter().any(|service| service.name == name),
                    "{name} is not listed"
                );
            }
            for (name, response) in SERVICES.iter().zip(&responses[1..]) {
                let MessageResponse::FileDescriptorResponse(files) = response else {
                    panic!("no file for {name}: {response:?}");
                };
                let (package, service) = name.rsplit_once('.').unwrap();
                let file =
                    prost_types::FileDescriptorProto::decode(&*files.file_descriptor_proto[0]).unwrap();
                assert_eq!(file.package(), package);
                assert!(file.service.iter().any(|s| s.name() == service));
            }
            server.stop().await;
        }
    };
}

reflection_test!(lists_and_describes_services_by_v1, v1);
reflection_test!(lists_and_describes_services_by_v1alpha, v1alpha);
