//! Registrations that nobody waits for any more.

use std::{
    f64::consts::TAU,
    fmt::Write as _,
    time::{Duration, Instant},
};

use grasp_proto::v1;
use grasp_tests::TestServer;
use prost::Message as _;
use tonic::Code;

use crate::{
    fixtures::{bounded, box_request, reason},
    malformed::{framed, status_within},
};

/// Sides of a ring's round and of its section: far more triangles than can be built within these tests.
const SIDES: usize = 600;

/// A request to create a ring of 720,000 triangles.
fn slow_request(id: &str) -> v1::CreateObjectRequest {
    let mut text = String::new();
    let angle = |side: usize| TAU * side as f64 / SIDES as f64;
    for around in 0..SIDES {
        for across in 0..SIDES {
            let ((s, c), (v, u)) = (angle(around).sin_cos(), angle(across).sin_cos());
            let out = 0.04 + 0.01 * u;
            writeln!(text, "v {} {} {}", out * c, 0.01 * v, -out * s).unwrap();
        }
    }
    let index = |around: usize, across: usize| (around % SIDES) * SIDES + across % SIDES + 1;
    for i in 0..SIDES {
        for j in 0..SIDES {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    v1::CreateObjectRequest {
        mesh: text.into_bytes(),
        ..box_request(id)
    }
}

/// A server that registers one object at a time.
async fn one_at_a_time() -> TestServer {
    TestServer::start_with(|config| {
        config.maximum_uploads = 1.try_into().unwrap();
        config.maximum_object_bytes = (64 << 20).try_into().unwrap();
        config.maximum_object_triangles = 1_000_000.try_into().unwrap();
    })
    .await
}

/// How long it takes until the place for registrations is free.
async fn time_until_free(server: &TestServer, id: &str) -> Duration {
    let started = Instant::now();
    let mut objects = server.objects().await;
    bounded("a free place", async {
        while let Err(status) = objects.create_object(box_request(id)).await {
            assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    })
    .await;
    started.elapsed()
}

#[tokio::test(flavor = "multi_thread")]
async fn dropped_call_frees_its_place_long_before_the_object_would_be_built() {
    let server = one_at_a_time().await;
    // At different steps: while it is read, and while it is built.
    for (id, wait) in [("early", 100), ("late", 1500)] {
        let mut objects = server.objects().await;
        let call = tokio::spawn(async move { objects.create_object(slow_request("ring")).await });
        tokio::time::sleep(Duration::from_millis(wait)).await;
        assert!(!call.is_finished());
        call.abort();
        let time = time_until_free(&server, id).await;
        assert!(time < Duration::from_secs(2), "{id}: {time:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn passed_deadline_is_deadline_exceeded_and_frees_its_place() {
    let server = one_at_a_time().await;
    let body = framed(&slow_request("ring").encode_to_vec());
    let call = status_within(&server, "ObjectService/CreateObject", body, Some("800m"));
    let status = bounded("an answer", call).await;
    assert_eq!(status.code(), Code::DeadlineExceeded, "{status:?}");
    assert_eq!(reason(&status), "DEADLINE_EXCEEDED");
    let time = time_until_free(&server, "box").await;
    assert!(time < Duration::from_secs(2), "{time:?}");
    server.stop().await;
}
