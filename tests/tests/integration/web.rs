//! Pages in browsers: gRPC-Web over HTTP/1.1 and HTTP/2, origins of pages, and limits of connections. Of limits that other
//! clients learn from the transport, pages read a status only in gRPC-Web's framing, and if the headers allow it.

use std::{net::SocketAddr, time::Duration};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use bytes::Bytes;
use grasp_proto::v1;
use grasp_tests::TestServer;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    time::Instant,
};
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{self, assert_status, bounded, box_request, find, floating_remote, reproducible, until},
    wire::{Answer, Connection, OpenCall, answer_to, call, framed, get, preflight},
};

const FIND: &str = "GraspService/FindGrasp";
const OWN_PAGE: (&str, &str) = ("origin", "http://localhost:5173");

/// Calls `FindGrasp` from a page.
async fn from_page(server: &TestServer, headers: &[(&str, &str)], request: &v1::FindGraspRequest) -> Answer {
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
    let answer = from_page(&server, &[OWN_PAGE], &request).await;
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
    let other = find(&server, request).await;
    assert_eq!(messages.len(), 1);
    assert_eq!(messages[0].grasps, other.grasps);
}

#[tokio::test(flavor = "multi_thread")]
async fn base64_is_understood_and_answered() {
    let server = TestServer::start().await;
    let text = STANDARD.encode(framed(&floating_remote()));
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
        body: unpadded(&answer.body),
        ..answer
    };
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert_eq!((messages.len(), status.code()), (1, Code::Ok));
    assert!(messages[0].grasp().is_some());
    // Invalid base64 is the page's fault.
    let answer = call(server.address(), FIND, &headers, b"????".to_vec()).await;
    let (_, status) = answer.messages::<v1::FindGraspResponse>();
    assert_status(&status, Code::InvalidArgument, "MALFORMED_MESSAGE");
}

#[tokio::test(flavor = "multi_thread")]
async fn only_pages_of_the_own_machine_may_call_by_default() {
    let server = TestServer::start().await;
    let allowed = preflight(server.address(), "http://127.0.0.1:8080").await;
    assert_eq!(allowed.status, 200);
    assert_eq!(
        allowed.header("access-control-allow-origin"),
        Some("http://127.0.0.1:8080")
    );
    assert_eq!(allowed.header("access-control-allow-methods"), Some("POST"));
    let headers = allowed.header("access-control-allow-headers").unwrap();
    for header in [
        "content-type",
        "grpc-timeout",
        "x-grpc-web",
        "x-user-agent",
        "connect-protocol-version",
        "connect-timeout-ms",
        "content-encoding",
    ] {
        assert!(headers.contains(header), "{headers}");
    }
    let private = "access-control-allow-private-network";
    assert_eq!(allowed.header(private), Some("true"));
    let foreign = "https://game.example";
    let refused = preflight(server.address(), foreign).await;
    assert_eq!(
        (
            refused.status,
            refused.header("access-control-allow-origin"),
            refused.header(private)
        ),
        (403, None, None)
    );
    // A call has no effect either, even if the browser ignores the refused preflight request.
    let create = framed(&box_request("planted"));
    let method = "ObjectService/CreateObject";
    let refused = call(server.address(), method, &[("origin", foreign)], create).await;
    assert_eq!(refused.status, 403);
    let status = fixtures::get(&server, "objects/planted").await.unwrap_err();
    assert_eq!(status.code(), Code::NotFound);
    server.stop().await;
}

