//! The same by parts, for clients that cannot stream both ways.

use grasp_proto::v1::{self, StandingStatus, open_track_response::Message};
use grasp_tests::TestServer;
use tonic::{Code, Status, Streaming};

use super::{frame, setup, status_of, swaying};
use crate::fixtures::{blamed_fields, bounded, reason, until};

/// An open track and its name.
pub(super) async fn open(server: &TestServer) -> (Streaming<v1::OpenTrackResponse>, String) {
    let request = v1::OpenTrackRequest {
        setup: Some(setup(v1::TrackPolicy::default())),
    };
    let opened = server.grasps().await.open_track(request).await;
    let mut answers = opened.expect("the setup is right").into_inner();
    let first = bounded("the name", answers.message()).await.unwrap().unwrap();
    match first.message {
        Some(Message::Track(name)) => (answers, name),
        other => panic!("{other:?} is no name"),
    }
}

pub(super) async fn push(server: &TestServer, track: &str, frame: v1::TrackFrame) -> Result<bool, Status> {
    let request = v1::PushFrameRequest {
        track: track.to_owned(),
        frame: Some(frame),
    };
    let pushed = server.grasps().await.push_frame(request).await?;
    Ok(pushed.into_inner().overtaken)
}

pub(super) async fn next(answers: &mut Streaming<v1::OpenTrackResponse>) -> v1::TrackAnswer {
    let response = bounded("an answer", answers.message()).await.unwrap().unwrap();
    match response.message {
        Some(Message::Answer(answer)) => answer,
        other => panic!("{other:?} is no answer"),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pushed_frames_are_answered_like_streamed_ones() {
    let server = TestServer::start().await;
    let (mut answers, track) = open(&server).await;
    assert!(!push(&server, &track, frame(0, swaying(0))).await.unwrap());
    let first = next(&mut answers).await;
    assert_eq!(status_of(&first), StandingStatus::Replanned);
    for sequence in 1..10 {
        push(&server, &track, frame(sequence, swaying(sequence)))
            .await
            .unwrap();
        let answer = next(&mut answers).await;
        assert_eq!(
            (answer.sequence, status_of(&answer)),
            (sequence, StandingStatus::Kept)
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn late_frames_are_ignored_and_wrong_ones_rejected_and_the_track_goes_on() {
    let server = TestServer::start().await;
    let (mut answers, track) = open(&server).await;
    push(&server, &track, frame(7, swaying(7))).await.unwrap();
    next(&mut answers).await;
    assert!(
        push(&server, &track, frame(6, swaying(6))).await.unwrap(),
        "6 comes after 7"
    );
    let wrong = v1::TrackFrame {
        presenting_hand: Some(v1::PresentingHand { form: None }),
        ..frame(8, swaying(8))
    };
    let status = push(&server, &track, wrong).await.unwrap_err();
    assert_eq!(blamed_fields(&status), ["frame.presenting_hand"]);
    // The number of a rejected frame may be used again.
    assert!(!push(&server, &track, frame(8, swaying(8))).await.unwrap());
    assert_eq!(next(&mut answers).await.sequence, 8);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_track_is_gone_with_its_call_and_others_cannot_be_guessed() {
    let server = TestServer::start().await;
    let (answers, track) = open(&server).await;
    let (_other, other_track) = open(&server).await;
    assert_ne!(track, other_track);
    drop(answers);
    until("the end of the track", || server.gauges().tracks() == 1).await;
    let status = push(&server, &track, frame(0, swaying(0))).await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::NotFound, "TRACK_NOT_FOUND".to_owned())
    );
    for name in ["", "tracks/", "tracks/1", "objects/remote"] {
        let status = push(&server, name, frame(0, swaying(0))).await.unwrap_err();
        assert_eq!(blamed_fields(&status), ["track"], "{name}");
    }
    let nothing = v1::PushFrameRequest {
        track: other_track,
        frame: None,
    };
    let status = server.grasps().await.push_frame(nothing).await.unwrap_err();
    assert_eq!(blamed_fields(&status), ["frame"]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn open_tracks_end_with_unavailable_at_shutdown_and_take_no_more_frames() {
    let server = TestServer::start_with(|config| config.drain = std::time::Duration::from_hours(1)).await;
    let (mut answers, track) = open(&server).await;
    push(&server, &track, frame(0, swaying(0))).await.unwrap();
    next(&mut answers).await;
    // On a connection that is open before the shutdown begins.
    let mut grasps = server.grasps().await;
    let stopping = server.begin_stop();
    let gauges = stopping.gauges().clone();
    let status = bounded("the end of the track", answers.message())
        .await
        .unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::Unavailable, "SHUTTING_DOWN".to_owned())
    );
    let late = v1::PushFrameRequest {
        track,
        frame: Some(frame(1, swaying(1))),
    };
    let status = grasps.push_frame(late).await.unwrap_err();
    assert!(
        matches!(
            status.code(),
            Code::NotFound | Code::Unavailable | Code::Unknown | Code::Cancelled
        ),
        "{status:?}"
    );
    bounded("the shutdown", stopping.stopped()).await;
    assert_eq!((gauges.tracks(), gauges.calls(), gauges.searches()), (0, 0, 0));
}
