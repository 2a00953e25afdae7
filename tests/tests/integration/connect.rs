//! The Connect protocol over HTTP/1.1 and HTTP/2: JSON and protobuf, streams, errors and limits.

use std::{io::Write as _, net::SocketAddr};

use base64::{Engine as _, engine::general_purpose::STANDARD_NO_PAD};
use bytes::Bytes;
use flate2::{Compression, read::GzDecoder, write::GzEncoder};
use grasp_client::json::{from_json, to_json};
use grasp_proto::v1;
use grasp_server::WebOrigins;
use grasp_tests::TestServer;
use prost::Message as _;
use serde_json::{Value, json};
use tonic_types::pb;

use crate::{
    fixtures::{bounded, box_request, find, floating_remote, reproducible, until},
    wire::{Answer, Connection, answer_over_http_2, answer_to, call, framed_bytes},
};

const FIND: &str = "GraspService/FindGrasp";
const STREAM: &str = "GraspService/StreamGrasps";
const JSON: (&str, &str) = ("content-type", "application/json");
const JSON_STREAM: (&str, &str) = ("content-type", "application/connect+json");

/// Calls a method over HTTP/1.1 with a JSON text.
async fn call_json(address: SocketAddr, method: &str, headers: &[(&str, &str)], text: &str) -> Answer {
    let headers = [&[JSON], headers].concat();
    bounded("an answer", call(address, method, &headers, text.into())).await
}

fn value(text: &[u8]) -> Value {
    serde_json::from_slice(text).unwrap_or_else(|_| panic!("no JSON: {}", String::from_utf8_lossy(text)))
}

/// The JSON of an error with this status of HTTP.
fn error(answer: &Answer, status: u16, code: &str) -> Value {
    let error = value(&answer.body);
    assert_eq!((answer.status, &error["code"]), (status, &json!(code)), "{error}");
    assert_eq!(answer.header("content-type"), Some("application/json"));
    error
}

/// The messages of a stream and the message that ends it.
fn envelopes(body: &[u8]) -> (Vec<Value>, Value) {
    let (mut messages, mut rest, mut end) = (Vec::new(), body, None);
    while let [flags, a, b, c, d, tail @ ..] = rest {
        assert!(end.is_none(), "nothing follows the end");
        let (message, after) = tail.split_at(u32::from_be_bytes([*a, *b, *c, *d]) as usize);
        rest = after;
        match flags {
            0 => messages.push(value(message)),
            2 => end = Some(value(message)),
            _ => panic!("flags {flags}"),
        }
    }
    assert!(rest.is_empty());
    (messages, end.expect("the stream ends"))
}

