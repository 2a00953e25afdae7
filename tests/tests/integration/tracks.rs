//! Tracking a giver who moves.

mod ends;
mod holding;
mod jumps;
mod lost;
mod open;
mod random;
mod reading;
mod starting;
mod swaying;

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, StandingStatus, track_holdout_request::Message};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, wire_pose};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use crate::fixtures::{bounded, held_remote};

/// A track over one connection.
struct Tracked {
    frames: mpsc::Sender<v1::TrackHoldoutRequest>,
    answers: Streaming<v1::TrackHoldoutResponse>,
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

    /// Tracks the remote.
    async fn remote(server: &TestServer, policy: v1::TrackPolicy) -> Self {
        let started = Self::start(server, Message::Setup(setup(policy))).await;
        started.expect("the setup is right")
    }

    async fn send(&self, frame: v1::TrackFrame) {
        let message = Some(Message::Frame(frame));
        let sent = self.frames.send(v1::TrackHoldoutRequest { message }).await;
        sent.expect("the track is open");
    }

    /// The next answer, or the status that ends the track.
    async fn next(&mut self) -> Result<v1::TrackAnswer, Status> {
        let response = bounded("an answer", self.answers.message()).await?;
        Ok(response.expect("the track goes on").answer.expect("it is set"))
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

/// The setup of a track of the remote, received by the right hand.
fn setup(policy: v1::TrackPolicy) -> v1::TrackSetup {
    v1::TrackSetup {
        holdout: Some(v1::FindGraspRequest {
            object: "objects/remote".to_owned(),
            receiving_hand: Some(crate::fixtures::receiving(v1::Handedness::Right)),
            // Unoptimised builds search longer than a frame.
            budget: Some(crate::fixtures::seconds(5)),
            ..Default::default()
        }),
        policy: Some(policy),
    }
}

/// The held remote, moved with its giver.
fn frame(sequence: u64, moved: Pose) -> v1::TrackFrame {
    let held = held_remote();
    let Some(v1::presenting_hand::Form::Angles(mut giver)) = held.presenting_hand.and_then(|hand| hand.form)
    else {
        panic!("the giver is given by angles");
    };
    giver.client_from_wrist = Some(wire_pose(moved * pose_of(giver.client_from_wrist)));
    v1::TrackFrame {
        sequence,
        capture_time: Some(time_of(sequence)),
        client_from_object: Some(wire_pose(moved * pose_of(held.client_from_object))),
        presenting_hand: Some(v1::PresentingHand {
            form: Some(v1::presenting_hand::Form::Angles(giver)),
        }),
        ..Default::default()
    }
}

/// The capture time of a frame at 90 Hz.
fn time_of(sequence: u64) -> prost_types::Duration {
    Duration::from_micros(11_111 * sequence)
        .try_into()
        .expect("it is short")
}

fn pose_of(pose: Option<v1::Pose>) -> Pose {
    let pose = pose.unwrap_or_default();
    let v1::Vector3 { x, y, z } = pose.position.unwrap_or_default();
    let orientation = pose.orientation.map_or(Quat::IDENTITY, |q| {
        Quat::from_xyzw(q.x, q.y, q.z, q.w).normalize()
    });
    Pose::new(Vec3::new(x, y, z), orientation)
}

/// A giver who sways and turns.
fn swaying(sequence: u64) -> Pose {
    let time = sequence as f32 / 90.0;
    Pose::new(
        Vec3::new(0.1 * (2.0 * time).sin(), 0.02 * (5.0 * time).cos(), 0.3 * time),
        Quat::from_rotation_y(0.3 * (3.0 * time).sin()),
    )
}

fn status_of(answer: &v1::TrackAnswer) -> StandingStatus {
    answer.standing.as_ref().expect("it is set").status()
}
