//! Pages in browsers: gRPC-Web over HTTP/1.1 and HTTP/2, the origins of pages, and what bounds their connections. Of limits that other
//! clients learn from the transport, pages read a status only in gRPC-Web's framing, and if the headers say that they may.

use std::{net::SocketAddr, time::Duration};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use bytes::Bytes;
use grasp_proto::v1;
use grasp_tests::TestServer;
use h2::{
    SendStream,
    client::{ResponseFuture, SendRequest},
};
use http::Request;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    task::JoinHandle,
    time::Instant,
};
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::{
    browser::{Answer, call, framed, get, preflight},
    fixtures::{
        assert_status, blamed_fields, bounded, box_request, find, floating_remote, impossible, reproducible,
        seconds, until, with,
    },
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
    // What is no base64 is the page's fault.
    let answer = call(server.address(), FIND, &headers, b"????".to_vec()).await;
    let (_, status) = answer.messages::<v1::FindGraspResponse>();
    assert_status(&status, Code::InvalidArgument, "MALFORMED_MESSAGE");
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_reach_pages_with_their_details() {
    let server = TestServer::start().await;
    let wrong = with(floating_remote(), |request| {
        request.requirements_mut().friction = Some(-1.0);
        request.search_mut().budget = Some(seconds(-1));
    });
    let answer = from_page(&server, &[OWN_PAGE], &wrong).await;
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
}

#[tokio::test(flavor = "multi_thread")]
async fn too_large_messages_of_pages_are_refused() {
    let server = TestServer::start().await;
    let request = v1::FindGraspRequest::new("n".repeat(200 << 10));
    let (_, status) = from_page(&server, &[OWN_PAGE], &request)
        .await
        .messages::<v1::FindGraspResponse>();
    assert_status(&status, Code::OutOfRange, "MESSAGE_TOO_LARGE");
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
const ORIGIN: &str = "http://localhost:5173";

/// A browser's HTTP/2 connection.
struct Browser {
    sender: SendRequest<Bytes>,
    connection: JoinHandle<Result<(), h2::Error>>,
}

impl Browser {
    async fn connect(server: &TestServer) -> Self {
        let stream = TcpStream::connect(server.address()).await.unwrap();
        let (sender, connection) = h2::client::handshake(stream).await.unwrap();
        Self {
            sender,
            connection: tokio::spawn(connection),
        }
    }

    /// Starts a page's call whose message is yet to come.
    async fn start(
        &mut self,
        server: &TestServer,
        headers: &[(&str, &str)],
    ) -> (ResponseFuture, SendStream<Bytes>) {
        let uri = format!("{}/grasp.v1.GraspService/FindGrasp", server.endpoint());
        let mut request = Request::post(uri)
            .header("content-type", "application/grpc-web+proto")
            .header("origin", ORIGIN);
        for &(name, value) in headers {
            request = request.header(name, value);
        }
        self.sender = self.sender.clone().ready().await.unwrap();
        self.sender
            .send_request(request.body(()).unwrap(), false)
            .unwrap()
    }
}

/// The whole answer to a call.
async fn answer(call: ResponseFuture) -> Answer {
    let (head, mut stream) = bounded("headers", call).await.unwrap().into_parts();
    let mut body = Vec::new();
    while let Some(chunk) = bounded("the body", stream.data()).await {
        let chunk = chunk.unwrap();
        stream.flow_control().release_capacity(chunk.len()).unwrap();
        body.extend(&chunk);
    }
    let headers = head.headers.iter().map(|(name, value)| {
        let value = value.to_str().expect("headers are text");
        (name.as_str().to_owned(), value.to_owned())
    });
    Answer {
        status: head.status.as_u16(),
        headers: headers.collect(),
        body,
    }
}

/// The status of an answer that the page's script may read.
fn readable_status(answer: &Answer) -> tonic::Status {
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("access-control-allow-origin"), Some(ORIGIN));
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
    let server = TestServer::start().await;
    let mut browser = Browser::connect(&server).await;
    let mut running = Vec::new();
    for _ in 0..CALLS {
        running.push(browser.start(&server, &[]).await);
    }
    until("as many calls as there may be", || {
        server.gauges().calls() == CALLS
    })
    .await;
    let (further, _message) = browser.start(&server, &[]).await;
    let status = readable_status(&answer(further).await);
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_CALLS");
    assert!(status.get_error_details().retry_info().is_some());
    // Other connections have places of their own.
    let other = v1::ListObjectsRequest::default();
    server.objects().await.list_objects(other).await.unwrap();
    // A call that is answered makes room for another one.
    let (first, mut message) = running.swap_remove(0);
    message
        .send_data(Bytes::from(framed(&floating_remote())), true)
        .unwrap();
    let (messages, status) = answer(first).await.messages::<v1::FindGraspResponse>();
    assert_eq!((messages.len(), status.code()), (1, Code::Ok));
    let (next, mut message) = browser.start(&server, &[]).await;
    message
        .send_data(Bytes::from(framed(&floating_remote())), true)
        .unwrap();
    let (messages, status) = answer(next).await.messages::<v1::FindGraspResponse>();
    assert_eq!((messages.len(), status.code()), (1, Code::Ok));
    drop(running);
    until("the end of all calls", || server.gauges().calls() == 0).await;
    browser.connection.abort();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deadline_that_passes_is_answered_readably() {
    let server = TestServer::start().await;
    let mut browser = Browser::connect(&server).await;
    // The message never comes, so that no handler answers.
    let (late, _message) = browser.start(&server, &[("grpc-timeout", "200m")]).await;
    let status = readable_status(&answer(late).await);
    assert_status(&status, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
    browser.connection.abort();
    // Deadlines that have passed on arrival, over HTTP/1.1.
    for timeout in ["0m", "1n"] {
        let headers = [("origin", ORIGIN), ("grpc-timeout", timeout)];
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
