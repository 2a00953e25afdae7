//! Clients that attack the transport are closed, and others are served meanwhile.

use std::{
    net::{IpAddr, Ipv4Addr},
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_tests::{
    TestServer,
    attacks::{Fate, Flood, flood},
};
use tokio::task::JoinHandle;

use crate::fixtures::bounded;

const BYSTANDER: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
const ATTACKER: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

/// More than a client may send without an answer.
const ROUNDS: u32 = 1_000_000;

/// Longest flood: a busy machine takes less.
const LONGEST: Duration = Duration::from_secs(30);

async fn attack(server: &TestServer, kind: Flood) -> Fate {
    bounded(
        "the flood",
        flood(kind, ATTACKER, server.address(), ROUNDS, LONGEST),
    )
    .await
}

/// Calls one after the other until the attack is over; returns their times.
async fn beside(server: &TestServer, attack: &JoinHandle<Fate>) -> Vec<Duration> {
    let mut objects = server.objects().await;
    let mut times = Vec::new();
    while times.len() < 20 || !attack.is_finished() {
        let start = Instant::now();
        let listed = objects.list_objects(v1::ListObjectsRequest::default());
        bounded("a list", listed).await.expect("others are served");
        times.push(start.elapsed());
    }
    times.sort_unstable();
    times
}

#[tokio::test(flavor = "multi_thread")]
async fn floods_are_cut_off_and_others_are_served() {
    for kind in Flood::ALL {
        let server = TestServer::start_on(BYSTANDER, |_| {}).await;
        let address = server.address();
        let attacking = tokio::spawn(flood(kind, ATTACKER, address, ROUNDS, LONGEST));
        let times = beside(&server, &attacking).await;
        let fate = attacking.await.expect("it does not panic");
        let slowest = times[times.len() * 99 / 100];
        println!(
            "{kind:?}: {fate:?}; {} calls beside it, p99 {slowest:?}",
            times.len()
        );
        assert!(fate.is_closed, "{kind:?}: {fate:?}");
        assert!(fate.rounds < ROUNDS, "{kind:?}: {fate:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_floods_again_on_a_new_connection_has_no_new_budget() {
    let server = TestServer::start_on(BYSTANDER, |_| {}).await;
    let first = attack(&server, Flood::Ping).await;
    let second = attack(&server, Flood::Ping).await;
    println!("{first:?}, then {second:?}");
    assert!(first.is_closed && second.is_closed);
    assert!(second.rounds < first.rounds, "{first:?}, then {second:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_gives_up_its_calls_at_once_keeps_its_connection() {
    let server = TestServer::start_on(BYSTANDER, |_| {}).await;
    let calls = 64;
    let given_up = flood(
        Flood::RapidReset,
        ATTACKER,
        server.address(),
        calls,
        Duration::from_secs(1),
    );
    let fate = bounded("the calls", given_up).await;
    assert!(!fate.is_closed && fate.rounds == calls, "{fate:?}");
}
