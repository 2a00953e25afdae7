//! Tests of the client library against a scripted service, of its messages, and of its examples.

mod scripted;

use std::{
    path::PathBuf,
    process::{Command, Output},
    time::Duration,
};

use glam::{Quat, Vec3};
use grasp_client::{
    ClientError, GraspClient, Handedness, Outcome, RetryPolicy, std_duration,
    v1::{
        self, Contact, CurrentGrasp, DigitAngles, FindGraspRequest, Grasp, HandPose, Holdout, JointPose,
        NodePose, Pose, Shape, Track, TrackFrame,
    },
    wire_duration,
};
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

/// A hand of the rig `adult` whose wrist is here in the client's frame.
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
fn tracks_leave_out_what_frames_contain_and_frames_what_is_the_tracks() {
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
fn a_grasp_to_hold_on_to_has_no_more_than_requests_are_read_for() {
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

/// Runs an example that cargo built along with this test; its standard output.
async fn run(name: &str, arguments: &[&str]) -> String {
    let url = real_server().await;
    // The test is in `deps`, next to `examples`.
    let test = std::env::current_exe().unwrap();
    let folder = test.parent().and_then(|deps| deps.parent()).unwrap();
    let example: PathBuf = folder
        .join("examples")
        .join(name)
        .with_extension(std::env::consts::EXE_EXTENSION);
    assert!(
        example.exists(),
        "build the examples: cargo build --package grasp-client --examples"
    );
    let mut command = Command::new(example);
    command.arg(&url).args(arguments);
    let output: Output = tokio::task::spawn_blocking(move || command.output())
        .await
        .unwrap()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
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
async fn find_grasp_prints_wrist_and_joints() {
    let output = run("find_grasp", &[]).await;
    assert!(
        output.contains("wrist: at") && output.contains("joint 25: at"),
        "{output}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn register_object_finds_grasp_with_tracked_giver() {
    let output = run("register_object", &[]).await;
    assert!(
        output.starts_with("objects/torch: 92 triangles, 150 g"),
        "{output}"
    );
    assert!(output.contains("Thumb touches triangle"), "{output}");
}

#[tokio::test(flavor = "multi_thread")]
async fn track_prints_changes_and_writes_an_animation() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("example_track");
    let glb = folder.join("track.glb");
    let output = run("track", &[glb.to_str().unwrap()]).await;
    // A slow machine may find none in the first frames.
    assert!(output.contains("s: Replanned after"), "{output}");
    assert!(output.contains("900 frames, "), "{output}");
    assert!(std::fs::read(glb).unwrap().starts_with(b"glTF"));
}
