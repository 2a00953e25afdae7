//! Refuses requests of other protocols with an answer that says which are spoken.

use http::{HeaderMap, HeaderValue, Method, StatusCode, Version, header, request::Parts};
use serde_json::json;

use super::refusal::{RefusalLayer, refusal};

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
pub(crate) fn refuse_protocols(is_web: bool) -> RefusalLayer {
    RefusalLayer::new(move |request| {
        let Wrong { status, cause } = wrong(request, is_web)?;
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
struct Wrong {
    status: StatusCode,
    cause: String,
}

fn wrong(request: &mut Parts, is_web: bool) -> Option<Wrong> {
    let spoken = if is_web {
        "this server speaks gRPC over HTTP/2, and gRPC-Web"
    } else {
        "this server speaks gRPC over HTTP/2, and not gRPC-Web because its setting web_origins is none"
    };
    let found = |status, cause: String| Some(Wrong { status, cause });
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

    /// What is wrong with a request, if anything, and its content type afterwards.
    fn refused(
        method: Method,
        version: Version,
        content_type: &str,
        is_web: bool,
    ) -> (Option<(u16, String)>, String) {
        let request = Request::builder()
            .method(method)
            .version(version)
            .header(header::CONTENT_TYPE, content_type);
        let (mut parts, ()) = request.body(()).unwrap().into_parts();
        let wrong = wrong(&mut parts, is_web).map(|Wrong { status, cause }| (status.as_u16(), cause));
        (
            wrong,
            parts.headers[header::CONTENT_TYPE].to_str().unwrap().to_owned(),
        )
    }

    #[test]
    fn grpc_and_grpc_web_pass_with_parameters_and_in_any_case() {
        for (version, given, after) in [
            (Version::HTTP_2, "application/grpc", "application/grpc"),
            (
                Version::HTTP_2,
                "application/grpc+proto",
                "application/grpc+proto",
            ),
            (
                Version::HTTP_2,
                "application/grpc-web+proto",
                "application/grpc-web+proto",
            ),
            (
                Version::HTTP_11,
                "application/grpc-web; charset=utf-8",
                "application/grpc-web",
            ),
            (
                Version::HTTP_11,
                "Application/gRPC-Web-Text",
                "application/grpc-web-text",
            ),
        ] {
            let (wrong, kept) = refused(Method::POST, version, given, true);
            assert_eq!((wrong, kept.as_str()), (None, after), "{given}");
        }
    }

    #[test]
    fn what_is_neither_is_refused_with_the_cause() {
        let (h1, h2) = (Version::HTTP_11, Version::HTTP_2);
        for (method, version, content_type, is_web, status, causes) in [
            (
                Method::GET,
                h1,
                "application/grpc-web",
                true,
                405,
                ["POST", "GET"],
            ),
            (Method::GET, h2, "text/html", true, 405, ["POST", "GET"]),
            (
                Method::POST,
                h1,
                "application/grpc",
                true,
                400,
                ["HTTP/2", "HTTP/1.1"],
            ),
            (
                Method::POST,
                h1,
                "application/grpc-web+json",
                true,
                415,
                ["application/grpc-web+json", "application/grpc-web+proto"],
            ),
            (
                Method::POST,
                h2,
                "application/grpc-web+thrift",
                true,
                415,
                ["application/grpc-web+thrift", "application/grpc-web+proto"],
            ),
            (
                Method::POST,
                h2,
                "application/grpc+json",
                true,
                415,
                ["application/grpc+json", "application/grpc+proto"],
            ),
            (
                Method::POST,
                h1,
                "",
                true,
                415,
                ["missing", "application/grpc-web+proto"],
            ),
            (
                Method::POST,
                h1,
                "application/json",
                true,
                415,
                ["Connect", "gRPC-Web"],
            ),
            (
                Method::POST,
                h2,
                "application/connect+proto",
                true,
                415,
                ["Connect", "gRPC-Web"],
            ),
            (
                Method::POST,
                h1,
                "application/grpc-web",
                false,
                403,
                ["web_origins", "none"],
            ),
        ] {
            let (wrong, _) = refused(method, version, content_type, is_web);
            let (found, cause) = wrong.unwrap_or_else(|| panic!("{content_type} passes"));
            assert_eq!(found, status, "{cause}");
            for part in causes {
                assert!(cause.contains(part), "{part} is not in {cause}");
            }
        }
    }

    #[test]
    fn long_and_odd_types_are_quoted_in_part() {
        let (wrong, _) = refused(Method::POST, Version::HTTP_2, &"x".repeat(9000), true);
        assert!(wrong.unwrap().1.len() < 600);
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
