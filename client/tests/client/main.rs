//! Tests of the client library against a scripted service, of its messages, and of its examples.

mod scripted;

use std::{process::Command, time::Duration};

use glam::{Quat, Vec3};
use grasp_client::{
    ClientError, Code, ErrorDetails, GraspClient, Handedness, Outcome, RetryPolicy, std_duration,
    v1::{
        Contact, CreateObjectRequest, CurrentGrasp, DigitAngles, FindGraspRequest, FindGraspResponse,
        GetMeshResponse, Grasp, GraspObject, HandPose, Holdout, JointPose, ListObjectsRequest,
        ListObjectsResponse, NodePose, Pose, Shape, Track, TrackFrame, UploadObjectRequest,
        upload_object_request::Part,
    },
    wire_duration,
};
use tonic::Status;
use tonic_types::StatusExt as _;

use crate::scripted::{Act, Call, Scripted};

fn quick() -> RetryPolicy {
    RetryPolicy {
        initial_backoff: Duration::from_millis(1),
        max_backoff: Duration::from_millis(2),
        ..RetryPolicy::default()
    }
}

async fn connect(service: &Scripted, call_timeout: Duration) -> GraspClient {
    GraspClient::builder(service.serve().await)
        .call_timeout(call_timeout)
        .retry(quick())
        .connect()
        .await
        .unwrap()
}

const PATIENT: Duration = Duration::from_mins(1);

fn object(name: &str) -> GraspObject {
    GraspObject {
        name: name.to_owned(),
        ..GraspObject::default()
    }
}

#[tokio::test]
async fn retries_unavailable_until_answered() {
    let answer = FindGraspResponse {
        outcome: Outcome::BudgetExhausted.into(),
        ..FindGraspResponse::default()
    };
    let service = Scripted::new([Act::unavailable(), Act::unavailable(), Act::answer(&[answer])]);
    let client = connect(&service, PATIENT).await;
    let answer = client.find_grasp(&FindGraspRequest::new("objects/remote")).await;
    assert_eq!(answer.unwrap().outcome(), Outcome::BudgetExhausted);
    assert_eq!(service.calls().len(), 3);
}

#[tokio::test]
async fn retries_of_a_creation_have_the_same_id_and_other_calls_another() {
    let created = || Act::answer(&[object("objects/mug")]);
    let service = Scripted::new([created(), Act::unavailable(), created()]);
    let client = connect(&service, PATIENT).await;
    for _ in 0..2 {
        let mug = CreateObjectRequest::new("mug", "v 0 0 0", 0.3);
        client.create_object(&mug).await.unwrap();
    }
    let calls = service.calls();
    let [first, second, retry] = &calls[..] else {
        panic!("{} calls", calls.len())
    };
    let id = |call: &Call| call.messages::<CreateObjectRequest>()[0].request_id.clone();
    assert!(id(first) != id(second) && id(first).len() == 36);
    assert_eq!(id(second), id(retry));
}

#[tokio::test]
async fn does_not_wait_beyond_the_deadline() {
    let details = ErrorDetails::with_retry_info(Some(Duration::from_hours(1)));
    let status = Status::with_error_details(Code::Unavailable, "come back in an hour", details);
    let service = Scripted::new([Act::Fail(status)]);
    let client = connect(&service, PATIENT).await;
    let error = client.get_object("objects/remote").await.unwrap_err();
    let call = error.call().unwrap();
    let delay = call.details.retry_info().and_then(|info| info.retry_delay);
    assert_eq!(
        (call.code, delay),
        (Code::Unavailable, Some(Duration::from_hours(1)))
    );
}

#[tokio::test]
async fn reports_deadline_exceeded_without_answer() {
    let service = Scripted::new([Act::Hang]);
    let client = connect(&service, Duration::from_millis(50)).await;
    let error = client.get_object("objects/remote").await.unwrap_err();
    assert_eq!(error.code(), Some(Code::DeadlineExceeded), "{error}");
}

#[tokio::test]
async fn sends_deadline_plus_budget() {
    let found = FindGraspResponse::default();
    let service = Scripted::new([Act::answer(&[object("objects/remote")]), Act::answer(&[found])]);
    let client = connect(&service, PATIENT).await;
    client.get_object("objects/remote").await.unwrap();
    let request = FindGraspRequest::new("objects/remote").with_budget(Duration::from_secs(40));
    client.find_grasp(&request).await.unwrap();
    // The header has the microseconds left, in eight digits, and sending it takes less than a second.
    for (Call { timeout, .. }, most) in service.calls().iter().zip([60.0, 100.0]) {
        let (digits, unit) = timeout.split_at(timeout.len() - 1);
        let per_second = if unit == "u" { 1e6 } else { 1e3 };
        let seconds = digits.parse::<f64>().unwrap() / per_second;
        assert!(seconds > most - 1.0 && seconds <= most, "{timeout}");
    }
}

