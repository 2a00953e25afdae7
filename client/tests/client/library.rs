//! The library against a scripted service.

use std::time::Duration;

use grasp_client::{ClientError, GraspClient, Outcome, RetryPolicy, v1};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

use crate::scripted::{Act, Scripted};

/// Retries with negligible waits.
fn quick() -> RetryPolicy {
    RetryPolicy {
        initial_backoff: Duration::from_millis(1),
        max_backoff: Duration::from_millis(2),
        ..RetryPolicy::default()
    }
}

/// Starts the service and connects to it.
async fn connect(service: &Scripted, call_timeout: Duration) -> GraspClient {
    GraspClient::builder(service.serve().await)
        .call_timeout(call_timeout)
        .retry(quick())
        .connect()
        .await
        .unwrap()
}

const PATIENT: Duration = Duration::from_mins(1);

fn unavailable() -> Act {
    Act::Fail(Status::unavailable("draining"))
}

#[tokio::test]
async fn retries_unavailable_until_answered() {
    let service = Scripted::new([unavailable(), unavailable(), Act::Answer]);
    let client = connect(&service, PATIENT).await;
    let answer = client
        .find_grasp(&v1::FindGraspRequest::new("objects/remote"))
        .await
        .unwrap();
    assert_eq!(answer.outcome(), Outcome::BudgetExhausted);
    assert_eq!(answer.attempts(), 5);
    assert_eq!(service.calls(), 3);
}

#[tokio::test]
async fn retries_of_a_creation_have_the_same_id_and_other_calls_another() {
    let service = Scripted::new([Act::Answer, Act::Answer]);
    let client = connect(&service, PATIENT).await;
    let object = v1::CreateObjectRequest::new("mug", "v 0 0 0", 0.3);
    for _ in 0..2 {
        client.create_object(&object).await.unwrap();
    }
    let ids = service.request_ids.lock().unwrap().clone();
    assert!(
        ids.len() == 2 && ids[0] != ids[1] && ids[0].len() == 36,
        "{ids:?}"
    );
    // The id is recorded before the script decides.
    let service = Scripted::new([unavailable(), Act::Answer]);
    let client = connect(&service, PATIENT).await;
    client.create_object(&object).await.unwrap();
    let ids = service.request_ids.lock().unwrap().clone();
    assert!(ids.len() == 2 && ids[0] == ids[1], "{ids:?}");
}

#[tokio::test]
async fn does_not_wait_beyond_the_deadline() {
    let details = ErrorDetails::with_retry_info(Some(Duration::from_hours(1)));
    let status = Status::with_error_details(Code::Unavailable, "come back in an hour", details);
    let service = Scripted::new([Act::Fail(status), Act::Answer]);
    let client = connect(&service, PATIENT).await;
    let error = client.get_object("objects/remote").await.unwrap_err();
    let ClientError::Unavailable(call) = error else {
        panic!("{error:?}")
    };
    assert_eq!(call.details.retry_delay, Some(Duration::from_hours(1)));
    assert_eq!(service.calls(), 1);
}

#[tokio::test]
async fn reports_deadline_exceeded_without_answer() {
    let service = Scripted::new([Act::Hang]);
    let client = connect(&service, Duration::from_millis(50)).await;
    let error = client.get_object("objects/remote").await.unwrap_err();
    assert!(matches!(error, ClientError::DeadlineExceeded(_)), "{error:?}");
}

#[tokio::test]
async fn sends_deadline_plus_budget() {
    let service = Scripted::new([Act::Answer, Act::Answer]);
    let client = connect(&service, PATIENT).await;
    client.get_object("objects/remote").await.unwrap();
    let request = v1::FindGraspRequest::new("objects/remote").with_budget(Duration::from_secs(40));
    client.find_grasp(&request).await.unwrap();
    let sent = service.grpc_timeouts.lock().unwrap().clone();
    // The header has the microseconds left, in eight digits, and sending it takes less than a second.
    for (sent, most) in sent.iter().zip([60.0, 100.0]) {
        let (digits, unit) = sent.split_at(sent.len() - 1);
        let per_second = if unit == "u" { 1e6 } else { 1e3 };
        let seconds = digits.parse::<f64>().unwrap() / per_second;
        assert!(seconds > most - 1.0 && seconds <= most, "{sent}");
    }
}

