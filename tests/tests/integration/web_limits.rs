//! What pages see of limits that other clients learn from the transport: they read a status only in gRPC-Web's framing, and if the
//! headers say that they may.

use bytes::Bytes;
use grasp_proto::v1;
use grasp_tests::TestServer;
use h2::{
    SendStream,
    client::{ResponseFuture, SendRequest},
};
use http::Request;
use tokio::{net::TcpStream, task::JoinHandle};
use tonic::Code;
use tonic_types::StatusExt as _;

use crate::{
    browser::{Answer, call, framed},
    fixtures::{bounded, floating_remote, reason, until},
};

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
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_CALLS".to_owned())
    );
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
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deadline_that_passes_is_answered_readably() {
    let server = TestServer::start().await;
    let mut browser = Browser::connect(&server).await;
    // The message never comes, so that no handler answers.
    let (late, _message) = browser.start(&server, &[("grpc-timeout", "200m")]).await;
    let status = readable_status(&answer(late).await);
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::DeadlineExceeded, "DEADLINE_EXCEEDED".to_owned())
    );
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
    server.stop().await;
}
