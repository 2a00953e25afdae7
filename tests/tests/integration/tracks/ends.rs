//! How tracks end; they never wait, queue, or go on for nobody.

use std::time::{Duration, Instant};

use grasp_proto::v1::{self, track_holdout_request::Message};
use grasp_tests::TestServer;
use tokio_stream::StreamExt as _;
use tonic::{Code, Request, Status};

use super::{Created, Tracked, frame, held, overtaken, remote, swaying};
use crate::fixtures::{assert_status, bounded, box_request, create, delete, reason, until};

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_that_reads_nothing_causes_no_work_and_gets_the_latest() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    track.ask(frame(0, swaying(0))).await;
    // Far more than the transport holds of answers that nobody reads.
    let last = 3000;
    for sequence in 1..=last {
        track.send(frame(sequence, swaying(sequence))).await;
    }
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(
        server.gauges().unread_bytes() < 1 << 20,
        "{}",
        server.gauges().unread_bytes()
    );
    let mut answers = 0;
    loop {
        answers += 1;
        if track.next().await.unwrap().sequence == last {
            break;
        }
    }
    assert!(answers < last, "{answers}");
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_are_limited_and_end_with_their_clients() {
    let server = TestServer::start_with(|config| config.streams.tracks = 1.try_into().unwrap()).await;
    let mut track = Tracked::remote(&server).await;
    track.ask(frame(0, swaying(0))).await;
    let second = Tracked::start(&server, Message::Track(remote())).await;
    let status = second.err().unwrap();
    assert_status(&status, Code::ResourceExhausted, "TOO_MANY_TRACKS");
    // A client that goes away in the middle of a search for which there is much time.
    let blocked = crate::fixtures::impossible(&server).await;
    drop(track);
    let gone = async {
        until("a free place", || server.gauges().tracks() == 0).await;
        until("the end of the call", || server.gauges().calls() == 0).await;
    };
    tokio::time::timeout(Duration::from_secs(1), gone)
        .await
        .expect("tracks of clients that are gone are freed within a second");
    let hopeless = v1::Track::from(blocked.clone()).with_budget(Duration::from_secs(10));
    let track = Tracked::of(&server, hopeless).await;
    track.send(super::frame_of(0, blocked)).await;
    until("a search", || server.gauges().searches() == 1).await;
    drop(track);
    tokio::time::timeout(
        Duration::from_secs(1),
        until("the end of the search", || server.gauges().searches() == 0),
    )
    .await
    .expect("searches of clients that are gone stop within a second");
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_end_with_their_frames_their_deadline_or_without_either() {
    let server = TestServer::start_with(|config| {
        config.streams.track_idle = Duration::from_millis(300);
        config.drain = Duration::from_hours(1);
    })
    .await;
    // The last frame is answered, then the track ends well.
    let Tracked { frames, mut answers } = Tracked::remote(&server).await;
    let message = Some(Message::Frame(frame(0, swaying(0))));
    frames.send(v1::TrackHoldoutRequest { message }).await.unwrap();
    drop(frames);
    let last = bounded("an answer", answers.message()).await.unwrap();
    assert_eq!(last.unwrap().sequence, 0);
    assert_eq!(bounded("the end", answers.message()).await.unwrap(), None);

    let mut idle = Tracked::remote(&server).await;
    idle.ask(frame(0, swaying(0))).await;
    let status = idle.next().await.unwrap_err();
    assert_status(&status, Code::DeadlineExceeded, "TRACK_IDLE");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_ends_at_its_deadline() {
    let server = TestServer::start().await;
    let first = v1::TrackHoldoutRequest {
        message: Some(Message::Track(remote())),
    };
    // The client sends nothing more.
    let messages = tokio_stream::once(first).chain(tokio_stream::pending());
    let mut request = Request::new(messages);
    request.set_timeout(Duration::from_secs(2));
    let mut grasps = server.grasps().await;
    let mut answers = grasps.track_holdout(request).await.unwrap().into_inner();
    let status = bounded("the end", answers.message()).await.unwrap_err();
    assert_eq!(status.code(), Code::DeadlineExceeded, "{status:?}");
}

/// Largest number of answers by which the server may be ahead of the reader.
const FEW: usize = 6;

/// A frame of a client that has read `answers_read` answers.
fn after(answers_read: u64, sequence: u64) -> v1::TrackFrame {
    v1::TrackFrame {
        answers_read: Some(answers_read),
        ..frame(sequence, swaying(sequence))
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reader_who_comes_back_meets_few_old_answers() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    let last = 150;
    for sequence in 0..=last {
        track.send(after(0, sequence)).await;
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let mut answers = Vec::new();
    while answers.last() != Some(&last) {
        answers.push(track.next().await.unwrap().sequence);
    }
    assert!(answers.len() <= FEW + 1, "{answers:?}");
    // A client that reads on has an answer to each frame.
    for sequence in last + 1..last + 30 {
        track.ask(after(FEW as u64 + sequence - last, sequence)).await;
    }
    // A client with a call for each frame has read the answers before.
    let pushed = Created::remote(&server).await;
    for sequence in 0..3 * FEW as u64 {
        pushed.ask(after(0, sequence)).await;
    }
}

fn assert_not_found(status: &Status) {
    assert_status(status, Code::NotFound, "TRACK_NOT_FOUND");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_track_is_gone_and_others_cannot_be_guessed() {
    let server = TestServer::start_with(|config| config.streams.tracks = 3.try_into().unwrap()).await;
    let track = Created::remote(&server).await;
    let other = Created::remote(&server).await;
    assert_ne!(track.name, other.name);
    let status = Created::start(&server, remote()).await.err().unwrap();
    assert_eq!(reason(&status), "TOO_MANY_TRACKS");
    track.delete().await.unwrap();
    assert_eq!(server.gauges().tracks(), 1, "nothing is held of it");
    assert_not_found(&track.push(frame(0, swaying(0))).await.unwrap_err());
    assert_not_found(&track.delete().await.unwrap_err());
    Created::remote(&server).await;
    other.ask(frame(0, swaying(0))).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_without_frames_ends_and_one_with_frames_outlives_its_calls() {
    let idle = Duration::from_secs(1);
    let server = TestServer::start_with(|config| config.streams.track_idle = idle).await;
    let mut request = Request::new(remote());
    // The deadline is that of the call.
    request.set_timeout(Duration::from_secs(2));
    let created = server.grasps().await.create_track(request).await.unwrap();
    let track = Created {
        server: &server,
        name: created.into_inner().name,
    };
    let unused = Created::remote(&server).await;
    let start = Instant::now();
    let mut sequence = 0;
    while start.elapsed() < 3 * idle {
        track.ask(frame(sequence, swaying(sequence))).await;
        sequence += 1;
        tokio::time::sleep(idle / 4).await;
    }
    assert_eq!(server.gauges().tracks(), 1);
    assert_not_found(&unused.push(frame(0, swaying(0))).await.unwrap_err());
    until("the end of the track", || server.gauges().tracks() == 0).await;
    assert_not_found(&track.push(frame(sequence, swaying(0))).await.unwrap_err());
}

/// Longer than any test takes.
const LONG: Duration = Duration::from_secs(10);

/// A track whose frames exhaust this budget, and a frame.
async fn hopeless(server: &TestServer, budget: Duration) -> (Created<'_>, v1::TrackFrame) {
    let blocked = crate::fixtures::impossible(server).await;
    let track = v1::Track::from(blocked.clone()).with_budget(budget);
    let track = Created::start(server, track).await.expect("the track is right");
    (track, v1::TrackFrame::of(0, blocked.holdout.expect("it has one")))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_that_waits_is_overtaken_at_once_and_ends_with_its_track() {
    let server = TestServer::start().await;
    let (track, frame) = hopeless(&server, LONG).await;
    let push = |sequence| {
        track.push(v1::TrackFrame {
            sequence,
            ..frame.clone()
        })
    };
    let second = async {
        until("a search", || server.gauges().searches() == 1).await;
        push(1).await
    };
    let third = async {
        until("a waiting call", || server.gauges().calls() == 2).await;
        push(2).await
    };
    let ending = async {
        let second = second.await;
        track.delete().await.unwrap();
        second
    };
    let start = Instant::now();
    let (first, second, third) = tokio::join!(push(0), ending, third);
    assert_eq!(second.unwrap(), overtaken(1));
    assert_not_found(&first.unwrap_err());
    assert_not_found(&third.unwrap_err());
    assert!(start.elapsed() < LONG, "nothing waits for the search");
    assert_eq!(server.gauges().tracks(), 0);
    until("the end of the search", || server.gauges().searches() == 0).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_goes_on_after_its_object_was_deleted() {
    let server = TestServer::start().await;
    create(&server, box_request("cut")).await.unwrap();
    let track = v1::Track::new("objects/cut");
    let track = Created::start(&server, track).await.unwrap();
    delete(&server, "objects/cut").await.unwrap();
    let floating = |sequence| v1::TrackFrame::of(sequence, v1::Holdout::default());
    let status = track.push(floating(0)).await.unwrap_err();
    assert_eq!(reason(&status), "OBJECT_NOT_FOUND");
    let other = held(floating(1), |holdout| {
        "objects/remote".clone_into(&mut holdout.object);
    });
    track.ask(other).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn created_tracks_end_at_shutdown_and_take_no_more_frames() {
    let server = TestServer::start_with(|config| config.drain = Duration::from_hours(1)).await;
    let track = Created::remote(&server).await;
    track.ask(frame(0, swaying(0))).await;
    let name = track.name.clone();
    // On a connection that is open before the shutdown begins.
    let mut grasps = server.grasps().await;
    let stopping = server.begin_stop();
    let gauges = stopping.gauges().clone();
    until("the end of the track", || gauges.tracks() == 0).await;
    let late = v1::TrackFrame {
        track: name,
        ..frame(1, swaying(1))
    };
    let status = grasps.push_frame(late).await.unwrap_err();
    assert!(
        matches!(
            status.code(),
            Code::NotFound | Code::Unavailable | Code::Unknown | Code::Cancelled
        ),
        "{status:?}"
    );
    drop(grasps);
    bounded("the shutdown", stopping.stopped()).await;
    assert_eq!((gauges.tracks(), gauges.calls(), gauges.searches()), (0, 0, 0));
}
