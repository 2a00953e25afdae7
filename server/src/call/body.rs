//! The body of an answer, which keeps its call in flight until all of it is handed to the transport, and how long that takes
//! after the call's search.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::{Duration, Instant},
};

use bytes::Bytes;
use http::HeaderMap;
use http_body::{Frame, SizeHint};
use tonic::{Code, Status, body::Body};

use super::{SearchEnd, log_line::LogLine};
use crate::budget::DeadlineReserve;

/// Trailer, or header of an answer without a message, with the status.
const STATUS: &str = "grpc-status";

/// The status in headers or trailers; `None` if they have none.
pub(super) fn code_in(headers: &HeaderMap) -> Option<Code> {
    headers
        .get(STATUS)
        .map(|status| Code::from_bytes(status.as_bytes()))
}

/// A body whose end is the end of its call.
#[derive(Debug)]
pub(super) struct AnswerBody {
    inner: Body,
    line: LogLine,
    delay: Option<AnswerDelay>,
}

impl AnswerBody {
    /// The body of the call with this line. The delay goes on for streams, whose search may end after their headers.
    pub(super) fn of(inner: Body, line: LogLine, delay: Option<AnswerDelay>) -> Body {
        Body::new(Self { inner, line, delay })
    }
}

impl http_body::Body for AnswerBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if let Some(delay) = &mut self.delay {
            delay.asked();
        }
        let polled = Pin::new(&mut self.inner).poll_frame(cx);
        if polled.is_ready()
            && let Some(delay) = &mut self.delay
        {
            delay.answered();
        }
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(code) = frame.trailers_ref().and_then(code_in)
        {
            self.line.set_code(code);
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

/// Measures for how long the transport waits for an answer after the end of the call's search. As long as it does not ask, because the
/// client does not read, nothing counts. If the call is dropped while it waits, which is what a client does at its deadline, the
/// answer would have taken at least until then.
#[derive(Debug)]
pub(super) struct AnswerDelay {
    search_end: Arc<SearchEnd>,
    reserve: Arc<DeadlineReserve>,
    transport: Transport,
    /// For how long it has waited for other parts of the answer, from the end of the search on.
    waited: Duration,
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

impl AnswerDelay {
    /// The delay of a call that has arrived.
    pub(super) fn new(search_end: Arc<SearchEnd>, reserve: Arc<DeadlineReserve>) -> Self {
        Self {
            search_end,
            reserve,
            transport: Transport::Waits,
            waited: Duration::ZERO,
        }
    }

    /// The transport asks for the next part of the answer.
    pub(super) fn asked(&mut self) {
        if let Transport::Idles = self.transport {
            self.transport = Transport::WaitsSince(Instant::now());
        }
    }

    /// It has the part that it requested.
    pub(super) fn answered(&mut self) {
        let transport = std::mem::replace(&mut self.transport, Transport::Idles);
        let Some(&due) = self.search_end.due.get() else {
            return;
        };
        let end = self
            .search_end
            .actual
            .get()
            .map_or(due, |&actual| actual.min(due));
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

impl Drop for AnswerDelay {
    fn drop(&mut self) {
        self.answered();
    }
}
