//! Layers of services, each written as a function of a request and the inner service, filters of bodies, and a header that several
//! layers read.

use std::{
    future::Future,
    pin::Pin,
    task::{Context, Poll},
};

use bytes::Bytes;
use http::{HeaderValue, Request, Response};
use http_body::{Body as _, Frame};
use tonic::{Status, body::Body};
use tower::{Layer, Service};

/// True if a header lists gzip among the codings that its sender takes (RFC 9110, 12.5.3).
pub(crate) fn is_gzip_among(accepted: &HeaderValue) -> bool {
    let codings = accepted.to_str().unwrap_or_default().split(',');
    codings.map(str::trim).any(|coding| {
        let (name, weight) = coding.split_once(';').unwrap_or((coding, "q=1"));
        let weight = weight.trim().trim_start_matches("q=").parse::<f32>();
        matches!(name.trim(), "gzip" | "*") && weight.is_ok_and(|weight| weight > 0.0)
    })
}

pub(crate) type Answer<E> = Pin<Box<dyn Future<Output = Result<Response<Body>, E>> + Send>>;

/// A layer's handling of requests.
pub(crate) trait Middleware<B>: Clone {
    /// Answers a request; `next` passes it to the services inside.
    fn handle<E, F>(&self, request: Request<B>, next: impl FnOnce(Request<B>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static;
}

#[derive(Clone, Debug)]
pub(crate) struct Around<M>(pub(crate) M);

impl<M: Clone, S> Layer<S> for Around<M> {
    type Service = AroundService<M, S>;

    fn layer(&self, inner: S) -> Self::Service {
        AroundService {
            middleware: self.0.clone(),
            inner,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct AroundService<M, S> {
    middleware: M,
    inner: S,
}

impl<M, S, B> Service<Request<B>> for AroundService<M, S>
where
    M: Middleware<B>,
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Answer<S::Error>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let Self { middleware, inner } = self;
        middleware.handle(request, |request| inner.call(request))
    }
}

/// A frame of a body, once it is there; `None` at the end.
pub(crate) type PolledFrame = Poll<Option<Result<Frame<Bytes>, Status>>>;

/// Watches or changes the frames of a body.
pub(crate) trait FrameFilter: Send + Unpin + 'static {
    /// Polls the next frame, of the inner body or of those kept.
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame;

    /// True if no kept frame follows the last frame of the inner body.
    fn is_empty(&self) -> bool {
        true
    }
}

/// The body with its frames filtered.
pub(crate) fn filtered(inner: Body, filter: impl FrameFilter) -> Body {
    Body::new(FilteredBody { inner, filter })
}

struct FilteredBody<F> {
    inner: Body,
    filter: F,
}

impl<F: FrameFilter> http_body::Body for FilteredBody<F> {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> PolledFrame {
        let Self { inner, filter } = &mut *self;
        filter.poll(inner, cx)
    }

    fn is_end_stream(&self) -> bool {
        self.filter.is_empty() && self.inner.is_end_stream()
    }
}

pub(crate) fn next_frame(body: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
    Pin::new(body).poll_frame(cx)
}
