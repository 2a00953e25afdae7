//! Clients that do not read their answers, or do not end their requests.

use std::time::Duration;

use bytes::Bytes;
use grasp_proto::v1::{self, stream_grasps_request::Sent};
use grasp_tests::TestServer;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpSocket,
};
use tonic_reflection::pb::v1::{ServerReflectionRequest, server_reflection_request::MessageRequest};

use crate::{
    fixtures::{bounded, held_remote, until},
    wire::{Connection, OpenCall, framed},
};

/// A method with a large answer.
const REFLECTION: &str = "grpc.reflection.v1.ServerReflection/ServerReflectionInfo";

/// Calls per connection: as many as the server lets run at a time.
const CALLS: usize = 64;

/// An answer has more bytes than this.
const MIN_ANSWER_BYTES: usize = 2_500;

/// The smallest allowed bound on unread answers, in bytes.
const LEAST: usize = 4 << 20;

/// A client with open calls whose answers it never lets the server send.
struct Unreading {
    _calls: Vec<OpenCall>,
    connection: Connection,
}

impl Unreading {
    /// Requests a description of the contract, one of the largest answers of a server without many objects.
    async fn start(server: &TestServer) -> Self {
        let mut connection = Connection::open(server, 0).await;
        let mut calls = Vec::new();
        for _ in 0..CALLS {
            let Some(mut call) = connection.call(REFLECTION, &[]).await else {
                break;
            };
            // The connection may have been closed meanwhile.
            let _ = call.1.send_data(frame(), true);
            calls.push(call);
        }
        Self {
            _calls: calls,
            connection,
        }
    }

    fn is_closed(&self) -> bool {
        self.connection.task.is_finished()
    }
}

/// The request as gRPC frames it.
fn frame() -> Bytes {
    let request = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::FileContainingSymbol(
            "grasp.v1.GraspService".to_owned(),
        )),
    };
    Bytes::from(framed(&request))
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_that_do_not_read_are_bounded_in_all_and_closed() {
    let server =
        TestServer::start_with(|config| config.maximum_unread_bytes = LEAST.try_into().unwrap()).await;
    let first = Unreading::start(&server).await;
    until("the first answers to wait", || server.gauges().unread_bytes() > 0).await;
    let each = server.gauges().unread_bytes();
    let mut others = Vec::new();
    while !first.is_closed() && !others.iter().any(Unreading::is_closed) {
        assert!(
            others.len() < 2 * LEAST * CALLS / each,
            "no connection was closed"
        );
        others.push(bounded("a connection", Unreading::start(&server)).await);
        let unread = server.gauges().unread_bytes();
        // What waits on connections that are being closed is freed a moment later.
        assert!(unread <= 2 * LEAST, "{unread} bytes wait");
    }
    until("what was beyond the bound to be freed", || {
        server.gauges().unread_bytes() <= LEAST
    })
    .await;
    // Others are served.
    let mut objects = server.objects().await;
    let listed = objects.list_objects(v1::ListObjectsRequest::default());
    assert!(
        !bounded("a list", listed)
            .await
            .unwrap()
            .into_inner()
            .objects
            .is_empty()
    );
    drop((first, others));
    until("all to be freed", || server.gauges().unread_bytes() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_that_clients_do_not_end_are_bounded_in_all_and_closed() {
    /// Bytes of each request, of a message that would have some more.
    const SENT: usize = 150 << 10;
    let server =
        TestServer::start_with(|config| config.maximum_unread_bytes = LEAST.try_into().unwrap()).await;
    let mut begun = Vec::new();
    let mut connections: Vec<Connection> = Vec::new();
    while !connections.iter().any(|connection| connection.task.is_finished()) {
        assert!(connections.len() < 10, "no connection was closed");
        let mut connection = Connection::open(&server, 1 << 16).await;
        for _ in 0..10 {
            let Some((answer, mut body)) = connection.call("grasp.v1.GraspService/FindGrasp", &[]).await
            else {
                break;
            };
            let mut part = vec![0; SENT];
            part[..5].copy_from_slice(&[0, 0, 2, 0x70, 0]);
            let _ = body.send_data(Bytes::from(part), false);
            begun.push((answer, body));
        }
        connections.push(connection);
        // What is sent arrives meanwhile.
        tokio::time::sleep(Duration::from_millis(50)).await;
        let bytes = server.gauges().unread_bytes();
        assert!(bytes <= 2 * LEAST, "{bytes} bytes have arrived");
    }
    let mut objects = server.objects().await;
    let listed = objects.list_objects(v1::ListObjectsRequest::default());
    bounded("a list", listed).await.unwrap();
    drop(begun);
    until("all to be freed", || server.gauges().unread_bytes() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_that_do_not_read_are_closed() {
    let server = TestServer::start().await;
    let socket = TcpSocket::new_v6().unwrap();
    socket.set_recv_buffer_size(4 << 10).unwrap();
    let mut page = socket.connect(server.address()).await.unwrap();
    let body = frame();
    let request = format!(
        "POST /{REFLECTION} HTTP/1.1\r\nhost: x\r\ncontent-type: application/grpc-web\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    let call = [request.as_bytes(), &body].concat();
    // It asks until the sockets between it and the server are full in both directions, takes nothing, and is closed for that.
    let asking = tokio::spawn(async move {
        let mut calls = 0;
        while page.write_all(&call).await.is_ok() {
            calls += 1;
        }
        (page, calls)
    });
    let (mut page, calls) = bounded("the connection to be closed", asking).await.unwrap();
    until("nothing to wait", || server.gauges().unread_bytes() == 0).await;
    let mut read = vec![0; 1 << 20];
    let mut received = 0;
    while let Ok(more @ 1..) = bounded("the rest", page.read(&mut read)).await {
        received += more;
    }
    assert!(
        received < calls * MIN_ANSWER_BYTES,
        "all {calls} answers were sent: {received} bytes"
    );
    until("the end of its call", || server.gauges().calls() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_stops_reading_a_stream_of_grasps_ends_its_search() {
    let server = TestServer::start_with(|config| {
        config.budgets.maximum = Duration::from_mins(5);
        config.workers = 1.try_into().unwrap();
    })
    .await;
    let mut connection = Connection::open(&server, 0).await;
    let call = connection.call("grasp.v1.GraspService/StreamGrasps", &[]).await;
    let (answer, mut body) = call.expect("the connection is open");
    let request = v1::StreamGraspsRequest {
        sent: Some(Sent::MaxRateHz(1000.0)),
        ..held_remote().with_budget(Duration::from_mins(5)).into()
    };
    body.send_data(Bytes::from(framed(&request)), true).unwrap();
    let _answer = bounded("headers", answer).await.unwrap();
    until("the search", || server.gauges().searches() == 1).await;
    // Well before the budget ends.
    until("the end of the search", || server.gauges().searches() == 0).await;
    until("the end of the call", || server.gauges().calls() == 0).await;
}
