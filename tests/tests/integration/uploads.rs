//! Objects that are uploaded in pieces, and abandoned registrations.

use std::{
    f64::consts::TAU,
    fmt::Write as _,
    time::{Duration, Instant},
};

use grasp_proto::v1::{self, upload_object_request::Part};
use grasp_tests::TestServer;
use tokio_stream::{StreamExt as _, wrappers::ReceiverStream};
use tonic::{Code, Status};

use crate::{
    fixtures::{BOX_OBJ, assert_status, blamed_fields, bounded, box_request, sha256, until, with_object},
    wire::{answer_over_http_2, framed},
};

fn part(part: Part) -> v1::UploadObjectRequest {
    v1::UploadObjectRequest {
        part: Some(part),
        total_bytes: 0,
    }
}

fn begin(request: v1::CreateObjectRequest, bytes: usize) -> v1::UploadObjectRequest {
    v1::UploadObjectRequest {
        part: Some(Part::Create(v1::CreateObjectRequest {
            mesh: Vec::new(),
            ..request
        })),
        total_bytes: bytes as u64,
    }
}

fn piece(bytes: &[u8]) -> v1::UploadObjectRequest {
    part(Part::Piece(bytes.to_vec()))
}

fn hash(mesh: &[u8]) -> v1::UploadObjectRequest {
    part(Part::Sha256(sha256(mesh)))
}

/// The parts of a right upload in pieces of this size.
pub(crate) fn parts(id: &str, mesh: &[u8], size: usize) -> Vec<v1::UploadObjectRequest> {
    let mut parts = vec![begin(box_request(id), mesh.len())];
    parts.extend(mesh.chunks(size).map(piece));
    parts.push(hash(mesh));
    parts
}

