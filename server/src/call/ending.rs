//! Streams of services that do not know of the shutdown: health and reflection. Without an end, they would hold it up.

use std::{
    pin::Pin,
    task::{Context, Poll},
};

use http::HeaderMap;
use http_body::Frame;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};
use tonic::{Status, body::Body};

use crate::{
    error::ServiceError,
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
};

/// The body, which ends with the status of a shutdown once that has begun and nothing more is ready.
pub(super) fn ended_by(inner: Body, shutdown: CancellationToken) -> Body {
    let ending = ShutdownFilter {
        shutdown: Box::pin(shutdown.cancelled_owned()),
        has_ended: false,
    };
    filtered(inner, ending)
}

struct ShutdownFilter {
    shutdown: Pin<Box<WaitForCancellationFutureOwned>>,
    has_ended: bool,
}

impl FrameFilter for ShutdownFilter {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        if self.has_ended {
            return Poll::Ready(None);
        }
        let polled = next_frame(inner, cx);
        if polled.is_ready() || self.shutdown.as_mut().poll(cx).is_pending() {
            return polled;
        }
        self.has_ended = true;
        let mut trailers = HeaderMap::new();
        // Its message is ASCII.
        let _ = Status::from(ServiceError::ShuttingDown).add_header(&mut trailers);
        Poll::Ready(Some(Ok(Frame::trailers(trailers))))
    }
}
