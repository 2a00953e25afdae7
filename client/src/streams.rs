//! The client's streams of grasps: better ones as they are found, the best that differ, and those of a giver who moves.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, track_holdout_request::Message};
use tokio::sync::watch;
use tokio_stream::{StreamExt as _, wrappers::WatchStream};
use tonic::{Request, Streaming};

use crate::{client::GraspClient, error::ClientError};

/// The grasps of a search, as they come. Dropping it stops the search on the server.
#[derive(Debug)]
pub struct GraspStream(Streaming<v1::FindGraspResponse>);

impl GraspStream {
    /// Waits for the next message: a grasp or, at the end, the outcome without one; `None` after that. Cancelling the wait loses
    /// nothing.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Unavailable`] when the server shuts down,
    /// [`ClientError::DeadlineExceeded`] if this client reads too slowly.
    pub async fn next(&mut self) -> Result<Option<v1::FindGraspResponse>, ClientError> {
        let message = self.0.message().await;
        message.map_err(|status| ClientError::from_status(&status, 1))
    }
}

/// A track of a moving giver. Frames never wait, neither here nor at the server: the latest wins. Nor do many answers: who reads none
/// for a while meets at most six old ones, as frames say how many were read. Dropping it ends the track.
#[derive(Debug)]
pub struct TrackStream {
    frames: TrackFrames,
    answers: Streaming<v1::TrackAnswer>,
}

/// The frames' side of a track, to send frames from elsewhere.
#[derive(Clone, Debug)]
pub struct TrackFrames {
    latest: watch::Sender<Option<v1::TrackFrame>>,
    /// Number of answers that were read.
    answers_read: Arc<AtomicU64>,
}

impl TrackFrames {
    /// Sends a frame, in place of one that has not left yet. Does not wait. Its `answers_read` is set here.
    pub fn send(&self, frame: &v1::TrackFrame) {
        let frame = v1::TrackFrame {
            answers_read: Some(self.answers_read.load(Ordering::Relaxed)),
            ..frame.clone()
        };
        self.latest.send_replace(Some(frame));
    }
}

impl TrackStream {
    /// Sends a frame, in place of one that has not left yet. Does not wait. Its `answers_read` is set here.
    pub fn send(&self, frame: &v1::TrackFrame) {
        self.frames.send(frame);
    }

    /// The frames' side, which keeps the track open as long as it lives.
    pub fn frames(&self) -> TrackFrames {
        self.frames.clone()
    }

    /// Waits for the next answer; `None` after the answer to the last frame, once the server has ended the track without an error.
    /// Cancelling the wait loses nothing.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::DeadlineExceeded`] if no frame came for too long, [`ClientError::Unavailable`] when the server shuts down.
    pub async fn answer(&mut self) -> Result<Option<v1::TrackAnswer>, ClientError> {
        let answer = self.answers.message().await;
        let answer = answer.map_err(|status| ClientError::from_status(&status, 1))?;
        self.frames.answers_read.fetch_add(1, Ordering::Relaxed);
        Ok(answer)
    }
}

impl GraspClient {
    /// Streams grasps of a holdout until the request's budget ends, then the outcome. The stream takes at most the call timeout
    /// plus the budget.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the request.
    pub async fn stream_grasps(&self, request: &v1::StreamGraspsRequest) -> Result<GraspStream, ClientError> {
        let timeout = self.timeout_with(request.budget());
        let messages = self
            .call("StreamGrasps", timeout, request, |channel, request| async move {
                GraspServiceClient::new(channel).stream_grasps(request).await
            })
            .await?;
        Ok(GraspStream(messages))
    }

    /// Starts to track a giver who moves. The call timeout applies to the start only.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the track.
    pub async fn track(&self, track: &v1::Track) -> Result<TrackStream, ClientError> {
        let (frames, answers) = self
            .call(
                "TrackHoldout",
                self.call_timeout,
                track,
                |channel, request| async move {
                    let (mut metadata, extensions, track) = request.into_parts();
                    // A deadline would end the track.
                    metadata.remove("grpc-timeout");
                    let (frames, latest) = watch::channel(None);
                    let first = tokio_stream::once(Message::Track(track));
                    let later =
                        WatchStream::from_changes(latest).filter_map(|frame| frame.map(Message::Frame));
                    let messages = first.chain(later).map(|message| v1::TrackHoldoutRequest {
                        message: Some(message),
                    });
                    let request = Request::from_parts(metadata, extensions, messages);
                    let answered = GraspServiceClient::new(channel).track_holdout(request).await?;
                    let frames = TrackFrames {
                        latest: frames,
                        answers_read: Arc::default(),
                    };
                    Ok(answered.map(|answers| (frames, answers)))
                },
            )
            .await?;
        Ok(TrackStream { frames, answers })
    }
}
