//! Refuses requests of other protocols with an answer that says which are spoken.

use http::{HeaderMap, HeaderValue, Method, StatusCode, Version, header, request::Parts};
use serde_json::json;

use super::layer::{Refusal, refusal, refuse};
use crate::middleware::Around;

/// Types of gRPC's messages.
const GRPC: [&str; 2] = ["application/grpc", "application/grpc+proto"];

/// Types of gRPC-Web's messages.
const GRPC_WEB: [&str; 4] = [
    "application/grpc-web",
    "application/grpc-web+proto",
    "application/grpc-web-text",
    "application/grpc-web-text+proto",
];

/// Types of messages of the Connect protocol.
const CONNECT: [&str; 4] = [
    "application/json",
    "application/proto",
    "application/connect+json",
    "application/connect+proto",
];

/// Header of requests of the Connect protocol.
const CONNECT_VERSION: &str = "connect-protocol-version";

/// Longest part of a header that an answer quotes, in characters.
const MAX_QUOTED: usize = 80;

/// Refuses what is neither gRPC over HTTP/2 nor, if browsers are served, gRPC-Web.
pub(crate) fn refuse_protocols(is_web: bool) -> Around<Refusal> {
    refuse(move |request| {
        let WrongRequest { status, cause } = wrong(request, is_web)?;
        let text = "text/plain; charset=utf-8";
        let mut answer = if is_connect(&request.headers) {
            // In the form of that protocol, whose clients show it.
            let error = json!({"code": "unimplemented", "message": cause});
            refusal(status, "application/json", format!("{error}\n"))
        } else {
            refusal(status, text, format!("{cause}\n"))
        };
        if status == StatusCode::METHOD_NOT_ALLOWED {
            let post = HeaderValue::from_static("POST");
            answer.headers_mut().insert(header::ALLOW, post);
        }
        Some(answer)
    })
}

/// What is wrong with a request.
#[derive(Debug)]
struct WrongRequest {
    status: StatusCode,
    cause: String,
}

fn wrong(request: &mut Parts, is_web: bool) -> Option<WrongRequest> {
    let spoken = if is_web {
        "this server speaks gRPC over HTTP/2, and gRPC-Web"
    } else {
        "this server speaks gRPC over HTTP/2, and not gRPC-Web because its setting web_origins is none"
    };
    let found = |status, cause: String| Some(WrongRequest { status, cause });
    if request.method != Method::POST {
        let method = quoted(request.method.as_str());
        let cause = format!("{spoken}; calls of either have the method POST, and this request {method}");
        return found(StatusCode::METHOD_NOT_ALLOWED, cause);
    }
    let given = request.headers.get(header::CONTENT_TYPE);
    let given = given.map_or("", |value| value.to_str().unwrap_or("?")).to_owned();
    // Without parameters, which mean nothing here.
    let media = given
        .split(';')
        .next()
        .unwrap_or_default()
        .trim()
        .to_ascii_lowercase();
    let web = GRPC_WEB.iter().find(|known| **known == media);
    let is_http_2 = request.version == Version::HTTP_2;
    match web {
        Some(known) if is_web => {
            request
                .headers
                .insert(header::CONTENT_TYPE, HeaderValue::from_static(known));
            None
        }
        Some(_) => found(StatusCode::FORBIDDEN, spoken.to_owned()),
        None if GRPC.contains(&media.as_str()) && is_http_2 => None,
        None if GRPC.contains(&media.as_str()) => {
            let cause = format!("{spoken}; this request is gRPC over {:?}", request.version);
            found(StatusCode::BAD_REQUEST, cause)
        }
        None if is_connect(&request.headers) => {
            let cause = format!(
                "{spoken}; this request is of the Connect protocol: choose the transport of gRPC-Web or gRPC"
            );
            found(StatusCode::UNSUPPORTED_MEDIA_TYPE, cause)
        }
        None => {
            let given = if given.is_empty() {
                "missing".to_owned()
            } else {
                format!("is {}", quoted(&given))
            };
            let mut right = vec![GRPC.join(" or ")];
            right.extend(is_web.then(|| format!("over gRPC-Web {}", GRPC_WEB.join(" or "))));
            let cause = format!("{spoken}; content-type {given}; it must be {}", right.join(", "));
            found(StatusCode::UNSUPPORTED_MEDIA_TYPE, cause)
        }
    }
}

/// True if a request is of the Connect protocol.
fn is_connect(headers: &HeaderMap) -> bool {
    let media = headers
        .get(header::CONTENT_TYPE)
        .and_then(|value| value.to_str().ok());
    let media = media
        .and_then(|value| value.split(';').next())
        .unwrap_or_default();
    headers.contains_key(CONNECT_VERSION) || CONNECT.contains(&media.trim())
}

