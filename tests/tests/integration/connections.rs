//! Who may have a connection, and how connections end: without a preface, without calls, and when they are old.

use std::{
    net::{IpAddr, Ipv4Addr},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_server::Config;
use grasp_tests::{
    TestServer,
    attacks::{PREFACE, connect},
};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};

use crate::{
    fixtures::{bounded, until},
    wire::{Connection, answer_to, framed},
};

const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

/// Another client: another address of this machine.
const ELSEWHERE: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

const LIST: &str = "grasp.v1.ObjectService/ListObjects";

async fn serve(adapt: impl FnOnce(&mut Config)) -> TestServer {
    TestServer::start_on(HERE, adapt).await
}

async fn list(server: &TestServer) {
    let mut objects = bounded("a connection", server.objects()).await;
    let listed = objects.list_objects(v1::ListObjectsRequest::default());
    bounded("a list", listed).await.expect("it is answered");
}

/// The time until the server closes a connection.
async fn until_closed(stream: &mut TcpStream) -> Duration {
    let start = Instant::now();
    let mut rest = Vec::new();
    // An error is an end, too.
    let _ = bounded("the end of a connection", stream.read_to_end(&mut rest)).await;
    start.elapsed()
}

#[tokio::test(flavor = "multi_thread")]
async fn half_open_connections_lock_nobody_out() {
    let server = serve(|config| config.maximum_connections = 8.try_into().unwrap()).await;
    let mut half_open = Vec::new();
    for sent in [&b""[..], &PREFACE[..10], PREFACE].into_iter().cycle().take(60) {
        let mut stream = connect(ELSEWHERE, server.address()).await;
        // It may be closed already.
        let _ = stream.write_all(sent).await;
        half_open.push(stream);
    }
    let start = Instant::now();
    list(&server).await;
    println!(
        "a new client's call beside 60 half-open connections took {:?}",
        start.elapsed()
    );
    assert!(server.gauges().connections() <= 8);
    // The same client's next call takes the place of one of them.
    let mut stream = connect(ELSEWHERE, server.address()).await;
    let request =
        b"POST /grasp.v1.ObjectService/ListObjects HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\n\
        content-length: 2\r\nconnection: close\r\n\r\n{}";
    stream.write_all(request).await.unwrap();
    let mut answer = Vec::new();
    bounded("an answer", stream.read_to_end(&mut answer))
        .await
        .unwrap();
    assert!(answer.starts_with(b"HTTP/1.1 200"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_that_does_not_complete_its_preface_is_closed_in_5_s() {
    let server = serve(|_| {}).await;
    for sent in [&b""[..], &PREFACE[..10], b"POST /"] {
        let mut stream = connect(HERE, server.address()).await;
        stream.write_all(sent).await.unwrap();
        let closed = until_closed(&mut stream).await;
        println!("closed after {closed:?}");
        assert!(closed > Duration::from_secs(4), "{closed:?}");
    }
    until("the places to be free", || server.gauges().connections() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_without_calls_ends_gracefully_and_its_client_goes_on() {
    let idle = Duration::from_millis(400);
    let server = serve(|config| config.connection_idle = idle).await;
    let mut objects = server.objects().await;
    let mut connection = Connection::open(&server, 1 << 20).await;
    let mut page = connect(HERE, server.address()).await;
    let request = b"GET / HTTP/1.1\r\nhost: x\r\n\r\n";
    page.write_all(request).await.unwrap();
    // A stream of changes is a call, however rarely it has one.
    let watch = objects.watch_objects(v1::WatchObjectsRequest::default());
    let mut watch = bounded("a watch", watch).await.unwrap().into_inner();
    let (answer, mut body) = connection.call(LIST, &[]).await.unwrap();
    body.send_data(framed(&v1::ListObjectsRequest::default()).into(), true)
        .unwrap();
    answer_to(answer).await;
    let ended = bounded("the end of the connection", connection.task)
        .await
        .unwrap();
    ended.expect("GOAWAY without an error");
    until_closed(&mut page).await;
    until("only the watch's connection to be left", || {
        server.gauges().connections() == 1
    })
    .await;
    let mut others = server.objects().await;
    for _ in 0..3 {
        let listed = others.list_objects(v1::ListObjectsRequest::default());
        bounded("a list", listed).await.expect("it connects again");
        tokio::time::sleep(2 * idle).await;
    }
    let waiting = tokio::time::timeout(Duration::from_millis(10), watch.message()).await;
    assert!(waiting.is_err(), "the watch goes on: {waiting:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_old_connection_ends_its_calls_and_no_call_fails_for_it() {
    let server = serve(|config| config.connection_age = Duration::from_millis(200)).await;
    let mut watching = server.objects().await;
    let watch = watching.watch_objects(v1::WatchObjectsRequest::default());
    let mut watch = bounded("a watch", watch).await.unwrap().into_inner();
    let client = server.client().await;
    let (start, mut calls) = (Instant::now(), 0);
    while start.elapsed() < Duration::from_secs(2) {
        bounded("an object", client.get_object("objects/remote"))
            .await
            .expect("no call fails");
        calls += 1;
    }
    println!("{calls} calls on some ten connections that grew old, none failed");
    let waiting = tokio::time::timeout(Duration::from_millis(10), watch.message()).await;
    assert!(waiting.is_err(), "the watch goes on: {waiting:?}");
}
