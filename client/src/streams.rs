//! The client's streams: grasps of a search, tracks of a moving giver, and changes of objects.

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient, track_holdout_request::Message};
use tokio::sync::watch;
use tokio_stream::{StreamExt as _, wrappers::WatchStream};
use tonic::{Request, Streaming};

use crate::{client::GraspClient, error::ClientError};

/// Messages of the server, as they come. Dropping it ends the call, and a search with it.
#[derive(Debug)]
pub struct MessageStream<M>(pub(crate) Streaming<M>);

/// The grasps of a search, as they are found: after the last one comes the outcome, without a grasp.
pub type GraspStream = MessageStream<v1::FindGraspResponse>;

/// Changes of objects, as they happen.
pub type ObjectWatch = MessageStream<v1::WatchObjectsResponse>;

impl<M> MessageStream<M> {
    /// Waits for the next message; `None` after the last one. Cancelling the wait loses nothing.
    ///
    /// # Errors
    /// Any except those of connecting; with the code `Unavailable` when the server shuts down, and `DeadlineExceeded` of grasps or
    /// `ResourceExhausted` of changes if this client reads too slowly. Watch again then, with the present objects.
    pub async fn next(&mut self) -> Result<Option<M>, ClientError> {
        let message = self.0.message().await;
        message.map_err(|status| ClientError::from_status(&status, 1))
    }
}

/// A track of a moving giver. Frames never queue, neither here nor at the server: the latest wins. At most six answers queue for a
/// slow reader, as frames acknowledge the answers read. Dropping it ends the track.
#[derive(Debug)]
pub struct TrackStream {
    latest: watch::Sender<Option<v1::TrackFrame>>,
    answers: MessageStream<v1::TrackAnswer>,
    answers_read: u64,
}

impl TrackStream {
    /// Sends a frame, in place of one that has not left yet. Does not wait. Sets its `answers_read`.
    pub fn send(&self, frame: &v1::TrackFrame) {
        self.latest.send_replace(Some(v1::TrackFrame {
            answers_read: Some(self.answers_read),
            ..frame.clone()
        }));
    }

    /// Waits for the next answer; `None` after the answer to the last frame, once the server has ended the track without an error.
    /// Cancelling the wait loses nothing.
    ///
    /// # Errors
    /// Any except those of connecting; with the code `DeadlineExceeded` if no frame came for too long, and `Unavailable` when the
    /// server shuts down.
    pub async fn answer(&mut self) -> Result<Option<v1::TrackAnswer>, ClientError> {
        let answer = self.answers.next().await?;
        self.answers_read += 1;
        Ok(answer)
    }
}

impl GraspClient {
    /// Streams grasps of a holdout until the request's budget ends, then the outcome. The stream takes at most the call timeout
    /// plus the budget.
    ///
    /// # Errors
    /// Any except those of connecting; its violations list everything wrong with the request.
    pub async fn stream_grasps(&self, request: &v1::StreamGraspsRequest) -> Result<GraspStream, ClientError> {
        let stream =
            |channel, request| async move { GraspServiceClient::new(channel).stream_grasps(request).await };
        let messages = self
            .call("StreamGrasps", request.budget(), request, stream)
            .await?;
        Ok(MessageStream(messages))
    }

    /// Starts to track a giver who moves. The call timeout applies to the start only.
    ///
    /// # Errors
    /// Any except those of connecting; its violations list everything wrong with the track.
    pub async fn track(&self, track: &v1::Track) -> Result<TrackStream, ClientError> {
        let start = |channel, request: Request<v1::Track>| async move {
            let (mut metadata, extensions, track) = request.into_parts();
            // A deadline would end the track.
            metadata.remove("grpc-timeout");
            let (frames, latest) = watch::channel(None);
            let first = tokio_stream::once(Message::Track(track));
            let later = WatchStream::from_changes(latest).filter_map(|frame| frame.map(Message::Frame));
            let messages = first.chain(later).map(|message| v1::TrackHoldoutRequest {
                message: Some(message),
            });
            let request = Request::from_parts(metadata, extensions, messages);
            let answered = GraspServiceClient::new(channel).track_holdout(request).await?;
            Ok(answered.map(|answers| TrackStream {
                latest: frames,
                answers: MessageStream(answers),
                answers_read: 0,
            }))
        };
        self.call("TrackHoldout", None, track, start).await
    }
}