/// The start of a client's text in quotes.
fn quoted(text: &str) -> String {
    let start: String = text.chars().take(MAX_QUOTED).collect();
    format!("{start:?}")
}

#[cfg(test)]
mod tests {
    use http::Request;
    use http_body_util::BodyExt as _;

    use super::*;

    /// What is wrong with a request, and its content type if nothing is.
    fn checked(
        method: Method,
        version: Version,
        content_type: &str,
        is_web: bool,
    ) -> Result<String, WrongRequest> {
        let request = Request::builder()
            .method(method)
            .version(version)
            .header(header::CONTENT_TYPE, content_type);
        let (mut parts, ()) = request.body(()).unwrap().into_parts();
        match wrong(&mut parts, is_web) {
            Some(wrong) => Err(wrong),
            None => Ok(parts.headers[header::CONTENT_TYPE].to_str().unwrap().to_owned()),
        }
    }

    #[test]
    fn grpc_and_grpc_web_pass_with_parameters_and_in_any_case() {
        let (h1, h2) = (Version::HTTP_11, Version::HTTP_2);
        for (version, given, after) in [
            (h2, "application/grpc", "application/grpc"),
            (h2, "application/grpc+proto", "application/grpc+proto"),
            (h2, "application/grpc-web+proto", "application/grpc-web+proto"),
            (h1, "application/grpc-web; charset=utf-8", "application/grpc-web"),
            (h1, "Application/gRPC-Web-Text", "application/grpc-web-text"),
        ] {
            let passed = checked(Method::POST, version, given, true);
            assert_eq!(passed.ok().as_deref(), Some(after), "{given}");
        }
    }

    #[test]
    fn what_is_neither_is_refused_with_the_cause() {
        let (h1, h2) = (Version::HTTP_11, Version::HTTP_2);
        let right = "application/grpc-web+proto";
        for (version, content_type, status, causes) in [
            (h1, "application/grpc", 400, ["HTTP/2", "HTTP/1.1"]),
            (
                h1,
                "application/grpc-web+json",
                415,
                ["application/grpc-web+json", right],
            ),
            (h2, "application/grpc+json", 415, ["application/grpc+json", right]),
            (h1, "", 415, ["missing", right]),
            (h1, "application/json", 415, ["Connect", "gRPC-Web"]),
            (h2, "application/connect+proto", 415, ["Connect", "gRPC-Web"]),
        ] {
            let Err(wrong) = checked(Method::POST, version, content_type, true) else {
                panic!("{content_type} passes");
            };
            assert_eq!(wrong.status, status, "{}", wrong.cause);
            assert!(
                causes.iter().all(|cause| wrong.cause.contains(cause)),
                "{}",
                wrong.cause
            );
        }
        for version in [h1, h2] {
            let wrong = checked(Method::GET, version, "application/grpc-web", true).unwrap_err();
            assert_eq!(wrong.status, StatusCode::METHOD_NOT_ALLOWED);
            assert!(
                wrong.cause.contains("POST") && wrong.cause.contains("GET"),
                "{}",
                wrong.cause
            );
        }
        let wrong = checked(Method::POST, h1, "application/grpc-web", false).unwrap_err();
        assert_eq!(wrong.status, StatusCode::FORBIDDEN);
        let wrong = checked(Method::POST, h2, &"x".repeat(9000), true).unwrap_err();
        assert!(wrong.cause.len() < 600, "it is quoted in part");
    }

    #[tokio::test]
    async fn clients_of_connect_are_answered_in_its_form() {
        let layer = refuse_protocols(true);
        let service = tower::service_fn(|_: Request<()>| async {
            Err::<http::Response<tonic::body::Body>, &str>("it was not refused")
        });
        let mut service = tower::Layer::layer(&layer, service);
        let request = Request::post("/grasp.v1.GraspService/FindGrasp")
            .header(header::CONTENT_TYPE, "application/json");
        let answer = tower::Service::call(&mut service, request.body(()).unwrap())
            .await
            .unwrap();
        assert_eq!(answer.headers()[header::CONTENT_TYPE], "application/json");
        let body = answer.into_body().collect().await.unwrap().to_bytes();
        let error: serde_json::Value = serde_json::from_slice(&body).unwrap();
        assert_eq!(error["code"], "unimplemented");
        assert!(error["message"].as_str().unwrap().contains("Connect"));
    }
}
