//! Layers that refuse requests which no service may see, and that tell browsers which pages they may let call.

use std::{fmt, sync::Arc, time::Duration};

use http::{HeaderName, HeaderValue, Method, Request, Response, StatusCode, header, request::Parts};
use tonic::body::Body;
use tower_http::cors::{AllowOrigin, CorsLayer};

use super::WebOrigins;
use crate::middleware::{Answer, Around, Middleware};

/// How long a browser may remember what it may send; the longest that browsers accept.
const REMEMBERED: Duration = Duration::from_hours(2);

/// Headers of requests that pages may set: those of gRPC-Web's clients, and of the Connect protocol's, so that they can read why they
/// are refused.
const REQUEST_HEADERS: [HeaderName; 6] = [
    HeaderName::from_static("connect-protocol-version"),
    HeaderName::from_static("connect-timeout-ms"),
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
pub(crate) fn refuse_origins(origins: &Arc<WebOrigins>) -> Around<Refusal> {
    let origins = Arc::clone(origins);
    refuse(move |request| {
        // Only browsers send it.
        let origin = request.headers.get(header::ORIGIN)?;
        let text = "this page's origin may not call; see the server's setting web_origins\n";
        (!is_allowed(&origins, origin)).then(|| {
            refusal(
                StatusCode::FORBIDDEN,
                "text/plain; charset=utf-8",
                text.to_owned(),
            )
        })
    })
}

/// What a request is refused with, if it is.
type Check = Arc<dyn Fn(&mut Parts) -> Option<Response<Body>> + Send + Sync>;

/// Answers what a check refuses, and passes everything else on.
#[derive(Clone)]
pub(crate) struct Refusal(Check);

impl fmt::Debug for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Refusal")
    }
}

/// Refuses by a check of a request's headers, which may set them right.
pub(super) fn refuse(
    check: impl Fn(&mut Parts) -> Option<Response<Body>> + Send + Sync + 'static,
) -> Around<Refusal> {
    Around(Refusal(Arc::new(check)))
}

impl<B> Middleware<B> for Refusal {
    fn handle<E, F>(&self, request: Request<B>, next: impl FnOnce(Request<B>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static,
    {
        let (mut parts, body) = request.into_parts();
        match (self.0)(&mut parts) {
            Some(answer) => {
                tracing::debug!(status = %answer.status(), path = parts.uri.path(), "refused a request");
                Box::pin(std::future::ready(Ok(answer)))
            }
            None => Box::pin(next(Request::from_parts(parts, body))),
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
