//! The answer of a call, which keeps it in flight until all of it is handed to the transport; its log line, and how long the transport
//! waits for it after the call's search.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::{Duration, Instant},
};

use bytes::Bytes;
use http::{HeaderMap, Response};
use http_body::{Frame, SizeHint};
use tokio::sync::watch;
use tonic::{Code, Status, body::Body};

use super::CallContext;
use crate::budget::DeadlineReserve;

/// Trailer, or header of an answer without a message, with the status.
pub(super) const STATUS: &str = "grpc-status";

/// Services whose calls are logged at level info. Probes and tools call the others.
const LOGGED_PACKAGE: &str = "/grasp.v1.";

/// Largest number of logged characters of a method's path.
const MAX_LOGGED_METHOD: usize = 96;

/// The status in headers or trailers, if they have one.
pub(super) fn code_in(headers: &HeaderMap) -> Option<Code> {
    headers
        .get(STATUS)
        .map(|status| Code::from_bytes(status.as_bytes()))
}

/// A call from its arrival to the end of its answer, when it is logged.
///
/// It measures for how long the transport waits for parts of the answer after the end of the call's search. As long as the transport does
/// not ask, because the client does not read, nothing counts. If the call is dropped while it waits, which is what a client does at its
/// deadline, the answer would have taken at least until then.
#[derive(Debug)]
pub(super) struct OpenCall {
    method: String,
    context: CallContext,
    /// `None` is logged as cancelled.
    code: Option<Code>,
    reserve: Arc<DeadlineReserve>,
    transport: Transport,
    /// For how long the transport has waited for other parts of the answer, from the end of the search on.
    waited: Duration,
    /// Counts the call.
    _in_flight: watch::Receiver<()>,
}

/// What the transport does.
#[derive(Clone, Copy, Debug)]
enum Transport {
    /// It waits for the first part, as it has since the call arrived.
    Waits,
    /// It has requested another part.
    WaitsSince(Instant),
    /// It has all that it requested.
    Idles,
}

impl OpenCall {
    /// A call that has arrived; it counts as a receiver of `in_flight`.
    pub(super) fn new(
        path: &str,
        context: CallContext,
        in_flight: &watch::Sender<()>,
        reserve: &Arc<DeadlineReserve>,
    ) -> Self {
        Self {
            method: path.chars().take(MAX_LOGGED_METHOD).collect(),
            context,
            code: None,
            reserve: Arc::clone(reserve),
            transport: Transport::Waits,
            waited: Duration::ZERO,
            _in_flight: in_flight.subscribe(),
        }
    }

    /// The call with this status.
    pub(super) fn fail(&mut self, code: Code) {
        self.code = Some(code);
    }

    /// The answer, with whose body the call ends.
    pub(super) fn answer(mut self, answer: Response<Body>) -> Response<Body> {
        self.code = code_in(answer.headers()).or(self.code);
        answer.map(|inner| Body::new(AnswerBody { inner, call: self }))
    }

    /// The transport asks for the next part of the answer.
    fn asked(&mut self) {
        if let Transport::Idles = self.transport {
            self.transport = Transport::WaitsSince(Instant::now());
        }
    }

    /// The transport has the part that it requested.
    pub(super) fn answered(&mut self) {
        let transport = std::mem::replace(&mut self.transport, Transport::Idles);
        let record = &self.context.record;
        let Some(&due) = record.due.get() else { return };
        let end = record.ended.get().map_or(due, |&ended| ended.min(due));
        let start = match transport {
            Transport::Waits => end,
            Transport::WaitsSince(asked) => end.max(asked),
            Transport::Idles => return,
        };
        let now = Instant::now();
        self.waited += now.saturating_duration_since(start);
        self.reserve.record(self.waited, now);
    }
}

impl Drop for OpenCall {
    fn drop(&mut self) {
        self.answered();
        let record = &self.context.record;
        let search = record.search.get();
        let status = grpc_name(self.code.unwrap_or(Code::Cancelled));
        let total_us = micros(self.context.arrived.elapsed());
        macro_rules! log {
            ($level:ident) => {
                tracing::$level!(
                    method = %self.method,
                    object = record.object.get(),
                    outcome = search.map(|s| s.outcome),
                    attempts = search.map(|s| s.attempts),
                    search_us = search.map(|s| micros(s.time)),
                    reserve_us = record.reserve.get().copied().map(micros),
                    total_us,
                    %status,
                    "call"
                )
            };
        }
        if self.method.starts_with(LOGGED_PACKAGE) {
            log!(info);
        } else {
            log!(debug);
        }
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

/// A code in the spelling of gRPC: `INVALID_ARGUMENT`.
fn grpc_name(code: Code) -> String {
    let mut name = String::new();
    for character in format!("{code:?}").chars() {
        if !name.is_empty() && character.is_ascii_uppercase() {
            name.push('_');
        }
        name.push(character.to_ascii_uppercase());
    }
    name
}

/// A body whose end is the end of its call.
#[derive(Debug)]
struct AnswerBody {
    inner: Body,
    call: OpenCall,
}

impl http_body::Body for AnswerBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        self.call.asked();
        let polled = Pin::new(&mut self.inner).poll_frame(cx);
        if polled.is_ready() {
            self.call.answered();
        }
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(code) = frame.trailers_ref().and_then(code_in)
        {
            self.call.code = Some(code);
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_codes_are_spelled_as_in_grpc() {
        assert_eq!(grpc_name(Code::InvalidArgument), "INVALID_ARGUMENT");
        assert_eq!(grpc_name(Code::Ok), "OK");
    }
}
