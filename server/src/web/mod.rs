//! Pages in browsers: who may call, how browsers learn it, and the refusal of other protocols than gRPC, gRPC-Web and Connect.
//!
//! gRPC-Web itself is a layer of tonic-web, and Connect the module `connect`. A browser names the page's origin with every call. Pages
//! of other origins than those of the configuration are refused here: cross-origin rules alone would only keep them from reading the
//! answer, and not even that once their own host name resolves to this server (DNS rebinding).

mod origins;

use std::{sync::Arc, time::Duration};

use http::{
    HeaderMap, HeaderName, HeaderValue, Method, Request, Response, StatusCode, Version, header,
    request::Parts,
};
use serde_json::json;
use tonic::body::Body;
use tower_http::cors::{AllowOrigin, CorsLayer};

use crate::{
    middleware::{Answer, Around, Middleware},
    wire::quoted,
};
pub use origins::WebOrigins;
pub(crate) use origins::{NEEDED_ORIGINS, parse_origins};

/// How long a browser may cache the rules; the longest that browsers accept.
const REMEMBERED: Duration = Duration::from_hours(2);

/// Headers of requests that pages may set: tokens, and those of the clients of gRPC-Web and Connect.
const REQUEST_HEADERS: [HeaderName; 12] = [
    header::AUTHORIZATION,
    HeaderName::from_static("connect-accept-encoding"),
    HeaderName::from_static("connect-content-encoding"),
    HeaderName::from_static("connect-protocol-version"),
    HeaderName::from_static("connect-timeout-ms"),
    header::CONTENT_ENCODING,
    header::CONTENT_TYPE,
    HeaderName::from_static("grpc-timeout"),
    HeaderName::from_static("traceparent"),
    HeaderName::from_static("x-grpc-web"),
    HeaderName::from_static("x-request-id"),
    HeaderName::from_static("x-user-agent"),
];

/// Headers of answers that pages may read: the status of an answer without messages, and how messages are packed.
const ANSWER_HEADERS: [HeaderName; 7] = [
    HeaderName::from_static("connect-content-encoding"),
    header::CONTENT_ENCODING,
    HeaderName::from_static("grpc-message"),
    HeaderName::from_static("grpc-status"),
    HeaderName::from_static("grpc-status-details-bin"),
    HeaderName::from_static("trailer-grpc-retry-pushback-ms"),
    HeaderName::from_static("x-request-id"),
];

const GRPC: [&str; 2] = ["application/grpc", "application/grpc+proto"];

const GRPC_WEB: [&str; 4] = [
    "application/grpc-web",
    "application/grpc-web+proto",
    "application/grpc-web-text",
    "application/grpc-web-text+proto",
];

const CONNECT: [&str; 4] = [
    "application/json",
    "application/proto",
    "application/connect+json",
    "application/connect+proto",
];

const CONNECT_VERSION: &str = "connect-protocol-version";

/// Type of answers for people.
const PLAIN_TEXT: &str = "text/plain; charset=utf-8";

/// Tells browsers which pages may call, send and read (Fetch standard, 3.2). Answers preflight requests.
pub(crate) fn cors(origins: &Arc<WebOrigins>) -> CorsLayer {
    let origins = Arc::clone(origins);
    let allowed = AllowOrigin::predicate(move |origin, _| is_allowed(&origins, origin));
    CorsLayer::new()
        .allow_origin(allowed)
        .allow_methods([Method::POST])
        .allow_headers(REQUEST_HEADERS)
        .expose_headers(ANSWER_HEADERS)
        // Pages of other networks than the server's, whose browsers ask first (Private Network Access). Those that may not call are
        // refused before.
        .allow_private_network(true)
        .max_age(REMEMBERED)
}

fn is_allowed(origins: &WebOrigins, origin: &HeaderValue) -> bool {
    origin.to_str().is_ok_and(|origin| origins.allow(origin))
}

pub(crate) fn refuse_origins(origins: &Arc<WebOrigins>) -> Around<Refusal> {
    let origins = Arc::clone(origins);
    refuse(move |request| {
        // Only browsers send it.
        let origin = request.headers.get(header::ORIGIN)?;
        let text = "this page's origin may not call; see the server's setting web_origins\n";
        (!is_allowed(&origins, origin)).then(|| refusal(StatusCode::FORBIDDEN, PLAIN_TEXT, text.to_owned()))
    })
}

/// Refuses requests by a check of their headers, which may also correct them.
#[derive(Clone)]
pub(crate) struct Refusal(Arc<Check>);

/// The answer with which a request is refused, if it is.
type Check = dyn Fn(&mut Parts) -> Option<Response<Body>> + Send + Sync;

