//! Messages as bytes: those that are none, and those packed with gzip.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::{Code, codec::CompressionEncoding::Gzip};

use crate::{
    fixtures::{assert_status, bounded, box_request, floating_remote, reason, reproducible},
    wire::{answer_over_http_2, framed_bytes},
};

#[tokio::test(flavor = "multi_thread")]
async fn bytes_that_are_no_message_are_invalid_arguments() {
    let server = TestServer::start().await;
    let wrong = [
        ("an unknown wire type", framed_bytes(&[0x0f])),
        ("a length beyond the end", framed_bytes(&[0x0a, 0x7f, b'x'])),
        ("text that is not UTF-8", framed_bytes(&[0x0a, 0x02, 0xff, 0xfe])),
        ("a varint without an end", framed_bytes(&[0xff; 12])),
        ("a frame cut short", framed_bytes(b"name")[..7].to_vec()),
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
            let answer = bounded(what, answer_over_http_2(&server, method, &[], body.clone())).await;
            let status = answer.status_in_headers();
            let found = (status.code(), reason(&status));
            let expected = (Code::InvalidArgument, "MALFORMED_MESSAGE".to_owned());
            assert_eq!(found, expected, "{what} to {method}: {status:?}");
        }
    }
    // The server is as before, and right bytes are understood.
    let name = b"\x0a\x0eobjects/remote";
    let answer = answer_over_http_2(&server, "ObjectService/GetObject", &[], framed_bytes(name)).await;
    assert_eq!(answer.status_in_headers().code(), Code::Ok);
}

#[tokio::test(flavor = "multi_thread")]
async fn packed_requests_are_understood() {
    let server = TestServer::start().await;
    let mut plain = server.grasps().await;
    let mut packing = server.grasps().await.send_compressed(Gzip);
    let request = reproducible(floating_remote());
    let packed = packing.find_grasp(request.clone()).await.unwrap();
    let unpacked = plain.find_grasp(request).await.unwrap();
    assert_eq!(packed.into_inner().grasps, unpacked.into_inner().grasps);
    let mut objects = server.objects().await.send_compressed(Gzip);
    let object = objects.create_object(box_request("crate")).await.unwrap();
    assert_eq!(object.into_inner().triangle_count, 12);
}

#[tokio::test(flavor = "multi_thread")]
async fn large_answers_are_packed_for_clients_that_accept_it() {
    let server = TestServer::start().await;
    let get = || v1::GetMeshRequest {
        name: "objects/remote".to_owned(),
    };
    let mut glb = Vec::new();
    for accepts in [false, true] {
        let mut objects = server.objects().await;
        if accepts {
            objects = objects.accept_compressed(Gzip);
        }
        let answer = objects.get_mesh(get()).await.unwrap();
        let encoding = answer.metadata().get("grpc-encoding").cloned();
        assert_eq!(encoding.is_some_and(|encoding| encoding == "gzip"), accepts);
        let mut parts = answer.into_inner();
        let mut pieces = Vec::new();
        while let Some(part) = parts.message().await.unwrap() {
            pieces.extend(part.piece);
        }
        glb.push(pieces);
    }
    assert!(glb[0].len() > 1000 && glb[0] == glb[1]);
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_of_small_messages_are_not_packed() {
    let server = TestServer::start().await;
    let mut grasps = server.grasps().await.accept_compressed(Gzip);
    let request = v1::StreamGraspsRequest::from(floating_remote()).with_budget(Duration::from_millis(50));
    let answer = grasps.stream_grasps(request).await.unwrap();
    assert_eq!(answer.metadata().get("grpc-encoding"), None);
    let mut stream = answer.into_inner();
    let mut messages = 0;
    while stream.message().await.unwrap().is_some() {
        messages += 1;
    }
    assert!(messages >= 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_large_only_when_unpacked_is_refused() {
    let server =
        TestServer::start_with(|config| config.maximum_object_bytes = (1 << 20).try_into().unwrap()).await;
    let mut objects = server.objects().await.send_compressed(Gzip);
    let mut grasps = server.grasps().await.send_compressed(Gzip);
    // 40 MB of one letter take 40 kB.
    let bomb = v1::CreateObjectRequest {
        mesh: vec![b'\n'; 40_000_000],
        ..box_request("bomb")
    };
    // The bound of a method that takes no mesh is its own, though the packed message is smaller than that.
    let name = "n".repeat(1 << 20);
    let find = v1::FindGraspRequest::new(name.clone());
    for status in [
        objects.create_object(bomb).await.unwrap_err(),
        objects
            .get_object(v1::GetObjectRequest { name })
            .await
            .unwrap_err(),
        grasps.find_grasp(find).await.unwrap_err(),
    ] {
        assert_status(&status, Code::OutOfRange, "MESSAGE_TOO_LARGE");
    }
    // What is not packed as it says is the client's fault.
    let mut body = framed_bytes(b"no gzip");
    body[0] = 1;
    let headers = [("grpc-encoding", "gzip")];
    let answer = answer_over_http_2(&server, "ObjectService/GetObject", &headers, body).await;
    assert_status(
        &answer.status_in_headers(),
        Code::InvalidArgument,
        "MALFORMED_MESSAGE",
    );
}