fn packed(content: &[u8]) -> Vec<u8> {
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    packer.write_all(content).unwrap();
    packer.finish().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn json_and_protobuf_are_answered_like_grpc_over_both_versions_of_http() {
    let server = TestServer::start().await;
    let request = reproducible(floating_remote());
    let expected = find(&server, request.clone()).await.grasps;
    let text = to_json(&request).unwrap().to_string();
    let protobuf = request.encode_to_vec();
    for (content_type, body) in [
        ("application/json", text.into_bytes()),
        ("application/proto", protobuf),
    ] {
        let headers = [("content-type", content_type), ("connect-protocol-version", "1")];
        let answers = [
            call(server.address(), FIND, &headers, body.clone()).await,
            answer_over_http_2(&server, FIND, &headers, body).await,
        ];
        for answer in answers {
            assert_eq!(answer.status, 200);
            assert_eq!(answer.header("content-type"), Some(content_type));
            assert_eq!(answer.header("grpc-status"), None);
            let length = answer.body.len().to_string();
            assert_eq!(answer.header("content-length"), Some(length.as_str()));
            let found: v1::FindGraspResponse = if content_type == "application/json" {
                from_json(&value(&answer.body)).unwrap()
            } else {
                v1::FindGraspResponse::decode(&*answer.body).unwrap()
            };
            assert_eq!(found.grasps, expected);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_have_their_status_code_and_details() {
    let server = TestServer::start().await;
    let text = r#"{"holdout": {"object": "objects/remote"}, "requirements": {"friction": -1}}"#;
    let error_of_value = error(
        &call_json(server.address(), FIND, &[], text).await,
        400,
        "invalid_argument",
    );
    let details = error_of_value["details"].as_array().unwrap();
    let bad = details
        .iter()
        .find(|detail| detail["type"] == "google.rpc.BadRequest")
        .unwrap();
    assert_eq!(
        bad["debug"]["fieldViolations"][0]["field"],
        "requirements.friction"
    );
    let bytes = STANDARD_NO_PAD.decode(bad["value"].as_str().unwrap()).unwrap();
    let bad = pb::BadRequest::decode(&*bytes).unwrap();
    assert_eq!(bad.field_violations[0].field, "requirements.friction");
    for (method, body, status, code, part) in [
        (
            "ObjectService/GetObject",
            r#"{"name": "objects/none"}"#,
            404,
            "not_found",
            "objects/none",
        ),
        (
            FIND,
            r#"{"holdout": {"objekt": 1}}"#,
            400,
            "invalid_argument",
            "holdout.objekt: is no field of Holdout; it has object",
        ),
        (
            FIND,
            r#"{"search": {"budget": 2}}"#,
            400,
            "invalid_argument",
            "search.budget: ",
        ),
        (FIND, r#"{"holdout": "#, 400, "invalid_argument", "column 12"),
        (FIND, "{} {}", 400, "invalid_argument", "trailing"),
        (FIND, "", 400, "invalid_argument", "body: is empty"),
        (
            "GraspService/findgrasp",
            "{}",
            501,
            "unimplemented",
            "/grasp.v1.GraspService/FindGrasp",
        ),
        (STREAM, "{}", 415, "unimplemented", "application/connect+json"),
    ] {
        let error = error(
            &call_json(server.address(), method, &[], body).await,
            status,
            code,
        );
        assert!(error["message"].as_str().unwrap().contains(part), "{error}");
    }
    let nested = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    let nested = format!(r#"{{"holdout": {{"obstacles": {nested}}}}}"#);
    error(
        &call_json(server.address(), FIND, &[], &nested).await,
        400,
        "invalid_argument",
    );
    for (header, part) in [
        (("connect-protocol-version", "2"), "it must be \"1\""),
        (("connect-timeout-ms", "1.5"), "connect-timeout-ms: is \"1.5\""),
        (("connect-timeout-ms", "12345678901"), "10 digits"),
    ] {
        let error = error(
            &call_json(server.address(), FIND, &[header], "{}").await,
            400,
            "invalid_argument",
        );
        assert!(error["message"].as_str().unwrap().contains(part), "{error}");
    }
    let brotli = [("content-encoding", "br")];
    let error = error(
        &call_json(server.address(), FIND, &brotli, "{}").await,
        501,
        "unimplemented",
    );
    assert!(error["message"].as_str().unwrap().contains("gzip"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn large_answers_are_packed_and_packed_requests_are_read_within_limits() {
    let server = TestServer::start().await;
    let accepting = [("accept-encoding", "br, gzip")];
    let answer = call_json(server.address(), "HandRigService/ListRigs", &accepting, "{}").await;
    assert_eq!(answer.header("content-encoding"), Some("gzip"));
    let rigs: Value = serde_json::from_reader(GzDecoder::new(&*answer.body)).unwrap();
    assert!(!rigs["rigs"].as_array().unwrap().is_empty());
    let gzip = [JSON, ("content-encoding", "gzip")];
    let name = packed(br#"{"name": "rigs/adult"}"#);
    let answer = call(server.address(), "HandRigService/GetRig", &gzip, name).await;
    assert_eq!(
        (answer.status, &value(&answer.body)["name"]),
        (200, &json!("rigs/adult"))
    );
    // Ten megabytes, packed to ten kilobytes.
    let bomb = packed(&vec![b' '; 10 << 20]);
    let answer = call(server.address(), FIND, &gzip, bomb).await;
    error(&answer, 400, "out_of_range");
    let answer = call(server.address(), FIND, &gzip, b"no gzip".to_vec()).await;
    error(&answer, 400, "invalid_argument");
    let large = " ".repeat(2 << 20);
    let answer = answer_over_http_2(&server, FIND, &[JSON], large.into_bytes()).await;
    error(&answer, 400, "out_of_range");
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_are_uploaded_as_json_up_to_the_limit_of_other_clients() {
    let server = TestServer::start_with(|config| {
        config.maximum_object_bytes = (256 << 10).try_into().unwrap();
    })
    .await;
    // As many bytes as a mesh may have.
    let mut request = box_request("padded");
    request.mesh.resize(256 << 10, b'\n');
    let text = to_json(&request).unwrap().to_string();
    let answer = call_json(server.address(), "ObjectService/CreateObject", &[], &text).await;
    let created = value(&answer.body);
    assert_eq!(
        (answer.status, &created["name"]),
        (200, &json!("objects/padded")),
        "{created}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn deadlines_end_calls_and_tools_call_without_pages() {
    let server = TestServer::start_with(|config| config.web_origins = WebOrigins::NONE).await;
    let text = to_json(&floating_remote()).unwrap().to_string();
    let answer = call_json(server.address(), FIND, &[("connect-timeout-ms", "0")], &text).await;
    error(&answer, 504, "deadline_exceeded");
    let answer = call_json(
        server.address(),
        FIND,
        &[("connect-timeout-ms", "9999999999")],
        &text,
    )
    .await;
    assert_eq!(answer.status, 200);
    let page = [("origin", "http://localhost:5173")];
    assert_eq!(call_json(server.address(), FIND, &page, &text).await.status, 403);
    // Health is a service like any other.
    let mut connection = Connection::open(&server, 1 << 20).await;
    let (answer, mut body) = connection
        .call("grpc.health.v1.Health/Check", &[JSON])
        .await
        .unwrap();
    body.send_data(Bytes::from_static(b"{}"), true).unwrap();
    assert_eq!(value(&answer_to(answer).await.body), json!({"status": "SERVING"}));
    connection.task.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_come_in_envelopes_and_end_with_their_status() {
    let server = TestServer::start().await;
    let text = r#"{"holdout": {"object": "objects/remote"}, "search": {"seed": 1, "budget": "0.2s"}}"#;
    let body = framed_bytes(text.as_bytes());
    for answer in [
        call(server.address(), STREAM, &[JSON_STREAM], body.clone()).await,
        answer_over_http_2(&server, STREAM, &[JSON_STREAM], body).await,
    ] {
        assert_eq!(answer.status, 200);
        assert_eq!(answer.header("content-type"), Some("application/connect+json"));
        let (messages, end) = envelopes(&answer.body);
        assert_eq!(messages.last().unwrap()["outcome"], "OUTCOME_FOUND");
        assert_eq!(end, json!({}));
    }
    let wrong = framed_bytes(br#"{"holdout": {"object": "objects/none"}}"#);
    let answer = call(server.address(), STREAM, &[JSON_STREAM], wrong).await;
    let (messages, end) = envelopes(&answer.body);
    assert_eq!((answer.status, messages.len()), (200, 0));
    assert_eq!(end["error"]["code"], "not_found");
    for (malformed, part) in [
        (&[2, 0, 0, 0, 2, b'{', b'}'][..], "flags of an envelope are 2"),
        (&[1, 0, 0, 0, 2, b'{', b'}'], "is not gzip"),
        (&[0, 0, 0, 0, 9, b'{', b'}'], "2 of 9 bytes"),
        (&[0, 0, 0], "3 of an envelope's"),
        (&[0, 0xff, 0xff, 0xff, 0xff], "more than"),
        (&[], "message"),
    ] {
        let answer = call(server.address(), STREAM, &[JSON_STREAM], malformed.to_vec()).await;
        let (_, end) = envelopes(&answer.body);
        let message = end["error"]["message"].as_str().unwrap();
        assert!(message.contains(part), "{part} in {message}");
    }
    until("the end of all calls", || server.gauges().calls() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_both_ways_need_http_2() {
    let server = TestServer::start().await;
    let track = "GraspService/TrackHoldout";
    let start = framed_bytes(br#"{"track": {"holdout": {"object": "objects/remote"}}}"#);
    let answer = call(server.address(), track, &[JSON_STREAM], start.clone()).await;
    let refused = error(&answer, 505, "unimplemented");
    assert!(
        refused["message"].as_str().unwrap().contains("HTTP/2"),
        "{refused}"
    );
    let frame = framed_bytes(br#"{"frame": {"sequence": "1"}}"#);
    let answer = answer_over_http_2(&server, track, &[JSON_STREAM], [start, frame].concat()).await;
    let (messages, end) = envelopes(&answer.body);
    assert_eq!(end, json!({}), "{messages:?}");
    assert_eq!(messages[0]["sequence"], "1", "{messages:?}");
}
