//! The layers that refuse pages, and that tell browsers which they may let call.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use http::{HeaderName, HeaderValue, Method, Request, Response, StatusCode, header};
use tonic::body::Body;
use tower::{Layer, Service};
use tower_http::cors::{AllowOrigin, CorsLayer};

use super::WebOrigins;

/// How long a browser may remember what it may send; the longest that browsers accept.
const REMEMBERED: Duration = Duration::from_hours(2);

/// Headers of requests that pages may set: those of gRPC-Web's clients.
const REQUEST_HEADERS: [HeaderName; 4] = [
    header::CONTENT_TYPE,
    HeaderName::from_static("grpc-timeout"),
    HeaderName::from_static("x-grpc-web"),
    HeaderName::from_static("x-user-agent"),
];

/// Headers of answers that pages may read: the status of an answer without messages.
const ANSWER_HEADERS: [HeaderName; 3] = [
    HeaderName::from_static("grpc-message"),
    HeaderName::from_static("grpc-status"),
    HeaderName::from_static("grpc-status-details-bin"),
];

/// Tells browsers which pages may call and what they may send and read (Fetch standard, 3.2). Answers preflight requests.
pub(crate) fn cors(origins: &Arc<WebOrigins>) -> CorsLayer {
    let origins = Arc::clone(origins);
    let allowed = AllowOrigin::predicate(move |origin, _| is_allowed(&origins, origin));
    CorsLayer::new()
        .allow_origin(allowed)
        .allow_methods([Method::POST])
        .allow_headers(REQUEST_HEADERS)
        .expose_headers(ANSWER_HEADERS)
        .max_age(REMEMBERED)
}

fn is_allowed(origins: &WebOrigins, origin: &HeaderValue) -> bool {
    origin.to_str().is_ok_and(|origin| origins.allow(origin))
}

/// Refuses requests of pages whose origin may not call.
#[derive(Clone, Debug)]
pub(crate) struct OriginLayer(pub Arc<WebOrigins>);

impl<S> Layer<S> for OriginLayer {
    type Service = OriginService<S>;

    fn layer(&self, inner: S) -> Self::Service {
        OriginService {
            inner,
            origins: Arc::clone(&self.0),
        }
    }
}

/// A service in its [`OriginLayer`].
#[derive(Clone, Debug)]
pub(crate) struct OriginService<S> {
    inner: S,
    origins: Arc<WebOrigins>,
}

impl<S, B> Service<Request<B>> for OriginService<S>
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
        // Only browsers send it.
        match request.headers().get(header::ORIGIN) {
            Some(origin) if !is_allowed(&self.origins, origin) => {
                tracing::debug!(?origin, "refused a page whose origin may not call");
                let mut answer = Response::new(Body::new(
                    "this page's origin may not call; see the server's setting web_origins\n".to_owned(),
                ));
                *answer.status_mut() = StatusCode::FORBIDDEN;
                let text = HeaderValue::from_static("text/plain; charset=utf-8");
                answer.headers_mut().insert(header::CONTENT_TYPE, text);
                Box::pin(std::future::ready(Ok(answer)))
            }
            _ => Box::pin(self.inner.call(request)),
        }
    }
}