/// The text of a refusal.
fn text(answer: &Answer) -> &str {
    std::str::from_utf8(&answer.body).expect("it is text")
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_of_other_protocols_are_refused_over_http_1_with_the_cause() {
    let server = TestServer::start().await;
    for (content_type, status, cause) in [
        ("application/grpc", 400, "HTTP/2"),
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
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refusal_over_http_2_lets_the_client_send_the_rest_of_a_short_request() {
    let server = TestServer::start().await;
    let mut connection = Connection::open(&server, 1 << 20).await;
    let headers = [
        ("content-type", "application/x-www-form-urlencoded"),
        ("content-length", "2"),
    ];
    let call = connection.call("grasp.v1.GraspService/FindGrasp", &headers).await;
    let (answer, mut stream) = call.expect("the connection is open");
    // Ample time to refuse what the headers show.
    tokio::time::sleep(Duration::from_millis(50)).await;
    let sent = stream.send_data(Bytes::from_static(b"{}"), true);
    sent.expect("the stream is not reset");
    assert_eq!(answer_to(answer).await.status, 415);
    connection.task.abort();
}

/// Sends headers of `bytes` bytes.
async fn send_headers(address: SocketAddr, bytes: usize) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let start = format!("POST /grasp.v1.{FIND} HTTP/1.1\r\nhost: x\r\nx: ");
    let _ = stream.write_all(start.as_bytes()).await;
    let _ = stream.write_all(&vec![b'y'; bytes]).await;
    stream
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
}

/// Decodes texts with padding, one after the other.
fn unpadded(text: &[u8]) -> Vec<u8> {
    let words = text
        .chunks(4)
        .map(|word| STANDARD.decode(word).expect("it is base64"));
    words.flatten().collect()
}

/// Largest number of concurrent calls per connection.
const CALLS: usize = 64;

/// Begins a page's call over HTTP/2 whose message is yet to come.
async fn begin(browser: &mut Connection, headers: &[(&str, &str)]) -> OpenCall {
    let own = [("content-type", "application/grpc-web+proto"), OWN_PAGE];
    let headers = [&own[..], headers].concat();
    let call = browser.call(&format!("grasp.v1.{FIND}"), &headers).await;
    call.expect("the connection is open")
}

/// Sends the message of a call that finds a grasp, and checks its answer.
async fn complete((answer, mut message): OpenCall) {
    let body = Bytes::from(framed(&floating_remote()));
    message.send_data(body, true).unwrap();
    let (messages, status) = answer_to(answer).await.messages::<v1::FindGraspResponse>();
    assert_eq!((messages.len(), status.code()), (1, Code::Ok));
}

/// The status of an answer that the page's script may read.
fn readable_status(answer: &Answer) -> tonic::Status {
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("access-control-allow-origin"), Some(OWN_PAGE.1));
    assert!(
        answer
            .header("access-control-expose-headers")
            .is_some_and(|exposed| exposed.contains("grpc-status"))
    );
    assert_eq!(answer.header("content-type"), Some("application/grpc-web+proto"));
    let (messages, status) = answer.messages::<v1::FindGraspResponse>();
    assert!(messages.is_empty());
    status
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_beyond_the_limit_of_a_connection_are_shed_readably() {
    let server = TestServer::start_with(|config| config.maximum_searches = 256.try_into().unwrap()).await;
    let mut browser = Connection::open(&server, 1 << 20).await;
    let mut running = Vec::new();
    for _ in 0..CALLS {
        running.push(begin(&mut browser, &[]).await);
    }
    until("as many calls as there may be", || {
        server.gauges().calls() == CALLS
    })
    .await;
    let (further, _message) = begin(&mut browser, &[]).await;
    let status = readable_status(&answer_to(further).await);
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_CALLS");
    assert!(status.get_error_details().retry_info().is_some());
    // Other connections have places of their own.
    let other = v1::ListObjectsRequest::default();
    server.objects().await.list_objects(other).await.unwrap();
    // A call that is answered makes room for another one.
    complete(running.swap_remove(0)).await;
    complete(begin(&mut browser, &[]).await).await;
    drop(running);
    until("the end of all calls", || server.gauges().calls() == 0).await;
    browser.task.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deadline_that_passes_is_answered_readably() {
    let server = TestServer::start().await;
    let mut browser = Connection::open(&server, 1 << 20).await;
    // The message never comes, so that no handler answers.
    let (late, _message) = begin(&mut browser, &[("grpc-timeout", "200m")]).await;
    let status = readable_status(&answer_to(late).await);
    assert_status(&status, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
    browser.task.abort();
    // Deadlines that have passed on arrival, over HTTP/1.1.
    for timeout in ["0m", "1n"] {
        let headers = [OWN_PAGE, ("grpc-timeout", timeout)];
        let calling = call(
            server.address(),
            "GraspService/FindGrasp",
            &headers,
            framed(&floating_remote()),
        );
        let status = readable_status(&bounded("an answer", calling).await);
        assert_eq!(status.code(), Code::DeadlineExceeded, "{timeout}");
    }
    until("the end of all calls", || server.gauges().calls() == 0).await;
}
