//! Concurrent calls up to the limits and beyond, and clients that do not read their answers or do not end their requests. Every method
//! that searches stops its work when its call is dropped, keeps deadlines, and sheds on a full server.

use std::{
    net::Ipv4Addr,
    time::{Duration, Instant},
};

use bytes::Bytes;
use grasp_proto::{
    v1::{
        self, grasp_service_client::GraspServiceClient, object_service_client::ObjectServiceClient,
        stream_grasps_request::Sent,
    },
    wire_duration,
};
use grasp_tests::TestServer;
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpSocket,
};
use tonic::{Code, Request, Status, transport::Channel};
use tonic_reflection::pb::v1::{ServerReflectionRequest, server_reflection_request::MessageRequest};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{
        assert_status, bounded, find, floating_remote, held_remote, impossible, impossible_at_once, until,
    },
    wire::{Connection, OpenCall, framed},
};

/// The budget of searches near a hand in requests without one.
const SHORT: Duration = Duration::from_millis(50);

/// A method that searches.
#[derive(Clone, Copy, Debug)]
enum Method {
    Find,
    Stream,
    Validate,
    Evaluate,
}

impl Method {
    const ALL: [Self; 4] = [Self::Find, Self::Stream, Self::Validate, Self::Evaluate];

    /// Calls it for a holdout; validations also search for a grasp near one that is not valid.
    async fn call(
        self,
        mut grasps: GraspServiceClient<Channel>,
        holdout: v1::FindGraspRequest,
        timeout: Option<Duration>,
    ) -> Result<(), Status> {
        fn with<T>(message: T, timeout: Option<Duration>) -> Request<T> {
            let mut request = Request::new(message);
            if let Some(timeout) = timeout {
                request.set_timeout(timeout);
            }
            request
        }
        match self {
            Self::Find => grasps.find_grasp(with(holdout, timeout)).await.map(drop),
            Self::Stream => {
                let call = grasps.stream_grasps(with(holdout.into(), timeout));
                let mut messages = call.await?.into_inner();
                while messages.message().await?.is_some() {}
                Ok(())
            }
            Self::Validate => grasps
                .validate_grasp(with(validation(holdout), timeout))
                .await
                .map(drop),
            Self::Evaluate => grasps
                .evaluate_holdout(with(holdout.into(), timeout))
                .await
                .map(drop),
        }
    }

    /// Its call in a task.
    async fn spawn(
        self,
        server: &TestServer,
        holdout: v1::FindGraspRequest,
    ) -> tokio::task::JoinHandle<Result<(), Status>> {
        tokio::spawn(self.call(server.grasps().await, holdout, None))
    }
}

/// A request to check an open hand where the object is.
fn validation(holdout: v1::FindGraspRequest) -> v1::ValidateGraspRequest {
    let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Right)
        .with_object_from_wrist(v1::Pose::default())
        .with_digits([Some(v1::DigitAngles::default()); 5]);
    let nearest_budget = wire_duration(holdout.budget().unwrap_or(SHORT));
    v1::ValidateGraspRequest {
        nearest_budget: Some(nearest_budget),
        ..v1::ValidateGraspRequest::from(holdout).with_pose(hand)
    }
}

