//! The body of a request, bounded so that only admitted calls take more memory than small messages do.

use std::{
    pin::Pin,
    task::{Context, Poll},
};

use bytes::Buf;
use http_body::{Body, Frame, SizeHint};
use tonic::Status;

use crate::error::ServiceError;

/// A body of a limited number of bytes. A longer one ends with an error.
#[derive(Debug)]
pub(crate) struct RequestBody<B> {
    inner: B,
    limit: usize,
    received: usize,
}

impl<B> RequestBody<B> {
    /// The body of a call that may send so many bytes.
    pub(super) fn new(inner: B, limit: usize) -> Self {
        Self {
            inner,
            limit,
            received: 0,
        }
    }
}

impl<B> Body for RequestBody<B>
where
    B: Body + Unpin,
    B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    type Data = B::Data;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<B::Data>, Status>>> {
        let polled = Pin::new(&mut self.inner).poll_frame(cx);
        if let Poll::Ready(Some(Ok(frame))) = &polled {
            self.received += frame.data_ref().map_or(0, Buf::remaining);
            if self.received > self.limit {
                return Poll::Ready(Some(Err(
                    ServiceError::MessageTooLarge { limit: self.limit }.into()
                )));
            }
        }
        polled.map_err(|error| Status::from_error(error.into()))
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}
