//! Tracking a giver who moves.

mod ends;
mod holding;
mod random;

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, presenting_hand::Form, track_holdout_request::Message};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use crate::fixtures::{bounded, held_remote, with};

/// A track over one connection.
struct Tracked {
    frames: mpsc::Sender<v1::TrackHoldoutRequest>,
    answers: Streaming<v1::TrackAnswer>,
}

impl Tracked {
    /// Starts a track with a first message.
    async fn start(server: &TestServer, first: Message) -> Result<Self, Status> {
        // More than any test sends before it reads.
        let (frames, sent) = mpsc::channel(1024);
        let first = v1::TrackHoldoutRequest { message: Some(first) };
        frames.send(first).await.expect("there is room");
        let mut grasps = server.grasps().await;
        let answers = grasps.track_holdout(ReceiverStream::new(sent)).await?;
        Ok(Self {
            frames,
            answers: answers.into_inner(),
        })
    }

    /// Starts a track that is right.
    async fn of(server: &TestServer, track: v1::Track) -> Self {
        let started = Self::start(server, Message::Track(track)).await;
        started.expect("the track is right")
    }

    /// Tracks the remote.
    async fn remote(server: &TestServer) -> Self {
        Self::of(server, remote()).await
    }

    async fn send(&self, frame: v1::TrackFrame) {
        let message = Some(Message::Frame(frame));
        let sent = self.frames.send(v1::TrackHoldoutRequest { message }).await;
        sent.expect("the track is open");
    }

    /// The next answer, or the status that ends the track.
    async fn next(&mut self) -> Result<v1::TrackAnswer, Status> {
        let answer = bounded("an answer", self.answers.message()).await?;
        Ok(answer.expect("the track goes on"))
    }

    /// The answer to a frame.
    async fn ask(&mut self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        let sequence = frame.sequence;
        self.send(frame).await;
        let answer = self.next().await.expect("the frame is right");
        assert_eq!(answer.sequence, sequence);
        answer
    }
}

/// A track of the remote, received by the right hand.
fn remote() -> v1::Track {
    // Unoptimised builds search longer than a frame.
    v1::Track::new("objects/remote")
        .receiving(v1::Handedness::Right)
        .with_budget(Duration::from_secs(5))
}

/// A frame with this holdout.
fn frame_of(sequence: u64, request: v1::FindGraspRequest) -> v1::TrackFrame {
    let holdout = v1::Holdout {
        object: String::new(),
        ..request.holdout.expect("it has one")
    };
    v1::TrackFrame::of(sequence, holdout).captured_at(time_of(sequence))
}

/// The held remote, moved with its giver.
fn frame(sequence: u64, moved: Pose) -> v1::TrackFrame {
    let mut held = held_remote();
    let holdout = held.holdout_mut();
    holdout.client_from_object = Some(wire_pose(moved * pose_of(holdout.client_from_object)));
    let Some(v1::PresentingHand {
        form: Some(Form::Pose(giver)),
    }) = &mut holdout.presenting_hand
    else {
        panic!("the giver is posed");
    };
    giver.client_from_wrist = Some(wire_pose(moved * pose_of(giver.client_from_wrist)));
    frame_of(sequence, held)
}

/// The same frame with another holdout.
fn held(frame: v1::TrackFrame, change: impl FnOnce(&mut v1::Holdout)) -> v1::TrackFrame {
    with(frame, |frame| change(frame.holdout.get_or_insert_default()))
}

/// The capture time of a frame at 90 Hz.
fn time_of(sequence: u64) -> Duration {
    Duration::from_micros(11_111 * sequence)
}

fn pose_of(pose: Option<v1::Pose>) -> Pose {
    let pose = pose.unwrap_or_default();
    Pose::new(pose.position(), pose.orientation().normalize())
}

/// Where the wrist of a grasp is in the client's frame.
fn wrist_of(answer: &v1::TrackAnswer) -> Pose {
    let grasp = answer.grasp.as_ref().expect("there is a grasp");
    pose_of(grasp.client_from_wrist())
}

/// A giver who sways and turns.
fn swaying(sequence: u64) -> Pose {
    let time = sequence as f32 / 90.0;
    Pose::new(
        Vec3::new(0.1 * (2.0 * time).sin(), 0.02 * (5.0 * time).cos(), 0.3 * time),
        Quat::from_rotation_y(0.3 * (3.0 * time).sin()),
    )
}

/// Why the answer has no grasp.
fn no_grasp(answer: &v1::TrackAnswer) -> v1::Check {
    answer.current.as_ref().expect("it is set").no_grasp()
}

/// Fails unless an answer is that to a wrong frame, and names the field.
fn assert_wrong(answer: &v1::TrackAnswer, field: &str) {
    assert_eq!(
        (answer.status(), no_grasp(answer)),
        (v1::CurrentGraspStatus::None, v1::Check::Frame),
        "{field}"
    );
    assert!(answer.grasp.is_none(), "{field}");
    assert_blames(answer, field);
}

/// Fails unless an answer's warnings name a field.
fn assert_blames(answer: &v1::TrackAnswer, field: &str) {
    assert!(
        answer.warnings.iter().any(|warning| warning.starts_with(field)),
        "{field} in {:?}",
        answer.warnings
    );
}

/// A created track.
struct Created<'a> {
    server: &'a TestServer,
    name: String,
}

impl<'a> Created<'a> {
    /// Creates a track.
    async fn start(server: &'a TestServer, track: v1::Track) -> Result<Self, Status> {
        let created = server.grasps().await.create_track(track).await?;
        let name = created.into_inner().name;
        Ok(Self { server, name })
    }

    /// Tracks the remote.
    async fn remote(server: &'a TestServer) -> Self {
        let started = Self::start(server, remote()).await;
        started.expect("the track is right")
    }

    async fn push(&self, frame: v1::TrackFrame) -> Result<v1::TrackAnswer, Status> {
        let frame = v1::TrackFrame {
            track: self.name.clone(),
            ..frame
        };
        let mut grasps = self.server.grasps().await;
        let answer = bounded("the answer", grasps.push_frame(frame)).await?;
        Ok(answer.into_inner())
    }

    /// The answer to a frame that no other overtakes.
    async fn ask(&self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        let sequence = frame.sequence;
        let answer = self.push(frame).await.expect("the track is there");
        assert_eq!(answer.sequence, sequence);
        assert_ne!(answer.status(), v1::CurrentGraspStatus::Unspecified, "{sequence}");
        answer
    }

    async fn delete(&self) -> Result<(), Status> {
        let name = self.name.clone();
        let mut grasps = self.server.grasps().await;
        let deleted = grasps.delete_track(v1::DeleteTrackRequest { name });
        bounded("the deletion", deleted).await.map(|_| ())
    }
}

/// The answer to a frame that was overtaken.
fn overtaken(sequence: u64) -> v1::TrackAnswer {
    v1::TrackAnswer {
        sequence,
        ..Default::default()
    }
}
