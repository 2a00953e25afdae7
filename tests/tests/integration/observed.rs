//! What operators see: metrics, probes, and ids of requests.

use std::{collections::BTreeSet, time::Duration};

use grasp_proto::v1::{self, track_holdout_request::Message};
use grasp_tests::TestServer;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Request, Status};
use tonic_types::StatusExt as _;

use crate::{
    fixtures::{assert_status, bounded, find, floating_remote},
    wire::{Answer, answer_over_http_2, call, framed},
};

const FIND: &str = "GraspService/FindGrasp";

/// Value of the sample that begins with a text.
fn value(page: &str, sample: &str) -> f64 {
    let line = page
        .lines()
        .find(|line| line.rsplit_once(' ').is_some_and(|(name, _)| name == sample));
    let (_, value) = line
        .unwrap_or_else(|| panic!("no {sample} in {page}"))
        .rsplit_once(' ')
        .unwrap();
    value.parse().unwrap()
}

async fn page(server: &TestServer) -> String {
    let (status, text) = server.monitor("/metrics").await;
    assert_eq!(status, 200);
    text
}

#[tokio::test(flavor = "multi_thread")]
async fn calls_searches_and_refusals_are_counted() {
    let server = TestServer::start().await;
    find(&server, floating_remote()).await;
    let wrong = v1::FindGraspRequest::new("objects/nowhere");
    server.grasps().await.find_grasp(wrong).await.unwrap_err();
    let page = page(&server).await;
    let labels = "grpc_type=\"unary\",grpc_service=\"grasp.v1.GraspService\",grpc_method=\"FindGrasp\"";
    for (sample, expected) in [
        (format!("grpc_server_started_total{{{labels}}}"), 2.0),
        (
            format!("grpc_server_handled_total{{{labels},grpc_code=\"OK\"}}"),
            1.0,
        ),
        (
            format!("grpc_server_handled_total{{{labels},grpc_code=\"NotFound\"}}"),
            1.0,
        ),
        (format!("grpc_server_handling_seconds_count{{{labels}}}"), 2.0),
        ("grasp_search_seconds_count".to_owned(), 1.0),
        ("grasp_queue_seconds_count".to_owned(), 1.0),
        ("grasp_outcomes_total{outcome=\"FOUND\"}".to_owned(), 1.0),
        (
            "grasp_refusals_total{reason=\"OBJECT_NOT_FOUND\"}".to_owned(),
            1.0,
        ),
        (
            "grasp_refusals_total{reason=\"TOO_MANY_SEARCHES\"}".to_owned(),
            0.0,
        ),
        ("grasp_searches".to_owned(), 0.0),
        ("grasp_searches_limit".to_owned(), 64.0),
        ("grasp_objects{state=\"loaded\"}".to_owned(), 0.0),
        ("grasp_store_reachable".to_owned(), 1.0),
    ] {
        assert_eq!(value(&page, &sample), expected, "{sample}");
    }
    assert!(value(&page, "process_resident_memory_bytes") > 1e6);
    assert!(value(&page, "process_cpu_seconds_total") > 0.0);
}

