//! The rules that refuse pages, and that tell browsers which they may let call.

use std::{sync::Arc, time::Duration};

use http::{HeaderName, HeaderValue, Method, StatusCode, header};
use tower_http::cors::{AllowOrigin, CorsLayer};

use super::{
    WebOrigins,
    refusal::{RefusalLayer, refusal},
};

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
pub(crate) fn refuse_origins(origins: &Arc<WebOrigins>) -> RefusalLayer {
    let origins = Arc::clone(origins);
    RefusalLayer::new(move |request| {
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
