//! Pages in browsers: gRPC-Web over HTTP/1.1, the origins of pages, and what bounds their connections.

use std::{net::SocketAddr, time::Duration};

use grasp_proto::v1;
use grasp_server::WebOrigins;
use grasp_tests::TestServer;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    time::Instant,
};
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::{
    browser::{Answer, answer, call, framed, get, preflight},
    fixtures::{
        blamed_fields, bounded, box_request, floating_remote, impossible, impossible_at_once, reason,
        seconds, until,
    },
    parts::{budget_of, reproducible, with},
};

const FIND: &str = "GraspService/FindGrasp";
const OWN_PAGE: (&str, &str) = ("origin", "http://localhost:5173");

/// Calls `FindGrasp` from a page.
async fn find(server: &TestServer, headers: &[(&str, &str)], request: &v1::FindGraspRequest) -> Answer {
    bounded(
        "an answer",
        call(server.address(), FIND, headers, framed(request)),
    )
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_is_answered_as_other_clients_are() {
    let server = TestServer::start().await;
    let request = reproducible(floating_remote());
    let answer = find(&server, &[OWN_PAGE], &request).await;
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("content-type"), Some("application/grpc-web+proto"));
    assert_eq!(
        answer.header("access-control-allow-origin"),
        Some("http://localhost:5173")
    );
    let exposed = answer.header("access-control-expose-headers").unwrap();
    for header in ["grpc-status", "grpc-message", "grpc-status-details-bin"] {
        assert!(exposed.contains(header), "{exposed}");
    }
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!(status.code(), Code::Ok);
    let other = server
        .grasps()
        .await
        .find_grasp(request)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(messages.len(), 1);
    assert_eq!(messages[0].grasps, other.grasps);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn base64_is_understood_and_answered() {
    let server = TestServer::start().await;
    let text = base64(&framed(&floating_remote()));
    let headers = [
        ("content-type", "application/grpc-web-text"),
        ("accept", "application/grpc-web-text"),
    ];
    let answer = call(server.address(), FIND, &headers, text.into_bytes()).await;
    assert_eq!(
        answer.header("content-type"),
        Some("application/grpc-web-text+proto")
    );
    let answer = Answer {
        body: unbase64(&answer.body),
        ..answer
    };
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!((messages.len(), status.code()), (1, Code::Ok));
    assert!(messages[0].grasp().is_some());
    // What is no base64 is the page's fault.
    let answer = call(server.address(), FIND, &headers, b"????".to_vec()).await;
    let (_, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::InvalidArgument, "MALFORMED_MESSAGE".to_owned())
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_reach_pages_with_their_details() {
    let server = TestServer::start().await;
    let wrong = with(floating_remote(), |request| {
        request.requirements_mut().friction = Some(-1.0);
        request.search_mut().budget = Some(seconds(-1));
    });
    let answer = find(&server, &[OWN_PAGE], &wrong).await;
    assert_eq!(answer.status, 200);
    assert!(answer.header("access-control-allow-origin").is_some());
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert!(messages.is_empty());
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(blamed_fields(&status), ["requirements.friction", "search.budget"]);
    // A method that there is none of.
    let answer = call(
        server.address(),
        "GraspService/Nothing",
        &[OWN_PAGE],
        framed(&wrong),
    )
    .await;
    assert_eq!(
        answer.messages::<v1::FindGraspResponse>().1.code(),
        Code::Unimplemented
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_pages_of_the_own_machine_may_call_unless_others_are_listed() {
    let server = TestServer::start().await;
    let allowed = preflight(server.address(), "http://127.0.0.1:8080").await;
    assert_eq!(allowed.status, 200);
    assert_eq!(
        allowed.header("access-control-allow-origin"),
        Some("http://127.0.0.1:8080")
    );
    assert_eq!(allowed.header("access-control-allow-methods"), Some("POST"));
    let headers = allowed.header("access-control-allow-headers").unwrap();
    for header in ["content-type", "grpc-timeout", "x-grpc-web", "x-user-agent"] {
        assert!(headers.contains(header), "{headers}");
    }
    let foreign = "https://game.example";
    let refused = preflight(server.address(), foreign).await;
    assert_eq!(
        (refused.status, refused.header("access-control-allow-origin")),
        (403, None)
    );
    // Nor does a call do anything, whatever the browser makes of the preflight request.
    let create = framed(&box_request("planted"));
    let method = "ObjectService/CreateObject";
    let refused = call(server.address(), method, &[("origin", foreign)], create).await;
    assert_eq!(refused.status, 403);
    let get = v1::GetObjectRequest {
        name: "objects/planted".to_owned(),
    };
    let status = server.objects().await.get_object(get).await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    server.stop().await;

    let listed = WebOrigins::Some {
        loopback: false,
        others: vec![foreign.to_owned()],
    };
    let server = TestServer::start_with(|config| config.web_origins = listed).await;
    assert_eq!(
        find(&server, &[("origin", foreign)], &floating_remote())
            .await
            .status,
        200
    );
    assert_eq!(preflight(server.address(), "http://localhost").await.status, 403);
    server.stop().await;

    let server = TestServer::start_with(|config| config.web_origins = WebOrigins::Any).await;
    let answer = find(&server, &[("origin", "null")], &floating_remote()).await;
    assert_eq!(answer.header("access-control-allow-origin"), Some("null"));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_origins_only_grpc_is_served() {
    let server = TestServer::start_with(|config| config.web_origins = WebOrigins::NONE).await;
    let answer = find(&server, &[], &floating_remote()).await;
    assert_eq!(answer.status, 403);
    assert!(text(&answer).contains("web_origins is none"), "{}", text(&answer));
    server
        .grasps()
        .await
        .find_grasp(floating_remote())
        .await
        .expect("gRPC is served");
    server.stop().await;
}

/// The text of a refusal.
fn text(answer: &Answer) -> &str {
    std::str::from_utf8(&answer.body).expect("it is text")
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_grpc_web_is_refused_over_http_1_with_the_cause() {
    let server = TestServer::start().await;
    for (content_type, status, cause) in [
        ("application/json", 415, "Connect"),
        ("application/connect+json", 415, "Connect"),
        ("application/grpc", 400, "HTTP/2"),
        ("application/grpc-web+json", 415, "application/grpc-web+proto"),
        ("text/plain", 415, "application/grpc-web+proto"),
    ] {
        let headers = [OWN_PAGE, ("content-type", content_type)];
        let answer = call(server.address(), FIND, &headers, framed(&floating_remote())).await;
        assert_eq!(answer.status, status, "{content_type}");
        assert!(text(&answer).contains(cause), "{}", text(&answer));
        // The page can read it.
        assert_eq!(answer.header("access-control-allow-origin"), Some(OWN_PAGE.1));
    }
    for path in [
        "/",
        "/grasp.v1.GraspService/FindGrasp?connect=v1&encoding=json&message=%7B%7D",
    ] {
        let answer = get(server.address(), path).await;
        assert_eq!((answer.status, answer.header("allow")), (405, Some("POST")));
        assert!(text(&answer).contains("gRPC"), "{}", text(&answer));
    }
    // A type with a parameter is that type.
    let headers = [("content-type", "application/grpc-web+proto; charset=utf-8")];
    let answer = find(&server, &headers, &floating_remote()).await;
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!((messages.len(), status.code()), (1, Code::Ok));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_deadline_of_a_page_bounds_its_search() {
    let server = TestServer::start().await;
    let request = impossible_at_once(&server)
        .await
        .with_budget(Duration::from_secs(10));
    let answer = find(&server, &[("grpc-timeout", "400m")], &request).await;
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!(status.code(), Code::Ok, "{status:?}");
    let budget = budget_of(&messages[0]);
    let range = Duration::from_millis(100)..Duration::from_millis(400);
    assert!(range.contains(&budget), "{budget:?}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_leaves_stops_its_search() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_secs(10));
    let address = server.address();
    let body = framed(&request);
    let calling = tokio::spawn(async move { call(address, FIND, &[], body).await });
    until("the search", || server.gauges().searches() == 1).await;
    calling.abort();
    until("the end of the search", || server.gauges().searches() == 0).await;
    until("the end of the call", || server.gauges().calls() == 0).await;
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn too_large_messages_of_pages_are_refused() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest::new("n".repeat(200 << 10));
    let (_, status) = find(&server, &[OWN_PAGE], &request)
        .await
        .messages::<v1::FindGraspResponse>();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::OutOfRange, "MESSAGE_TOO_LARGE".to_owned())
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn shedding_reaches_pages_as_a_status() {
    let server = TestServer::start_with(|config| config.maximum_searches = 1.try_into().unwrap()).await;
    let request = impossible(&server).await.with_budget(Duration::from_secs(10));
    let (address, body) = (server.address(), framed(&request));
    let first = tokio::spawn({
        let body = body.clone();
        async move { call(address, FIND, &[], body).await }
    });
    until("the first search", || server.gauges().searches() == 1).await;
    let (_, status) = call(address, FIND, &[OWN_PAGE], body)
        .await
        .messages::<v1::FindGraspResponse>();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_SEARCHES".to_owned())
    );
    assert!(status.get_error_details().retry_info().is_some());
    first.abort();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_streams_grasps() {
    let server = TestServer::start().await;
    let request = v1::StreamGraspsRequest::from(floating_remote()).with_budget(Duration::from_millis(300));
    let method = "GraspService/StreamGrasps";
    let answer = bounded(
        "the stream",
        call(server.address(), method, &[OWN_PAGE], framed(&request)),
    )
    .await;
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!(status.code(), Code::Ok);
    let (last, grasps) = messages.split_last().unwrap();
    assert_eq!(last.outcome(), v1::Outcome::Found);
    assert!(!grasps.is_empty());
    for message in grasps {
        assert_eq!(message.outcome(), v1::Outcome::Unspecified);
        assert!(message.grasp().is_some());
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn running_calls_of_pages_end_before_the_server_does() {
    let server = TestServer::start().await;
    let request = impossible(&server).await.with_budget(Duration::from_millis(600));
    let (address, body) = (server.address(), framed(&request));
    let calling = tokio::spawn(async move { call(address, FIND, &[], body).await });
    until("the search", || server.gauges().searches() == 1).await;
    // A connection without a call does not keep the server.
    let idle = TcpStream::connect(address).await.unwrap();
    let stopping = server.begin_stop();
    let answer = bounded("the answer", calling).await.unwrap();
    assert_eq!(answer.messages::<v1::FindGraspResponse>().1.code(), Code::Ok);
    bounded("the end", stopping.stopped()).await;
    drop(idle);
}

/// Headers of so many bytes.
async fn send_headers(address: SocketAddr, bytes: usize) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let start = format!("POST /grasp.v1.{FIND} HTTP/1.1\r\nhost: x\r\nx: ");
    let _ = stream.write_all(start.as_bytes()).await;
    let _ = stream.write_all(&vec![b'y'; bytes]).await;
    stream
}

#[tokio::test(flavor = "multi_thread")]
async fn too_large_headers_close_the_connection() {
    let server = TestServer::start().await;
    let mut small = send_headers(server.address(), 8 << 10).await;
    small
        .write_all(b"\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")
        .await
        .unwrap();
    assert_eq!(bounded("an answer", answer(&mut small)).await.status, 415);
    let mut large = send_headers(server.address(), 64 << 10).await;
    let mut read = Vec::new();
    // Closed, with or without a reset, but not answered.
    let _ = bounded("the end", large.read_to_end(&mut read)).await;
    assert!(read.is_empty(), "{}", String::from_utf8_lossy(&read));
    server.stop().await;
}

/// Waits until the server closes a connection.
async fn closed(mut stream: TcpStream) -> Duration {
    let start = Instant::now();
    let _ = bounded("the end of the connection", stream.read_to_end(&mut Vec::new())).await;
    start.elapsed()
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_headers_and_idle_connections_are_closed() {
    let server = TestServer::start().await;
    // Headers of which a byte comes every second.
    let (mut reader, mut writer) = send_headers(server.address(), 100).await.into_split();
    let dripping = tokio::spawn(async move {
        while writer.write_all(b"y").await.is_ok() {
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
    });
    let silent = TcpStream::connect(server.address()).await.unwrap();
    // Kept alive after an answer.
    let mut idle = TcpStream::connect(server.address()).await.unwrap();
    idle.write_all(b"GET / HTTP/1.1\r\nhost: x\r\n\r\n")
        .await
        .unwrap();
    idle.read_exact(&mut [0; 12]).await.unwrap();
    let slow = async {
        let start = Instant::now();
        let _ = bounded("the end of slow headers", reader.read_to_end(&mut Vec::new())).await;
        start.elapsed()
    };
    let (slow, silent, idle) = tokio::join!(slow, closed(silent), closed(idle));
    // Hyper's limit is 30 s; the server's own for the first bytes 10 s.
    assert!(silent < Duration::from_secs(15), "{silent:?}");
    for took in [slow, idle] {
        assert!(took < Duration::from_secs(40), "{took:?}");
    }
    dripping.abort();
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_serves_many_calls() {
    let server = TestServer::start().await;
    let mut stream = TcpStream::connect(server.address()).await.unwrap();
    let body = framed(&v1::ListObjectsRequest::default());
    // Together, their headers are larger than those of one may be.
    for call in 0..60 {
        let start = format!(
            "POST /grasp.v1.ObjectService/ListObjects HTTP/1.1\r\nhost: x\r\ncontent-length: {}\r\ncontent-type: \
             application/grpc-web\r\nx: {}\r\n\r\n",
            body.len(),
            "y".repeat(1000)
        );
        stream
            .write_all(&[start.as_bytes(), &body].concat())
            .await
            .unwrap();
        let mut read = Vec::new();
        // The last chunk of an answer.
        while !read.ends_with(b"\r\n0\r\n\r\n") {
            let more = bounded("an answer", stream.read_buf(&mut read)).await.unwrap();
            assert!(more > 0, "call {call} was not answered");
        }
        assert!(read.starts_with(b"HTTP/1.1 200"));
    }
    server.stop().await;
}

const BASE64: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// RFC 4648, 4.
fn base64(bytes: &[u8]) -> String {
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let mut word = [0; 4];
        word[1..=chunk.len()].copy_from_slice(chunk);
        let word = u32::from_be_bytes(word);
        for place in 0..4 {
            if place <= chunk.len() {
                text.push(char::from(BASE64[(word >> (18 - 6 * place) & 63) as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

/// Decodes texts with padding, one after the other.
fn unbase64(text: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for chunk in text.chunks(4) {
        let end = chunk.iter().position(|&letter| letter == b'=').unwrap_or(4);
        let word = chunk.iter().fold(0_u32, |word, letter| {
            let value = BASE64.iter().position(|known| known == letter).unwrap_or(0);
            word << 6 | value as u32
        });
        bytes.extend(&word.to_be_bytes()[1..end]);
    }
    bytes
}
