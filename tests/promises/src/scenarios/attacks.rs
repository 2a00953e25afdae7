//! Attacks on the transport: how soon another client is answered beside each, the attacker's fate, and the memory that it takes.

use std::time::{Duration, Instant};

use grasp_tests::attacks::{Flood, PREFACE, connect as attack_from, flood};
use tokio::{io::AsyncWriteExt as _, net::TcpStream, task::JoinHandle};

use crate::{
    Failure,
    bench::Bench,
    load::{Call, HEAVY, LIGHT, find_grasp, open_loop},
    report::{Row, Unit},
};

/// Warm calls per second of the bystander.
const RATE: f64 = 200.0;

/// Largest p99 beside an attack, and the aim, relative to that without one.
const SLOWDOWN: [f64; 2] = [2.0, 1.5];

/// Least p99 that counts: below, timers and other processes decide.
const LEAST_MS: f64 = 2.0;

/// Largest memory that all attacks together may take, and the aim, in MiB.
const GROWTH_MIB: [f64; 2] = [64.0, 32.0];

/// Idle connections, and slow ones.
const IDLE: usize = 1000;
const SLOW: usize = 100;

pub(crate) async fn measure(bench: &Bench) -> Result<Vec<Row>, Failure> {
    let server = bench.server(&["--builder-threads", "1"])?;
    let call = find_grasp(server.address, LIGHT, &bench.requests.warm).await?;
    // Reads atlases, and learns grips where they have none.
    beside(&call, Duration::from_secs(2)).await;
    let before = server.resident_bytes()?;
    let length = bench.seconds(30, 2);
    bench.step("a client without attacks");
    let alone = beside(&call, 2 * length).await;
    let base = alone.max(LEAST_MS);
    let row = |name: &str, p99: f64, how: String| {
        let how = format!("p99 of {RATE}/s warm calls; {alone:.2} ms without; {how}");
        Row::at_most(
            &format!("p99 beside {name}"),
            Unit::Milliseconds,
            SLOWDOWN.map(|times| times * base),
            p99,
            how,
        )
    };
    let mut rows = Vec::new();
    for kind in Flood::ALL {
        bench.step(format_args!("attacks: {kind:?}"));
        let attacking = tokio::spawn(attack(kind, server.address, length));
        let p99 = beside(&call, length).await;
        let (connections, rounds) = attacking.await?;
        rows.push(row(
            &format!("{kind:?}"),
            p99,
            format!("{connections} connections cut, {rounds} rounds sent"),
        ));
    }
    bench.step("attacks: idle and slow connections");
    let idle = hold(server.address, IDLE, PREFACE).await;
    let slow = hold(server.address, SLOW, b"POST / HTTP/1.1\r\nhost: ").await;
    let p99 = beside(&call, length).await;
    let held = format!("{} idle and {} slow connections", idle.len(), slow.len());
    rows.push(row("1,000 idle and 100 slow connections", p99, held));
    let growth = (server.resident_bytes()? - before) / f64::from(1 << 20);
    rows.push(Row::at_most(
        "memory that attacks take",
        Unit::Mebibytes,
        GROWTH_MIB,
        growth,
        "resident memory".to_owned(),
    ));
    Ok(rows)
}

/// The p99 of the bystander's calls for some time, in milliseconds.
async fn beside(call: &Call, length: Duration) -> f64 {
    open_loop(call.clone(), RATE, length, 1)
        .await
        .latency_ms(0.99, |_| true)
}

/// Floods on one connection after the other; how many were cut off, and the rounds sent in all.
async fn attack(kind: Flood, server: std::net::SocketAddr, length: Duration) -> (u32, u64) {
    let start = Instant::now();
    let (mut connections, mut rounds) = (0, 0);
    while let Some(left) = length.checked_sub(start.elapsed()) {
        let fate = flood(kind, HEAVY, server, u32::MAX, left).await;
        connections += u32::from(fate.is_closed);
        rounds += u64::from(fate.rounds);
    }
    (connections, rounds)
}

/// Connections on which some bytes were sent.
async fn hold(server: std::net::SocketAddr, count: usize, sent: &'static [u8]) -> Vec<TcpStream> {
    let opening: Vec<JoinHandle<TcpStream>> = (0..count)
        .map(|_| {
            tokio::spawn(async move {
                let mut stream = attack_from(HEAVY, server).await;
                // It may be closed already.
                let _ = stream.write_all(sent).await;
                stream
            })
        })
        .collect();
    let mut held = Vec::new();
    for stream in opening {
        held.extend(stream.await);
    }
    held
}
