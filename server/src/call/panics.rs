//! Panics while a call is answered end the call, with a status, and nothing else.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    task::{Context, Poll},
};

use futures_util::FutureExt as _;
use http::{HeaderMap, Response};
use http_body::Frame;
use tonic::{Status, body::Body};

use crate::{
    error::ServiceError,
    faults::{FaultPoint, Faults},
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
};

/// The answer of a future that may panic, and its body, which may panic later. The transport would reset the stream, or close a
/// connection of HTTP/1.1.
pub(super) async fn contained<E>(
    answer: impl Future<Output = Result<Response<Body>, E>>,
    faults: Faults,
) -> Result<Response<Body>, E> {
    let answer = async {
        faults.at(FaultPoint::Handler);
        answer.await
    };
    match AssertUnwindSafe(answer).catch_unwind().await {
        Ok(answer) => Ok(answer?.map(|body| filtered(body, PanicFilter(faults)))),
        Err(_) => Ok(Status::from(ServiceError::Panicked).into_http()),
    }
}

/// Ends a body that panics with trailers.
struct PanicFilter(Faults);

impl FrameFilter for PanicFilter {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        let polled = catch_unwind(AssertUnwindSafe(|| {
            self.0.at(FaultPoint::Body);
            next_frame(inner, cx)
        }));
        polled.unwrap_or_else(|_| {
            *inner = Body::empty();
            let mut trailers = HeaderMap::new();
            let added = Status::from(ServiceError::Panicked).add_header(&mut trailers);
            Poll::Ready(Some(added.map(|()| Frame::trailers(trailers))))
        })
    }
}
