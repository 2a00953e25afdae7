//! Streams of grasps: better ones as they are found, or the best that differ.

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use tonic::Streaming;

use crate::{client::GraspClient, error::ClientError};

/// The grasps of a search, as they come. Dropping it stops the search on the server.
#[derive(Debug)]
pub struct GraspStream(Streaming<v1::FindGraspResponse>);

impl GraspStream {
    /// Waits for the next message: a grasp or, at the end, the outcome without one; none after that. Cancelling the wait loses
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
}
