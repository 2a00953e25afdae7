//! Bytes that are no message of the contract, and errors whose headers every client takes, whatever is wrong with how much.

use bytes::Bytes;
use grasp_proto::v1::{self, shape::Kind};
use grasp_tests::TestServer;
use http::{HeaderMap, Request};
use prost::Message;
use tokio::net::TcpStream;
use tonic::{Code, Status};

use crate::fixtures::{
    bounded, box_request, floating_remote, forbidden, reason, update_of, with, with_object,
};

/// Sends bytes as the body of a unary call; returns the status.
async fn status_of(server: &TestServer, method: &str, body: Vec<u8>) -> Status {
    status_within(server, method, body, None).await
}

/// The same for a message that is said to be packed with gzip.
pub(crate) async fn status_of_packed(server: &TestServer, method: &str, packed: &[u8]) -> Status {
    let mut body = framed(packed);
    body[0] = 1;
    status_with(server, method, body, &[("grpc-encoding", "gzip")]).await
}

/// The same with a `grpc-timeout`, which this client does not enforce itself.
pub(crate) async fn status_within(
    server: &TestServer,
    method: &str,
    body: Vec<u8>,
    timeout: Option<&str>,
) -> Status {
    let timeout = timeout.map(|timeout| ("grpc-timeout", timeout));
    status_with(server, method, body, timeout.as_slice()).await
}

/// The same with further headers.
async fn status_with(server: &TestServer, method: &str, body: Vec<u8>, headers: &[(&str, &str)]) -> Status {
    let answer = headers_of(server, method, body, headers).await;
    Status::from_header_map(&answer).expect("every answer has a status")
}

/// The headers and trailers of the answer to such a call.
pub(crate) async fn headers_of(
    server: &TestServer,
    method: &str,
    body: Vec<u8>,
    headers: &[(&str, &str)],
) -> HeaderMap {
    let stream = TcpStream::connect(server.address()).await.unwrap();
    let (sender, connection) = h2::client::handshake(stream).await.unwrap();
    let connection = tokio::spawn(connection);
    let mut request = Request::post(format!("{}/grasp.v1.{method}", server.endpoint()))
        .header("content-type", "application/grpc")
        .header("te", "trailers");
    for &(name, value) in headers {
        request = request.header(name, value);
    }
    let request = request.body(()).unwrap();
    let mut sender = sender.ready().await.unwrap();
    let (answer, mut stream) = sender.send_request(request, false).unwrap();
    stream.send_data(Bytes::from(body), true).unwrap();
    let answer = answer.await.unwrap();
    let mut headers: HeaderMap = answer.headers().clone();
    let mut body = answer.into_body();
    while let Some(data) = body.data().await {
        data.unwrap();
    }
    headers.extend(body.trailers().await.unwrap().unwrap_or_default());
    connection.abort();
    headers
}

/// A message as gRPC frames it.
pub(crate) fn framed(message: &[u8]) -> Vec<u8> {
    let length = u32::try_from(message.len()).unwrap().to_be_bytes();
    [&[0], &length[..], message].concat()
}

#[tokio::test(flavor = "multi_thread")]
async fn bytes_that_are_no_message_are_invalid_arguments() {
    let server = TestServer::start().await;
    let wrong = [
        ("an unknown wire type", framed(&[0x0f])),
        ("a length beyond the end", framed(&[0x0a, 0x7f, b'x'])),
        ("text that is not UTF-8", framed(&[0x0a, 0x02, 0xff, 0xfe])),
        ("a varint without an end", framed(&[0xff; 12])),
        ("a frame cut short", framed(b"name")[..7].to_vec()),
        ("no frame", Vec::new()),
        (
            "compression that was not announced",
            [&[1, 0, 0, 0, 1], &b"x"[..]].concat(),
        ),
        ("an invalid flag", [&[9, 0, 0, 0, 1], &b"x"[..]].concat()),
    ];
    for method in [
        "ObjectService/GetObject",
        "ObjectService/CreateObject",
        "GraspService/FindGrasp",
    ] {
        for (what, body) in &wrong {
            let status = bounded(what, status_of(&server, method, body.clone())).await;
            let found = (status.code(), reason(&status));
            let expected = (Code::InvalidArgument, "MALFORMED_MESSAGE".to_owned());
            assert_eq!(found, expected, "{what} to {method}: {status:?}");
        }
    }
    // The server is as before, and right bytes are understood.
    let name = b"\x0a\x0eobjects/remote";
    let status = status_of(&server, "ObjectService/GetObject", framed(name)).await;
    assert_eq!(status.code(), Code::Ok);
    let mut objects = server.objects().await;
    let listed = objects.list_objects(v1::ListObjectsRequest::default());
    listed.await.unwrap();
}