pub(crate) async fn upload(
    server: &TestServer,
    parts: Vec<v1::UploadObjectRequest>,
) -> Result<v1::GraspObject, Status> {
    let answer = server
        .objects()
        .await
        .upload_object(tokio_stream::iter(parts))
        .await?;
    Ok(answer.into_inner())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_uploaded_object_is_the_created_one() {
    let server = TestServer::start().await;
    let created = server.objects().await.create_object(box_request("created")).await;
    let created = created.unwrap().into_inner();
    for (id, size) in [("bytes", 1), ("pieces", 50), ("whole", 1 << 20)] {
        let uploaded = upload(&server, parts(id, BOX_OBJ.as_bytes(), size))
            .await
            .unwrap();
        let expected = v1::GraspObject {
            name: format!("objects/{id}"),
            etag: uploaded.etag.clone(),
            create_time: uploaded.create_time,
            update_time: uploaded.update_time,
            ..created.clone()
        };
        assert_eq!(uploaded, expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_larger_than_a_message_is_uploaded() {
    let server = TestServer::start_with(|config| {
        config.maximum_object_bytes = 4096.try_into().unwrap();
    })
    .await;
    let mut mesh = BOX_OBJ.to_owned();
    while mesh.len() < 12 << 20 {
        let _ = writeln!(
            mesh,
            "# a comment as long as those of some exporters {}",
            mesh.len()
        );
    }
    let object = upload(&server, parts("large", mesh.as_bytes(), 1 << 20))
        .await
        .unwrap();
    assert_eq!(object.triangle_count, 12);
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_uploads_are_refused_and_leave_nothing() {
    let server = TestServer::start_with(|config| {
        config.streams.upload_bytes = (1 << 20).try_into().unwrap();
    })
    .await;
    let mesh = BOX_OBJ.as_bytes();
    let right = || parts("crate", mesh, 100);
    let without = |place: usize| {
        let mut parts = right();
        parts.remove(place);
        parts
    };
    let with = |place: usize, part: v1::UploadObjectRequest| {
        let mut parts = right();
        parts[place] = part;
        parts
    };
    let last = right().len() - 1;
    let heavy = with_object(box_request("Crate"), |object| object.mass_kg = -1.0);
    let sized = |bytes: usize| begin(box_request("crate"), bytes);
    for (name, parts, fields) in [
        ("no parts", Vec::new(), &["create"][..]),
        ("no object", without(0), &["create"]),
        ("a second object", with(2, right().swap_remove(0)), &["create"]),
        ("no hash", without(last), &["sha256"]),
        ("a piece too few", without(2), &["sha256"]),
        ("a wrong hash", with(last, hash(b"other")), &["sha256"]),
        ("an empty piece", with(1, piece(b"")), &["piece"]),
        ("a piece too many", with(last, piece(mesh)), &["piece"]),
        ("no part", with(1, v1::UploadObjectRequest::default()), &["part"]),
        ("a size too large", with(0, sized(2 << 20)), &["total_bytes"]),
        ("no size", with(0, sized(0)), &["total_bytes"]),
        (
            "wrong fields",
            with(0, begin(heavy, 10)),
            &["create.object.name", "create.object.mass_kg"],
        ),
        (
            "no mesh",
            self::parts("crate", b"once upon a time", 100),
            &["piece"],
        ),
    ] {
        let status = bounded(name, upload(&server, parts)).await.expect_err(name);
        assert_eq!(status.code(), Code::InvalidArgument, "{name}: {status}");
        assert_eq!(blamed_fields(&status), fields, "{name}: {status}");
    }
    upload(&server, right())
        .await
        .expect("nothing is left of the others");
    let status = upload(&server, right()).await.unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
}

/// An upload that has sent its object and some bytes, and sends no more until the sender is used or dropped.
async fn unfinished(
    server: &TestServer,
    id: &str,
    bytes: usize,
) -> (
    tokio::sync::mpsc::Sender<v1::UploadObjectRequest>,
    tokio::task::JoinHandle<Result<v1::GraspObject, Status>>,
) {
    let (sender, receiver) = tokio::sync::mpsc::channel(4);
    sender.send(begin(box_request(id), bytes)).await.unwrap();
    // Enough bytes to need a place, if the upload has them.
    let sent = "v 0 0 0\n".repeat(10_000);
    sender
        .send(piece(&sent.as_bytes()[..sent.len().min(bytes / 8 * 8)]))
        .await
        .unwrap();
    let mut client = server.objects().await;
    let call = tokio::spawn(async move {
        let answer = client.upload_object(ReceiverStream::new(receiver)).await?;
        Ok(answer.into_inner())
    });
    (sender, call)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stalled_upload_ends() {
    let server =
        TestServer::start_with(|config| config.streams.upload_idle = Duration::from_millis(200)).await;
    let (_sender, call) = unfinished(&server, "slow", 1000).await;
    let status = bounded("the end", call).await.unwrap().unwrap_err();
    assert_status(&status, Code::DeadlineExceeded, "UPLOAD_STALLED");
}

#[tokio::test(flavor = "multi_thread")]
async fn uploads_share_permits_and_bytes_until_they_end() {
    let server = TestServer::start_with(|config| {
        config.maximum_uploads = 3.try_into().unwrap();
        config.streams.upload_bytes = (1 << 20).try_into().unwrap();
    })
    .await;
    let (sender, call) = unfinished(&server, "first", 700 << 10).await;
    until("the upload", || server.gauges().calls() == 1).await;
    // The object or the bytes of the others may not have arrived yet.
    let refusal = async |parts: Vec<v1::UploadObjectRequest>| {
        loop {
            match upload(&server, parts.clone()).await {
                Err(status) if status.code() == Code::InvalidArgument => {}
                result => return result.unwrap_err(),
            }
        }
    };
    let begun = vec![begin(box_request("other"), 900 << 10)];
    let status = bounded("a refusal", refusal(begun)).await;
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_UPLOAD_BYTES");
    let (_second, _second_call) = unfinished(&server, "second", 100 << 10).await;
    until("both uploads", || server.gauges().calls() == 2).await;
    let status = bounded("a refusal", refusal(parts("third", b"v", 1))).await;
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_UPLOADS");
    // Slow uploads take no place.
    let mut dripping = Vec::new();
    for number in 0..4 {
        dripping.push(unfinished(&server, &format!("slow-{number}"), 8).await);
    }
    until("all uploads", || server.gauges().calls() == 6).await;
    // A client that goes away leaves its place and its bytes.
    call.abort();
    drop(sender);
    until("the end", || server.gauges().calls() == 5).await;
    let mesh = format!("{BOX_OBJ}{}", "#\n".repeat(350 << 10));
    bounded("a place", async {
        while upload(&server, parts("third", mesh.as_bytes(), 1 << 20))
            .await
            .is_err()
        {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refused_upload_is_answered_before_it_is_sent() {
    let server = TestServer::start().await;
    let (sender, receiver) = tokio::sync::mpsc::channel(1);
    sender
        .send(begin(box_request("remote"), 200 << 20))
        .await
        .unwrap();
    // The sender stays: the request never ends.
    let parts = ReceiverStream::new(receiver).chain(tokio_stream::pending());
    let status = bounded("the answer", server.objects().await.upload_object(parts))
        .await
        .unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
}

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
}

#[tokio::test(flavor = "multi_thread")]
async fn passed_deadline_is_deadline_exceeded_and_frees_its_place() {
    let server = one_at_a_time().await;
    let body = framed(&slow_request("ring"));
    // tonic's client would not wait for the answer.
    let headers = [("grpc-timeout", "800m")];
    let call = answer_over_http_2(&server, "ObjectService/CreateObject", &headers, body);
    let status = bounded("an answer", call).await.status_in_headers();
    assert_status(&status, Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
    let time = time_until_free(&server, "box").await;
    assert!(time < Duration::from_secs(2), "{time:?}");
}