#[tokio::test]
async fn reads_all_pages_of_a_list_and_rejects_a_repeated_token() {
    let page = |name: &str, next: &str| {
        Act::answer(&[ListObjectsResponse {
            objects: vec![object(name)],
            next_page_token: next.to_owned(),
        }])
    };
    let pages = [
        page("a", "b"),
        page("b", "c"),
        page("c", ""),
        page("a", "b"),
        page("b", "b"),
    ];
    let service = Scripted::new(pages);
    let client = connect(&service, PATIENT).await;
    let request = ListObjectsRequest::default();
    let objects = client.list_objects(&request).await.unwrap();
    let names: Vec<_> = objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    let third = &service.calls()[2].messages::<ListObjectsRequest>()[0];
    assert_eq!(third.page_token, "c");
    let error = client.list_objects(&request).await.unwrap_err();
    assert!(matches!(error, ClientError::Malformed(_)), "{error:?}");
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
    let call = error.call().unwrap();
    assert_eq!((call.code, call.attempts), (Code::Unavailable, 4));
}

#[tokio::test]
async fn meshes_are_read_from_their_pieces() {
    let part = |piece: &[u8], etag: &str| GetMeshResponse {
        piece: piece.to_vec(),
        etag: etag.to_owned(),
    };
    let service = Scripted::new([
        Act::unavailable(),
        Act::answer(&[part(b"glTF", "1"), part(b"\x02\0", "")]),
    ]);
    let mesh = connect(&service, PATIENT)
        .await
        .get_mesh("objects/mug")
        .await
        .unwrap();
    assert_eq!(
        (mesh.glb.as_slice(), mesh.etag.as_str()),
        (&b"glTF\x02\0"[..], "1")
    );
}

#[tokio::test]
async fn large_meshes_are_sent_in_pieces() {
    let service = Scripted::new([Act::unavailable(), Act::answer(&[object("objects/mug")])]);
    let client = connect(&service, PATIENT).await;
    let mesh: Vec<u8> = (0..=(8 << 20)).map(|i: u32| i as u8).collect();
    let request = CreateObjectRequest::new("mug", mesh.clone(), 0.3);
    client.create_object(&request).await.unwrap();
    let [retried, sent] = [0, 1].map(|call| service.calls()[call].messages::<UploadObjectRequest>());
    assert_eq!(retried, sent);
    let (first, rest) = sent.split_first().unwrap();
    assert!(matches!(&first.part, Some(Part::Create(create)) if create.request_id.len() == 36));
    assert_eq!(first.total_bytes, mesh.len() as u64);
    let (last, pieces) = rest.split_last().unwrap();
    assert!(matches!(&last.part, Some(Part::Sha256(hash)) if hash.len() == 64));
    let pieces = pieces.iter().map(|part| match &part.part {
        Some(Part::Piece(piece)) => piece.as_slice(),
        other => panic!("{other:?}"),
    });
    assert!(pieces.collect::<Vec<_>>().concat() == mesh);
}

/// A hand of the rig `adult` with its wrist at `x` in the client's frame.
fn hand(x: f32) -> HandPose {
    HandPose::new("rigs/adult", Handedness::Left)
        .with_client_from_wrist(Pose::new(Vec3::X * x, Quat::IDENTITY))
}

#[test]
fn poses_map_points_and_inverses_map_them_back() {
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let a_from_b = Pose::new(Vec3::new(1.0, 2.0, 3.0), turn);
    let b_from_c = Pose::new(Vec3::X, Quat::IDENTITY);
    // By hand: c's origin lies at +x in b, and a quarter turn about z takes +x to +y.
    let origin = (a_from_b * b_from_c).transform_point(Vec3::ZERO);
    assert!(origin.abs_diff_eq(Vec3::new(1.0, 3.0, 3.0), 1e-6), "{origin}");
    let back = a_from_b.inverse().transform_point(origin);
    assert!(back.abs_diff_eq(Vec3::X, 1e-6), "{back}");
}

#[test]
fn durations_round_trip_and_malformed_ones_are_zero() {
    let duration = Duration::new(3, 250_000_001);
    assert_eq!(std_duration(wire_duration(duration)), duration);
    assert_eq!(wire_duration(Duration::MAX).seconds, i64::MAX);
    for (seconds, nanos) in [(-1, 0), (i64::MIN, i32::MIN), (0, -1)] {
        let malformed = prost_types::Duration { seconds, nanos };
        assert_eq!(std_duration(malformed), Duration::ZERO);
    }
}

