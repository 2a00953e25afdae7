//! `GraspService.StreamGrasps`.

use std::{sync::Arc, time::Duration};

use grasp_proto::v1;
use tokio::time::Instant;

use super::{
    GraspHandler,
    grasp_service::{ReadySearch, summary},
    streaming::{MessageSender, Messages, messages},
};
use crate::{
    call::CallContext,
    error::ServiceError,
    search::{Answered, Found, Stream, Wanted},
    validate::{Sent, StreamQuery, stream_query},
};

/// Where the grasps of a stream go.
struct GraspSender<'a> {
    stream: &'a Stream,
    sender: MessageSender<v1::FindGraspResponse>,
    has_sent: bool,
}

impl GraspHandler {
    /// Searches as long as the stream is read, and sends what is found.
    pub(super) async fn stream(
        &self,
        request: v1::StreamGraspsRequest,
        call: &CallContext,
    ) -> Result<Messages<v1::FindGraspResponse>, ServiceError> {
        let shared = &self.shared;
        let StreamQuery { find, sent } = stream_query(request, (&shared.default_rig, &shared.rigs), |id| {
            shared.objects.contains(id)
        })?;
        let ready = self.ready(find, call).await?;
        call.search_is_due(ready.job.due());
        let (shared, call) = (Arc::clone(shared), call.clone());
        Ok(messages(shared.shutdown.clone(), |sender| async move {
            let ReadySearch {
                admission,
                job,
                _held,
                ..
            } = ready;
            let stream = Stream::new(match sent {
                Sent::Better { .. } => Wanted::Better,
                Sent::Alternatives { count, by } => Wanted::Alternatives { most: count, by },
            });
            let mut sending = GraspSender {
                stream: &stream,
                sender,
                has_sent: false,
            };
            let search = async {
                let answered = stream.run(job, &shared.executor, admission).await?;
                call.search_ended(answered.ended);
                Ok::<_, ServiceError>(answered)
            };
            let answered = match sent {
                Sent::Better { interval } => sending.better(search, interval).await?,
                Sent::Alternatives { .. } => {
                    let answered = search.await?;
                    for found in stream.take_alternatives() {
                        sending.send(found).await?;
                    }
                    answered
                }
            };
            call.log_search(summary(&answered.response));
            sending.end(answered).await
        }))
    }
}

impl GraspSender<'_> {
    /// Sends each better grasp, but no two within the interval, until the search ends; then the best one.
    async fn better(
        &mut self,
        search: impl Future<Output = Result<Answered, ServiceError>>,
        interval: Duration,
    ) -> Result<Answered, ServiceError> {
        let mut search = std::pin::pin!(search);
        let mut next = Instant::now();
        let answered = loop {
            let due = async {
                self.stream.news().await;
                tokio::time::sleep_until(next).await;
            };
            tokio::select! {
                biased;
                answered = &mut search => break answered?,
                () = due => {}
            }
            if let Some(found) = self.stream.take_better() {
                next = Instant::now() + interval;
                self.send(found).await?;
            }
        };
        if let Some(found) = self.stream.take_better() {
            self.send(found).await?;
        }
        Ok(answered)
    }

    async fn send(&mut self, found: Found) -> Result<(), ServiceError> {
        let message = self.stream.message(found).await?;
        self.has_sent = true;
        self.sender.send(message).await
    }

    /// Sends how the search ended.
    async fn end(self, answered: Answered) -> Result<(), ServiceError> {
        let mut last = v1::FindGraspResponse {
            grasps: Vec::new(),
            ..answered.response
        };
        if self.has_sent {
            // An answer that could not wait for the end of the search may know less than was sent.
            last.set_outcome(v1::Outcome::Found);
        }
        self.sender.send(last).await
    }
}
