//! The layer that answers requests which no service may see.

use std::{
    fmt,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use http::{HeaderValue, Request, Response, StatusCode, header, request::Parts};
use tonic::body::Body;
use tower::{Layer, Service};

/// What a request is refused with, if it is.
type Check = Arc<dyn Fn(&mut Parts) -> Option<Response<Body>> + Send + Sync>;

/// Answers what a check refuses, and passes everything else on.
#[derive(Clone)]
pub(crate) struct RefusalLayer(Check);

impl RefusalLayer {
    /// Refuses by a check of a request's headers, which may set them right.
    pub(super) fn new(check: impl Fn(&mut Parts) -> Option<Response<Body>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(check))
    }
}

impl fmt::Debug for RefusalLayer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("RefusalLayer")
    }
}

impl<S> Layer<S> for RefusalLayer {
    type Service = RefusalService<S>;

    fn layer(&self, inner: S) -> Self::Service {
        RefusalService {
            inner,
            layer: self.clone(),
        }
    }
}

/// A service in its [`RefusalLayer`].
#[derive(Clone, Debug)]
pub(crate) struct RefusalService<S> {
    inner: S,
    layer: RefusalLayer,
}

impl<S, B> Service<Request<B>> for RefusalService<S>
where
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Response<Body>, S::Error>> + Send>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(cx)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let (mut parts, body) = request.into_parts();
        match (self.layer.0)(&mut parts) {
            Some(answer) => {
                tracing::debug!(status = %answer.status(), path = parts.uri.path(), "refused a request");
                Box::pin(std::future::ready(Ok(answer)))
            }
            None => Box::pin(self.inner.call(Request::from_parts(parts, body))),
        }
    }
}

/// An answer for people to read.
pub(super) fn refusal(status: StatusCode, content_type: &'static str, body: String) -> Response<Body> {
    let mut answer = Response::new(Body::new(body));
    *answer.status_mut() = status;
    let content_type = HeaderValue::from_static(content_type);
    answer.headers_mut().insert(header::CONTENT_TYPE, content_type);
    answer
}