fn refuse(check: impl Fn(&mut Parts) -> Option<Response<Body>> + Send + Sync + 'static) -> Around<Refusal> {
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

fn refusal(status: StatusCode, content_type: &'static str, body: String) -> Response<Body> {
    let mut answer = Response::new(Body::new(body));
    *answer.status_mut() = status;
    let content_type = HeaderValue::from_static(content_type);
    answer.headers_mut().insert(header::CONTENT_TYPE, content_type);
    answer
}

/// Refuses requests that are neither gRPC over HTTP/2 nor Connect nor, if browsers are served, gRPC-Web.
pub(crate) fn refuse_protocols(is_web: bool) -> Around<Refusal> {
    refuse(move |request| {
        let (status, cause) = wrong(request, is_web)?;
        let mut answer = if is_connect(&request.headers) {
            // In the form of that protocol, whose clients show it.
            let error = json!({"code": "unimplemented", "message": cause});
            refusal(status, "application/json", format!("{error}\n"))
        } else {
            refusal(status, PLAIN_TEXT, format!("{cause}\n"))
        };
        if status == StatusCode::METHOD_NOT_ALLOWED {
            let post = HeaderValue::from_static("POST");
            answer.headers_mut().insert(header::ALLOW, post);
        }
        Some(answer)
    })
}

/// Why a request is refused: the status of its answer, and the cause.
fn wrong(request: &mut Parts, is_web: bool) -> Option<(StatusCode, String)> {
    let spoken = if is_web {
        "this server speaks gRPC over HTTP/2, gRPC-Web, and Connect"
    } else {
        "this server speaks gRPC over HTTP/2, and Connect, but not gRPC-Web because its setting web_origins is none"
    };
    if request.method != Method::POST {
        let method = quoted(request.method.as_str());
        let cause = format!("{spoken}; all calls have the method POST, and this request {method}");
        return Some((StatusCode::METHOD_NOT_ALLOWED, cause));
    }
    let given = request.headers.get(header::CONTENT_TYPE);
    let given = given.map_or("", |value| value.to_str().unwrap_or("?")).to_owned();
    let media = media_type(&given).to_ascii_lowercase();
    let connect = CONNECT.iter().find(|known| **known == media);
    let web = GRPC_WEB.iter().find(|known| **known == media);
    let is_grpc = GRPC.contains(&media.as_str());
    match connect.or(web) {
        Some(known) if is_web || connect.is_some() => {
            let known = HeaderValue::from_static(known);
            request.headers.insert(header::CONTENT_TYPE, known);
            None
        }
        Some(_) => Some((StatusCode::FORBIDDEN, spoken.to_owned())),
        None if is_grpc && request.version == Version::HTTP_2 => None,
        None if is_grpc => {
            let cause = format!("{spoken}; this request is gRPC over {:?}", request.version);
            Some((StatusCode::BAD_REQUEST, cause))
        }
        None => {
            let given = if given.is_empty() {
                "missing".to_owned()
            } else {
                format!("is {}", quoted(&given))
            };
            let mut right = vec![format!("over Connect {}", CONNECT.join(" or "))];
            right.extend(is_web.then(|| format!("over gRPC-Web {}", GRPC_WEB.join(" or "))));
            right.push(format!("over gRPC {}", GRPC.join(" or ")));
            let cause = format!("{spoken}; content-type {given}; it must be {}", right.join(", "));
            Some((StatusCode::UNSUPPORTED_MEDIA_TYPE, cause))
        }
    }
}

/// A content type without parameters, which mean nothing here.
fn media_type(content_type: &str) -> &str {
    content_type.split(';').next().unwrap_or_default().trim()
}

fn is_connect(headers: &HeaderMap) -> bool {
    let given = headers
        .get(header::CONTENT_TYPE)
        .and_then(|value| value.to_str().ok());
    headers.contains_key(CONNECT_VERSION) || CONNECT.contains(&media_type(given.unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The content type of a request that passes; the status and cause otherwise.
    fn checked(
        method: Method,
        version: Version,
        content_type: &str,
        is_web: bool,
    ) -> Result<String, (StatusCode, String)> {
        let request = Request::builder().method(method).version(version);
        let request = request.header(header::CONTENT_TYPE, content_type).body(());
        let (mut parts, ()) = request.unwrap().into_parts();
        match wrong(&mut parts, is_web) {
            Some(wrong) => Err(wrong),
            None => Ok(parts.headers[header::CONTENT_TYPE].to_str().unwrap().to_owned()),
        }
    }

    #[test]
    fn only_known_protocols_pass_and_others_learn_the_cause() {
        let (h1, h2) = (Version::HTTP_11, Version::HTTP_2);
        for (version, given, after) in [
            (h2, "application/grpc", "application/grpc"),
            (h2, "application/grpc+proto", "application/grpc+proto"),
            (h2, "application/grpc-web+proto", "application/grpc-web+proto"),
            (h1, "application/grpc-web; charset=utf-8", "application/grpc-web"),
            (h1, "Application/gRPC-Web-Text", "application/grpc-web-text"),
            (h1, "application/json;charset=UTF-8", "application/json"),
            (h2, "application/connect+proto", "application/connect+proto"),
        ] {
            let passed = checked(Method::POST, version, given, true);
            assert_eq!(passed.as_deref(), Ok(after), "{given}");
        }
        let (web, json) = ("application/grpc-web+proto", "application/grpc-web+json");
        let (post, get, long) = (Method::POST, Method::GET, "x".repeat(9000));
        for (method, version, content_type, status, causes) in [
            (&post, h1, "application/grpc", 400, ["HTTP/2", "HTTP/1.1"]),
            (&post, h1, json, 415, [json, web]),
            (
                &post,
                h2,
                "application/grpc+json",
                415,
                ["application/grpc+json", web],
            ),
            (&post, h1, "", 415, ["missing", web]),
            (
                &post,
                h1,
                "application/x-www-form-urlencoded",
                415,
                ["form", "application/json"],
            ),
            (&post, h2, &long, 415, ["xxx", web]),
            (&get, h1, "application/grpc-web", 405, ["POST", "GET"]),
            (&get, h2, "application/grpc-web", 405, ["POST", "GET"]),
        ] {
            let wrong = checked(method.clone(), version, content_type, true).unwrap_err();
            assert_eq!(wrong.0, status, "{}", wrong.1);
            assert!(causes.iter().all(|cause| wrong.1.contains(cause)), "{}", wrong.1);
            assert!(wrong.1.len() < 700, "it is quoted in part");
        }
        let wrong = checked(Method::POST, h1, "application/grpc-web", false).unwrap_err();
        assert_eq!(wrong.0, StatusCode::FORBIDDEN);
        // Tools that are no browsers call without pages.
        checked(Method::POST, h1, "application/json", false).unwrap();
    }
}
