//! Tracks whose frames are pushed, for clients that cannot stream both ways.

use std::time::{Duration, Instant};

use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_tests::TestServer;
use tonic::{Code, Request, Status};

use super::{Tracked, frame, held, remote, swaying};
use crate::fixtures::{blamed_fields, bounded, box_request, create, delete, reason, until};

/// Longer than any test takes.
const LONG: Duration = Duration::from_secs(10);

/// A created track.
pub(super) struct Created<'a> {
    server: &'a TestServer,
    name: String,
}

impl<'a> Created<'a> {
    /// Creates a track.
    pub(super) async fn start(server: &'a TestServer, track: v1::Track) -> Result<Self, Status> {
        let created = server.grasps().await.create_track(track).await?;
        let name = created.into_inner().name;
        Ok(Self { server, name })
    }

    /// Tracks the remote.
    pub(super) async fn remote(server: &'a TestServer) -> Self {
        let started = Self::start(server, remote()).await;
        started.expect("the track is right")
    }

    pub(super) async fn push(&self, frame: v1::TrackFrame) -> Result<v1::TrackAnswer, Status> {
        let frame = v1::TrackFrame {
            track: self.name.clone(),
            ..frame
        };
        let mut grasps = self.server.grasps().await;
        let answer = bounded("the answer", grasps.push_frame(frame)).await?;
        Ok(answer.into_inner())
    }

    /// The answer to a frame that no other overtakes.
    pub(super) async fn ask(&self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        let sequence = frame.sequence;
        let answer = self.push(frame).await.expect("the track is there");
        assert_eq!(answer.sequence, sequence);
        assert_ne!(answer.status(), CurrentGraspStatus::Unspecified, "{sequence}");
        answer
    }

    pub(super) async fn delete(&self) -> Result<(), Status> {
        let name = self.name.clone();
        let mut grasps = self.server.grasps().await;
        let deleted = grasps.delete_track(v1::DeleteTrackRequest { name });
        bounded("the deletion", deleted).await.map(|_| ())
    }
}

/// The answer to a frame that was overtaken.
pub(super) fn overtaken(sequence: u64) -> v1::TrackAnswer {
    v1::TrackAnswer {
        sequence,
        ..Default::default()
    }
}

fn assert_not_found(status: &Status) {
    assert_eq!(
        (status.code(), reason(status)),
        (Code::NotFound, "TRACK_NOT_FOUND".to_owned())
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn pushed_frames_are_answered_like_streamed_ones() {
    let server = TestServer::start().await;
    let sent = remote().with_seed(3);
    let created = server.grasps().await.create_track(sent.clone()).await;
    let created = created.unwrap().into_inner();
    let name = created.name.clone();
    assert_eq!(
        created,
        v1::Track {
            name: name.clone(),
            ..sent.clone()
        }
    );
    let pushed = Created {
        server: &server,
        name,
    };
    let first = pushed.ask(frame(0, swaying(0))).await;
    assert_eq!(first.status(), CurrentGraspStatus::Replanned);
    let track = v1::Track {
        current: first.grasp.unwrap().hand,
        ..sent
    };
    let mut streamed = Tracked::of(&server, track).await;
    streamed.ask(frame(0, swaying(0))).await;
    let alike = |answer: v1::TrackAnswer| v1::TrackAnswer {
        server_time: None,
        ..answer
    };
    for sequence in 1..10 {
        let answer = pushed.ask(frame(sequence, swaying(sequence))).await;
        assert_eq!(answer.status(), CurrentGraspStatus::Kept);
        assert!(answer.server_time.is_some());
        let like = streamed.ask(frame(sequence, swaying(sequence))).await;
        assert_eq!(alike(answer), alike(like), "{sequence}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_track_is_gone_and_others_cannot_be_guessed() {
    let server = TestServer::start_with(|config| config.streams.tracks = 2.try_into().unwrap()).await;
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
    for name in ["", "tracks/", "tracks/1", "objects/remote"] {
        let none = Created {
            server: &server,
            name: name.to_owned(),
        };
        let status = none.push(frame(0, swaying(0))).await.unwrap_err();
        assert_eq!(blamed_fields(&status), ["track"], "{name}");
        let status = none.delete().await.unwrap_err();
        assert_eq!(blamed_fields(&status), ["name"], "{name}");
    }
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

/// A track whose frames are searched for as long as this, and a frame.
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