/// Everything before the values.
fn series(page: &str) -> BTreeSet<&str> {
    let samples = page.lines().filter(|line| !line.starts_with('#'));
    samples
        .map(|line| line.rsplit_once(' ').expect("a value").0)
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_cannot_make_series() {
    let server = TestServer::start().await;
    let content_type = [("content-type", "application/grpc")];
    let call_strange = async |number: usize| {
        let method = format!("Some{number}Service/Method{number}");
        answer_over_http_2(&server, &method, &content_type, Vec::new()).await;
    };
    call_strange(0).await;
    let before = page(&server).await;
    for number in 1..20 {
        call_strange(number).await;
    }
    let after = page(&server).await;
    assert_eq!(series(&before), series(&after));
    let unknown =
        "grpc_server_started_total{grpc_type=\"unknown\",grpc_service=\"unknown\",grpc_method=\"unknown\"}";
    assert_eq!(value(&after, unknown), 20.0);
    println!("{} series, {} bytes", series(&after).len(), after.len());
    assert!(series(&after).len() < 2000);
}

/// Metrics that are named in a text: words with the prefixes of this server's.
fn named(text: &str) -> BTreeSet<&str> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    let prefixes = ["grasp_", "grpc_server_", "process_"];
    words
        .filter(|word| prefixes.iter().any(|prefix| word.starts_with(prefix)))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn dashboard_and_alerts_name_metrics_that_the_server_has() {
    let page = page(&TestServer::start().await).await;
    let known: BTreeSet<&str> = series(&page)
        .into_iter()
        .map(|one| one.split('{').next().unwrap())
        .collect();
    let dashboard = include_str!("../../../docker/grafana/grasp.json");
    serde_json::from_str::<serde_json::Value>(dashboard).expect("the dashboard is JSON");
    let alerts = include_str!("../../../docker/prometheus/alerts.yaml");
    for (file, least) in [(dashboard, 30), (alerts, 15)] {
        let named = named(file);
        assert!(named.len() >= least, "{named:?}");
        assert_eq!(named.difference(&known).collect::<Vec<_>>(), [&""; 0]);
    }
    // Whoever is alerted finds what to do.
    let operations = include_str!("../../../server/OPERATIONS.md");
    for alert in alerts
        .lines()
        .filter_map(|line| line.trim().strip_prefix("- alert: "))
    {
        assert!(operations.contains(&format!("`{alert}`")), "{alert}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn probes_and_metrics_are_all_that_the_port_for_operators_has() {
    let server = TestServer::start().await;
    assert_eq!(server.monitor("/livez").await, (200, "alive\n".to_owned()));
    assert_eq!(server.monitor("/readyz").await, (200, "ready\n".to_owned()));
    assert_eq!(server.monitor("/").await.0, 404);
    assert_eq!(server.monitor("/grasp.v1.GraspService/FindGrasp").await.0, 404);
}

/// Ids in the headers of an answer and in the details of its error.
fn ids(answer: &Answer) -> (&str, Option<String>) {
    let (_, status) = answer.messages::<v1::FindGraspResponse>();
    let details = status.get_error_details();
    let detail = details.request_info().map(|info| info.request_id.clone());
    (
        answer.header("x-request-id").expect("every answer has one"),
        detail,
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_and_its_error_have_the_id_of_the_request_or_a_new_one() {
    let server = TestServer::start().await;
    let ask = async |request: v1::FindGraspRequest, id: &str| {
        let headers = [("x-request-id", id)];
        let answer = answer_over_http_2(&server, FIND, &headers, framed(&request)).await;
        bounded("an answer", async { answer }).await
    };
    let wrong = || v1::FindGraspRequest::new("objects/nowhere");
    assert_eq!(
        ids(&ask(wrong(), "my-id").await),
        ("my-id", Some("my-id".to_owned()))
    );
    assert_eq!(ids(&ask(floating_remote(), "my-id").await), ("my-id", None));
    let answer = ask(wrong(), "not an id").await;
    let (new, detail) = ids(&answer);
    assert!(new.len() > 16 && detail.as_deref() == Some(new), "{answer:?}");
    // Connect and its errors, too.
    let headers = [("content-type", "application/json"), ("x-request-id", "its-id")];
    for body in ["{}", r#"{"holdout": {"object": "objects/remote"}}"#] {
        let answer = call(server.address(), FIND, &headers, body.into()).await;
        assert_eq!(answer.header("x-request-id"), Some("its-id"), "{answer:?}");
        let is_error = answer.status != 200;
        let text = String::from_utf8(answer.body).unwrap();
        assert_eq!(
            text.contains(r#""debug":{"requestId":"its-id"}"#),
            is_error,
            "{text}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_error_that_ends_a_stream_has_the_id_of_the_request() {
    let server = TestServer::start_with(|config| {
        config.streams.track_idle = Duration::from_millis(100);
    })
    .await;
    let track = v1::TrackHoldoutRequest {
        message: Some(Message::Track(v1::Track::new("objects/remote"))),
    };
    let (sender, receiver) = mpsc::channel(1);
    sender.send(track).await.unwrap();
    let mut request = Request::new(ReceiverStream::new(receiver));
    request
        .metadata_mut()
        .insert("x-request-id", "a-stream".parse().unwrap());
    let mut answers = server
        .grasps()
        .await
        .track_holdout(request)
        .await
        .unwrap()
        .into_inner();
    let status: Status = bounded("the end", answers.message()).await.unwrap_err();
    assert_status(&status, Code::DeadlineExceeded, "TRACK_IDLE");
    let details = status.get_error_details();
    assert_eq!(details.request_info().unwrap().request_id, "a-stream");
}