#[tokio::test]
async fn reads_all_pages_of_a_list_and_rejects_a_repeated_token() {
    let mut service = Scripted::new((0..5).map(|_| Act::Answer));
    let request = v1::ListObjectsRequest::default();
    let client = connect(&service, PATIENT).await;
    let objects = client.list_objects(&request).await.unwrap();
    let names: Vec<_> = objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["objects/", "objects/b", "objects/c"]);
    service.repeats_page_token = true;
    let client = connect(&service, PATIENT).await;
    let error = client.list_objects(&request).await.unwrap_err();
    assert!(matches!(error, ClientError::Malformed { .. }), "{error:?}");
}

#[tokio::test]
async fn distinguishes_invalid_endpoints_from_closed_ports() {
    for endpoint in ["", "not a url", "localhost:50051", "/path"] {
        let error = GraspClient::connect(endpoint).await.unwrap_err();
        assert!(
            matches!(error, ClientError::Endpoint { .. }),
            "{endpoint:?}: {error:?}"
        );
    }
    // A port that was just freed.
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("http://{}", listener.local_addr().unwrap());
    drop(listener);
    let error = GraspClient::connect(&endpoint).await.unwrap_err();
    assert!(matches!(error, ClientError::Connect { .. }), "{error:?}");
    // A client that connects lazily reports an unavailable server instead.
    let client = GraspClient::builder(&endpoint)
        .retry(quick())
        .connect_lazy()
        .unwrap();
    let error = client.health().await.unwrap_err();
    assert!(matches!(error, ClientError::Unavailable(_)), "{error:?}");
    assert_eq!(error.call().unwrap().attempts, 4);
}

/// The file of a mesh, of a header that says `length` and a body of zeros.
fn glb(length: u32, body: usize) -> Vec<u8> {
    let mut glb = b"glTF\x02\x00\x00\x00".to_vec();
    glb.extend(length.to_le_bytes());
    glb.extend(vec![0; body]);
    glb
}

#[tokio::test]
async fn reads_a_mesh_and_notices_what_is_missing() {
    let whole = glb(300_012, 300_000);
    for (file, expected) in [
        (whole.clone(), Some(&whole)),
        (glb(300_012, 299_999), None),
        (glb(300_012, 300_001), None),
        (b"glTF".to_vec(), None),
        (b"v 0 0 0\nv 1 0 0\n".to_vec(), None),
        (Vec::new(), None),
    ] {
        let mut service = Scripted::new([unavailable(), Act::Answer]);
        service.mesh = file;
        let client = connect(&service, PATIENT).await;
        match (client.get_mesh("objects/mug").await, expected) {
            (Ok(mesh), Some(expected)) => {
                assert!(mesh.glb == *expected, "{} bytes", mesh.glb.len());
                assert_eq!(mesh.etag, "1");
            }
            (Err(ClientError::Malformed { field, .. }), None) => assert_eq!(field, "piece"),
            (answer, _) => panic!("{answer:?}"),
        }
    }
}

#[tokio::test]
async fn large_meshes_are_sent_in_pieces() {
    let service = Scripted::new([unavailable(), Act::Answer]);
    let client = connect(&service, PATIENT).await;
    let mesh: Vec<u8> = (0..=(8 << 20)).map(|i: u32| i as u8).collect();
    let request = v1::CreateObjectRequest::new("mug", mesh.clone(), 0.3);
    let object = client.create_object(&request).await.unwrap();
    assert_eq!(object.name, "objects/mug");
    assert!(*service.uploaded.lock().unwrap() == mesh);
    let ids = service.request_ids.lock().unwrap().clone();
    assert!(ids.len() == 1 && ids[0].len() == 36, "{ids:?}");
}
