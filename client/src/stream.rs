//! Streams of grasps: better ones as they are found, or the best that differ.

use std::time::Duration;

use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use serde::{Deserialize, Serialize};
use tonic::Streaming;

use crate::{
    client::GraspClient,
    error::ClientError,
    json,
    report::{GraspSource, SearchReport},
    search::{FindRequest, Grasp, Outcome},
    wire,
};

/// What the grasps of an answer differ by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DifferBy {
    /// The side of the object that the hand comes from, and the hand.
    Approach,
    /// The grasp type.
    Type,
    /// The part of the object that is held: its region or, without regions, an eighth of its bounding box.
    Region,
}

/// Which grasps are streamed.
#[derive(Clone, Debug, PartialEq)]
pub enum Streamed {
    /// Each that is better than those before.
    Better {
        /// Most per second, up to 1000; none: 30. The best of those that come sooner is sent.
        most_per_second: Option<f32>,
    },
    /// The best that differ, once the budget ends, best first.
    Alternatives {
        /// At most so many, from 1 to 32.
        count: u32,
        /// What they differ by; empty: [`DifferBy::Approach`].
        differ_by: Vec<DifferBy>,
    },
}

/// A grasp of a stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StreamedGrasp {
    /// The grasp.
    pub grasp: Grasp,
    /// Time since the search started.
    #[serde(rename = "found_after_seconds", with = "json::seconds")]
    pub found_after: Duration,
    /// Origin of the grasp; none if this library does not know it.
    pub source: Option<GraspSource>,
}

/// The end of a stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StreamSummary {
    /// How the search ended.
    pub outcome: Outcome,
    /// The report of the whole search.
    pub report: SearchReport,
    /// Number of grasps sent.
    pub sent: u32,
    /// Number of better grasps that were not sent, because better ones followed too soon.
    pub skipped: u64,
}

/// A message of a stream.
#[derive(Clone, Debug, PartialEq)]
pub enum StreamEvent {
    /// A grasp.
    Grasp(Box<StreamedGrasp>),
    /// The end, after which nothing comes.
    Summary(Box<StreamSummary>),
}

/// The grasps of a search, as they come. Dropping it stops the search on the server.
#[derive(Debug)]
pub struct GraspStream(Streaming<v1::StreamGraspsResponse>);

impl GraspStream {
    /// Waits for the next message; none after the summary. Cancelling the wait loses nothing.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::Unavailable`] when the server shuts down,
    /// [`ClientError::DeadlineExceeded`] if this client reads too slowly.
    pub async fn next(&mut self) -> Result<Option<StreamEvent>, ClientError> {
        let message = self.0.message().await;
        let message = message.map_err(|status| ClientError::from_status(&status, 1))?;
        Ok(message.map(wire::stream_event_from_wire).transpose()?)
    }
}

impl GraspClient {
    /// Streams grasps of a holdout until the request's budget ends, then a summary. The request's choice must be absent or
    /// [`Choice::BestWithinBudget`](crate::Choice::BestWithinBudget). The stream takes at most the call timeout plus the budget.
    ///
    /// # Errors
    /// Any except those of connecting; [`ClientError::InvalidArgument`] lists everything wrong with the request.
    pub async fn stream_grasps(
        &self,
        request: &FindRequest,
        streamed: &Streamed,
    ) -> Result<GraspStream, ClientError> {
        let message = wire::stream_request_to_wire(request, streamed);
        let timeout = self
            .call_timeout
            .saturating_add(request.budget.unwrap_or_default());
        let messages = self
            .call("StreamGrasps", timeout, &message, |channel, request| async move {
                GraspServiceClient::new(channel).stream_grasps(request).await
            })
            .await?;
        Ok(GraspStream(messages))
    }
}