/// Largest headers and trailers of an error, each with 32 bytes as RFC 9113 (6.5.2) counts them. Clients of gRPC's C core may drop calls
/// from 8 kB on.
const MAX_BYTES: usize = 4 << 10;

/// A hand whose joints all lie in a heap and have no orientation.
fn wrong_hand() -> v1::PresentingHand {
    let joint = v1::JointPose {
        pose: Some(v1::Pose {
            position: Some(v1::Vector3 {
                x: f32::NAN,
                y: 0.0,
                z: 0.0,
            }),
            orientation: Some(v1::Quaternion::default()),
        }),
        radius: -1.0,
    };
    v1::HandJoints::new(v1::Handedness::Left, vec![joint; 26]).into()
}

fn requests() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let find = "GraspService/FindGrasp";
    let hand = floating_remote().with_presenting_hand(wrong_hand());
    let hands = with(hand.clone(), |request| {
        request.holdout_mut().other_hands = vec![wrong_hand(); 3];
    });
    let obstacle = v1::Shape {
        kind: Some(Kind::Tube(v1::TubeShape {
            points: Vec::new(),
            radii: vec![f32::NAN],
        })),
    };
    let obstacles = vec![obstacle; 64];
    let everything = with(hands.clone(), |request| {
        request.holdout_mut().obstacles.clone_from(&obstacles);
    });
    let obstacles = with(floating_remote(), |request| {
        request.holdout_mut().obstacles = obstacles;
    });
    let groups: Vec<_> = (0..200)
        .map(|number| format!("{number}{}", "Ö".repeat(300)))
        .collect();
    let groups: Vec<_> = groups.iter().map(String::as_str).collect();
    let triangles: Vec<_> = (1000..1500).collect();
    let names = with_object(box_request("crate"), |object| {
        object.labels = (0..200)
            .map(|number| (format!("Ä{number} {}", "é".repeat(400)), "\u{1}".repeat(900)))
            .collect();
        object.regions = vec![forbidden(&groups, &triangles)];
    });
    let forbidden = with_object(names.clone(), |object| object.labels.clear());
    let get = v1::GetObjectRequest {
        name: format!("objects/{}", "💥".repeat(9000)),
    };
    let update = update_of("objects/remote", |object| object.etag = "é".repeat(9000));
    vec![
        ("a hand", find, framed(&hand.encode_to_vec())),
        ("four hands", find, framed(&hands.encode_to_vec())),
        ("obstacles", find, framed(&obstacles.encode_to_vec())),
        ("all of it", find, framed(&everything.encode_to_vec())),
        (
            "labels",
            "ObjectService/CreateObject",
            framed(&names.encode_to_vec()),
        ),
        (
            "groups",
            "ObjectService/CreateObject",
            framed(&forbidden.encode_to_vec()),
        ),
        ("a name", "ObjectService/GetObject", framed(&get.encode_to_vec())),
        (
            "an etag",
            "ObjectService/UpdateObject",
            framed(&update.encode_to_vec()),
        ),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_arrive_whatever_is_wrong_with_how_much() {
    let server = TestServer::start().await;
    for (what, method, body) in requests() {
        let headers = headers_of(&server, method, body, &[]).await;
        let bytes: usize = headers
            .iter()
            .map(|(name, value)| name.as_str().len() + value.len() + 32)
            .sum();
        assert!(bytes < MAX_BYTES, "{what}: {bytes} bytes");
        let status = Status::from_header_map(&headers).expect("it has a status");
        assert!(
            !matches!(status.code(), Code::Ok | Code::Internal | Code::Unknown),
            "{what}: {status}"
        );
        println!("{what}: {bytes} bytes, {}", status.message());
    }
}
