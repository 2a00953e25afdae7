//! The body of an answer, which keeps its call in flight until all of it is handed to the transport.

use std::{
    pin::Pin,
    task::{Context, Poll},
};

use http::HeaderMap;
use http_body::{Body, Frame, SizeHint};
use tonic::Code;

use super::{answer_delay::AnswerDelay, log_line::LogLine};

/// Trailer, or header of an answer without a message, with the status.
const STATUS: &str = "grpc-status";

/// The status in headers or trailers; none if they have none.
pub(super) fn code_in(headers: &HeaderMap) -> Option<Code> {
    headers
        .get(STATUS)
        .map(|status| Code::from_bytes(status.as_bytes()))
}

/// A body whose end is the end of its call.
#[derive(Debug)]
pub(crate) struct AnswerBody<B> {
    inner: B,
    line: LogLine,
    delay: Option<AnswerDelay>,
}

impl<B> AnswerBody<B> {
    /// The body of the call with this line. The delay goes on for streams, whose search may end after their headers.
    pub(super) fn new(inner: B, line: LogLine, delay: Option<AnswerDelay>) -> Self {
        Self { inner, line, delay }
    }
}

impl<B: Body + Unpin> Body for AnswerBody<B> {
    type Data = B::Data;
    type Error = B::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<B::Data>, B::Error>>> {
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
