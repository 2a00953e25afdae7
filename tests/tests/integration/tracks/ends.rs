//! How tracks end, and what they never do: wait, queue, or go on for nobody.

use std::time::Duration;

use grasp_proto::v1::{self, track_holdout_request::Message};
use grasp_tests::TestServer;
use tokio_stream::StreamExt as _;
use tonic::{Code, Request};

use super::{Tracked, frame, remote, swaying};
use crate::fixtures::{blamed_fields, bounded, milliseconds, reason, until};

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_reader_gets_the_answer_to_its_latest_frame() {
    let server = TestServer::start().await;
    let mut track = Tracked::remote(&server).await;
    track.ask(frame(0, swaying(0))).await;
    let last = 400;
    for sequence in 1..=last {
        track.send(frame(sequence, swaying(sequence))).await;
    }
    let mut answered = 0;
    let mut before = 0;
    while before < last {
        let answer = track.next().await.unwrap();
        assert!(answer.sequence > before, "answers are in order");
        before = answer.sequence;
        answered += 1;
    }
    assert!(answered < last, "frames that come at once overtake each other");
    server.stop().await;
}

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
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_track_is_rejected_with_every_violation() {
    let server = TestServer::start().await;
    let of_frames = frame(0, swaying(0)).holdout.unwrap();
    let wrong = v1::Track {
        holdout: Some(v1::Holdout {
            object: "remote".to_owned(),
            obstacles: vec![v1::Shape::ball(glam::Vec3::ZERO, 0.1)],
            other_hands: of_frames.presenting_hand.iter().cloned().collect(),
            ..of_frames
        }),
        receiver: Some(v1::Receiver {
            both_hands: true,
            ..Default::default()
        }),
        requirements: Some(v1::Requirements {
            thesis: Some(v1::ThesisOptions {
                thesis_validity: true,
                ..Default::default()
            }),
            ..Default::default()
        }),
        search: Some(v1::SearchOptions {
            replay_attempt: Some(3),
            ..Default::default()
        }),
        current: Some(v1::HandPose::default()),
        min_score_gain: Some(1.5),
        min_dwell: Some(milliseconds(-1)),
        prediction_horizon: Some(milliseconds(501)),
        grace: Some(crate::fixtures::seconds(6)),
        may_change_hand: true,
        ..Default::default()
    };
    let status = Tracked::start(&server, Message::Track(wrong))
        .await
        .err()
        .unwrap();
    let blamed = blamed_fields(&status);
    for field in [
        "track.holdout.object",
        "track.holdout.client_from_object",
        "track.holdout.presenting_hand",
        "track.holdout.other_hands",
        "track.holdout.obstacles",
        "track.receiver.both_hands",
        "track.requirements.thesis.thesis_validity",
        "track.search.replay_attempt",
        "track.current.rig",
        "track.min_score_gain",
        "track.min_dwell",
        "track.prediction_horizon",
        "track.grace",
    ] {
        assert!(
            blamed.iter().any(|blamed| blamed == field),
            "{field} in {blamed:?}"
        );
    }
    let status = Tracked::start(&server, Message::Frame(frame(0, swaying(0))))
        .await
        .err()
        .unwrap();
    assert_eq!(blamed_fields(&status), ["track"]);
    let missing = v1::Track::new("objects/missing");
    let status = Tracked::start(&server, Message::Track(missing))
        .await
        .err()
        .unwrap();
    assert_eq!(status.code(), Code::NotFound);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_are_limited_and_end_with_their_clients() {
    let server = TestServer::start_with(|config| config.streams.tracks = 1.try_into().unwrap()).await;
    let mut track = Tracked::remote(&server).await;
    track.ask(frame(0, swaying(0))).await;
    let second = Tracked::start(&server, Message::Track(remote())).await;
    let status = second.err().unwrap();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_TRACKS".to_owned())
    );
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
    server.stop().await;
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
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::DeadlineExceeded, "TRACK_IDLE".to_owned())
    );

    server.stop().await;
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
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tracks_end_with_unavailable_at_shutdown() {
    let server = TestServer::start_with(|config| config.drain = Duration::from_hours(1)).await;
    let mut track = Tracked::remote(&server).await;
    track.ask(frame(0, swaying(0))).await;
    let stopping = server.begin_stop();
    let status = track.next().await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::Unavailable, "SHUTTING_DOWN".to_owned())
    );
    bounded("the shutdown", stopping.stopped()).await;
}
