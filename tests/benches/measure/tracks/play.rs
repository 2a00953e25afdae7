//! A client of one track, and givers who move.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, track_holdout_request::Message};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::random_holdouts::ClientHoldout;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Streaming, transport::Channel};

use crate::tracks::RATE;

/// An open track.
pub(crate) struct Tracked {
    frames: mpsc::Sender<v1::TrackHoldoutRequest>,
    answers: Streaming<v1::TrackAnswer>,
}

impl Tracked {
    /// Tracks an object with the server's defaults.
    pub(crate) async fn start(client: GraspServiceClient<Channel>, object: &str) -> Self {
        Self::start_with(client, v1::Track::new(object)).await
    }

    /// Starts a track.
    pub(crate) async fn start_with(mut client: GraspServiceClient<Channel>, track: v1::Track) -> Self {
        let (frames, sent) = mpsc::channel(64);
        let first = v1::TrackHoldoutRequest {
            message: Some(Message::Track(track)),
        };
        frames.send(first).await.expect("there is room");
        let answers = client.track_holdout(ReceiverStream::new(sent)).await;
        Self {
            frames,
            answers: answers.expect("the track is right").into_inner(),
        }
    }

    /// Sends a frame; true unless none fits.
    pub(crate) fn send(&self, frame: v1::TrackFrame) -> bool {
        let message = Some(Message::Frame(frame));
        self.frames.try_send(v1::TrackHoldoutRequest { message }).is_ok()
    }

    /// The next answer.
    pub(crate) async fn next(&mut self) -> v1::TrackAnswer {
        let answer = self.answers.message().await.expect("the frames are right");
        answer.expect("the track goes on")
    }

    /// The answer to a frame.
    pub(crate) async fn ask(&mut self, frame: v1::TrackFrame) -> v1::TrackAnswer {
        assert!(self.send(frame), "there is room");
        self.next().await
    }
}

/// How a giver moves with the object.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Moving {
    Walk,
    Turn,
    Shake,
}

impl Moving {
    pub(crate) const ALL: [Self; 3] = [Self::Walk, Self::Turn, Self::Shake];
}

/// A holdout at a time in seconds.
pub(crate) fn moved(moving: Moving, holdout: &ClientHoldout, time: f32) -> ClientHoldout {
    let wave = |per_second: f32, phase: f32| (std::f32::consts::TAU * (per_second * time + phase)).sin();
    let waves = |per_second: f32| {
        Vec3::new(
            wave(per_second, 0.0),
            wave(1.3 * per_second, 0.3),
            wave(0.8 * per_second, 0.7),
        )
    };
    let origin = holdout.client_from_object.position;
    let about_object = |turn: Quat| Pose::new(origin - turn * origin, turn);
    let together = |by: Pose| ClientHoldout {
        client_from_object: by * holdout.client_from_object,
        giver: holdout.giver.transformed(by),
    };
    match moving {
        Moving::Walk => {
            let way = Vec3::new(0.4 * wave(0.1, 0.0), 0.015 * wave(1.8, 0.0), 0.1 * wave(0.2, 0.0));
            together(Pose::from_position(way) * about_object(Quat::from_rotation_y(0.4 * wave(0.1, 0.0))))
        }
        Moving::Turn => together(about_object(Quat::from_rotation_z(1.5 * wave(0.12, 0.0)))),
        Moving::Shake => {
            let turn = Quat::from_scaled_axis(0.03 * waves(7.0));
            together(Pose::from_position(0.006 * waves(8.0)) * about_object(turn))
        }
    }
}

/// A frame of a track.
pub(crate) fn frame(sequence: u64, holdout: &ClientHoldout) -> v1::TrackFrame {
    let holdout = v1::Holdout {
        object: String::new(),
        ..holdout.request("objects/any").holdout.expect("it is set")
    };
    v1::TrackFrame::of(sequence, holdout).captured_at(Duration::from_secs_f64(sequence as f64 / RATE))
}