#[test]
fn tracks_and_frames_split_a_request_without_overlap() {
    let mut request = FindGraspRequest::new("objects/remote")
        .with_client_from_object(Pose::new(Vec3::X, Quat::IDENTITY))
        .with_hand(hand(0.0))
        .with_hand(hand(1.0))
        .with_obstacle(Shape::ball(Vec3::ZERO, 0.1))
        .with_current(CurrentGrasp::new(hand(2.0)));
    request.holdout_mut().scale = Some(1.5);
    request.holdout_mut().mass_kg = Some(0.2);
    let track = Track::from(request.clone());
    let fixed = Holdout {
        scale: Some(1.5),
        mass_kg: Some(0.2),
        ..Holdout::new("objects/remote")
    };
    assert_eq!((track.holdout, track.current), (Some(fixed), Some(hand(2.0))));
    let holdout = request.holdout.unwrap();
    assert_eq!(holdout.presenting_hand, Some(hand(0.0).into()));
    assert_eq!(holdout.other_hands, [hand(1.0).into()]);
    let frame = TrackFrame::of(7, holdout.clone()).captured_at(Duration::from_millis(70));
    assert_eq!(
        (frame.sequence, frame.capture_time()),
        (7, Some(Duration::from_millis(70)))
    );
    let moving = Holdout {
        scale: None,
        mass_kg: None,
        ..holdout
    };
    assert_eq!(frame.holdout, Some(moving));
}

#[test]
fn a_current_grasp_has_only_fields_that_requests_use() {
    let answered = HandPose {
        joints: vec![JointPose::default()],
        model: vec![NodePose::default()],
        ..hand(1.0).with_digits([Some(DigitAngles::new([0.1; 4])); 5])
    };
    let kept = HandPose {
        joints: Vec::new(),
        model: Vec::new(),
        ..answered.clone()
    };
    let grasp = Grasp {
        hand: Some(answered),
        ..Grasp::default()
    };
    assert_eq!(grasp.current().grasp, Some(kept));
}

#[test]
fn contacts_are_moved_to_the_clients_frame() {
    let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let client_from_object = Pose::new(Vec3::Y, turn);
    let object_from_wrist = Pose::new(Vec3::new(0.1, 0.2, 0.3), Quat::from_rotation_x(0.4));
    let contact = Contact {
        position: Some(Vec3::X.into()),
        normal: Some(Vec3::X.into()),
        force: Some((2.0 * Vec3::NEG_X).into()),
        triangle: 5,
        ..Contact::default()
    };
    let hand = HandPose::new("rigs/adult", Handedness::Right)
        .with_client_from_wrist(client_from_object * object_from_wrist)
        .with_object_from_wrist(object_from_wrist);
    let grasp = Grasp {
        hand: Some(hand),
        contacts: vec![contact],
        ..Grasp::default()
    };
    let [moved] = grasp.client_contacts()[..] else {
        panic!("it has one")
    };
    for (vector, expected) in [
        (moved.position(), 2.0 * Vec3::Y),
        (moved.normal(), Vec3::Y),
        (moved.force(), 2.0 * Vec3::NEG_Y),
    ] {
        assert!(vector.abs_diff_eq(expected, 1e-6), "{vector} is not {expected}");
    }
    assert_eq!(moved.triangle, 5);
}

/// Runs an example that cargo built along with this test; returns its standard output.
async fn run(name: &str, arguments: &[&str]) -> String {
    // The test is in `deps`, next to `examples`.
    let test = std::env::current_exe().unwrap();
    let folder = test.ancestors().nth(2).unwrap().join("examples");
    let mut command = Command::new(folder.join(name));
    command.arg(real_server().await).args(arguments);
    let output = tokio::task::block_in_place(|| command.output()).expect("cargo has built the examples");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Starts a real server on a free port until the test's runtime ends; returns its URL.
async fn real_server() -> String {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let config = grasp_server::Config {
        place: grasp_server::config::StorePlace::Memory,
        ..grasp_server::Config::default()
    };
    tokio::spawn(grasp_server::run(listener, config, std::future::pending()));
    url
}

#[tokio::test(flavor = "multi_thread")]
async fn examples_find_grasps_and_write_an_animation() {
    let output = run("find_grasp", &[]).await;
    assert!(
        output.contains("wrist: at") && output.contains("joint 25: at"),
        "{output}"
    );
    let output = run("register_object", &[]).await;
    assert!(
        output.starts_with("objects/torch: 92 triangles, 150 g"),
        "{output}"
    );
    assert!(output.contains("Thumb touches triangle"), "{output}");
    let glb = concat!(env!("CARGO_TARGET_TMPDIR"), "/example_track/track.glb");
    let output = run("track", &[glb]).await;
    // A slow machine may find none in the first frames.
    assert!(
        output.contains("s: Replanned after") && output.contains("900 frames, "),
        "{output}"
    );
    assert!(std::fs::read(glb).unwrap().starts_with(b"glTF"));
}