/// A request with a long budget for a holdout without a grasp.
async fn long(server: &TestServer) -> v1::FindGraspRequest {
    impossible(server).await.with_budget(Duration::from_secs(10))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_call_stops_the_work() {
    let server = TestServer::start().await;
    let holdout = long(&server).await;
    for method in Method::ALL {
        let call = method.spawn(&server, holdout.clone()).await;
        until("the work", || server.gauges().searches() == 1).await;
        let dropped = Instant::now();
        call.abort();
        until("the end of the work", || server.gauges().searches() == 0).await;
        until("the end of the call", || server.gauges().calls() == 0).await;
        // Its budget alone would end it after 10 s.
        let took = dropped.elapsed();
        assert!(took < Duration::from_secs(8), "{method:?}: {took:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_answer_comes_before_the_deadline() {
    // The work has a quarter of the deadline, and the answer the rest.
    let server =
        TestServer::start_with(|config| config.budgets.minimum_reserve = Duration::from_mins(1)).await;
    let holdout = impossible_at_once(&server)
        .await
        .with_budget(Duration::from_secs(10));
    for method in Method::ALL {
        let timeout = Some(Duration::from_secs(4));
        let call = Box::pin(method.call(server.grasps().await, holdout.clone(), timeout));
        let answer = bounded("the answer", call).await;
        if let Err(status) = answer {
            // On a machine too busy to end the work in time; a client that gave up would report `Cancelled`.
            assert_status(&status, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
        }
        until("the end of the work", || server.gauges().searches() == 0).await;
        until("the end of the call", || server.gauges().calls() == 0).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_beyond_the_limit_of_searches_are_shed() {
    let server = TestServer::start_with(|config| config.maximum_searches = 1.try_into().unwrap()).await;
    let holdout = long(&server).await;
    for method in Method::ALL {
        let running = method.spawn(&server, holdout.clone()).await;
        until("the work", || server.gauges().searches() == 1).await;
        for further in Method::ALL {
            let status = further
                .call(server.grasps().await, holdout.clone(), None)
                .await
                .unwrap_err();
            assert_status(&status, Code::ResourceExhausted, "TOO_MANY_SEARCHES");
            let details = status.get_error_details();
            assert!(details.retry_info().unwrap().retry_delay > Some(Duration::ZERO));
            assert!(status.metadata().contains_key("grpc-retry-pushback-ms"));
        }
        running.abort();
        until("the end of the work", || server.gauges().searches() == 0).await;
        let after = method.call(server.grasps().await, floating_remote(), None).await;
        after.expect("the place is free again");
    }
}

/// Opens streams until one is refused.
async fn fill<T>(open: impl AsyncFn() -> Result<T, Status>) -> Vec<T> {
    let mut opened = Vec::new();
    loop {
        match bounded("a stream", open()).await {
            Ok(stream) => opened.push(stream),
            Err(status) => {
                assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
                return opened;
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_greedy_client_leaves_places_and_time_to_others() {
    let server = TestServer::start_on(Ipv4Addr::LOCALHOST.into(), |config| {
        config.maximum_searches = 8.try_into().unwrap();
        config.streams.watchers = 8.try_into().unwrap();
    })
    .await;
    let hopeless = long(&server).await;
    let greedy = server.channel_from([127, 0, 0, 2].into()).await;
    let searches = fill(async || {
        let mut grasps = GraspServiceClient::new(greedy.clone());
        grasps
            .stream_grasps(v1::StreamGraspsRequest::from(hopeless.clone()))
            .await
    });
    let searches = searches.await;
    let watches = fill(async || {
        let mut objects = ObjectServiceClient::new(greedy.clone());
        objects.watch_objects(v1::WatchObjectsRequest::default()).await
    });
    let watches = watches.await;
    assert_eq!((searches.len(), watches.len()), (6, 6), "three quarters");
    let watching = server
        .objects()
        .await
        .watch_objects(v1::WatchObjectsRequest::default())
        .await;
    watching.expect("there is a place for another client");
    for _ in 0..5 {
        let answer = find(&server, floating_remote()).await;
        assert_eq!(answer.outcome(), v1::Outcome::Found);
    }
    // All six still search.
    assert_eq!(server.gauges().searches(), 6);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_search_does_not_block_others() {
    // Longer than a busy machine takes for the short one.
    let budget = Duration::from_mins(5);
    let server = TestServer::start_with(|config| config.budgets.maximum = budget).await;
    let hopeless = impossible(&server).await.with_budget(budget);
    let mut client = server.grasps().await;
    let long = tokio::spawn(async move { client.find_grasp(hopeless).await });
    until("the long search", || server.gauges().searches() == 1).await;
    let answer = find(&server, floating_remote()).await;
    assert_eq!(answer.outcome(), v1::Outcome::Found);
    assert!(
        !long.is_finished(),
        "the short search was answered only after the long one"
    );
    long.abort();
}

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
        // Bytes that wait on closing connections are freed a moment later.
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
    // A call that the server cut off is none that its client cancelled.
    let (_, metrics) = server.monitor("/metrics").await;
    let cut_off = "ServerReflectionInfo\",grpc_code=\"Unavailable\"";
    assert!(metrics.contains(cut_off), "{metrics}");
    drop((first, others));
    until("all to be freed", || server.gauges().unread_bytes() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_that_clients_do_not_end_are_bounded_in_all_and_closed() {
    /// Bytes sent of each request, which is larger.
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
        // The bytes sent arrive meanwhile.
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
    // The page sends calls and reads nothing until the sockets are full in both directions, and is closed for that.
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
