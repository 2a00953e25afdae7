//! Requests: their headers, converted to gRPC's.

use http::{HeaderMap, HeaderName, HeaderValue, Response, StatusCode, Version, header, request::Parts};
use tonic::{Status, body::Body};

use super::{
    Format,
    answers::{failure, refusal},
};
use crate::{
    error::ServiceError,
    methods::{Method, method, named_like},
    middleware::is_gzip_among,
    wire::quoted,
};

const VERSION: &str = "connect-protocol-version";
const TIMEOUT: &str = "connect-timeout-ms";

/// Most digits of a timeout in milliseconds.
const TIMEOUT_DIGITS: usize = 10;

/// Largest timeout that gRPC's eight digits hold in milliseconds.
const MAX_GRPC_MILLIS: u64 = 99_999_999;

/// Headers of gRPC, which only the layers of this module set.
const OF_GRPC: [&str; 3] = ["grpc-timeout", "grpc-encoding", "grpc-accept-encoding"];

/// The answer to a request that is refused.
type Refusal = Box<Response<Body>>;

/// A call, for the layer that converts its messages.
#[derive(Clone, Debug)]
pub(super) struct Call {
    pub format: Format,
    pub method: &'static Method,
    /// Whether messages of the request may be packed with gzip; a bare one is.
    pub packed: bool,
}

/// The format of a request, if it is one of Connect.
pub(super) fn format(headers: &HeaderMap) -> Option<Format> {
    Format::of(headers.get(header::CONTENT_TYPE)?.to_str().ok()?)
}

/// Converts the headers of a request to gRPC's.
///
/// # Errors
/// The answer to a request that is refused.
pub(super) fn call(head: &mut Parts, format: Format) -> Result<Call, Refusal> {
    let method = called(head, format)?;
    let failed = |error: ServiceError| Box::new(failure(&error.into(), format));
    let headers = &mut head.headers;
    for name in OF_GRPC {
        headers.remove(name);
    }
    if let Some(version) = headers.remove(VERSION).filter(|version| version != "1") {
        let problem = format!("is {}; it must be \"1\"", shown(&version));
        return Err(failed(ServiceError::invalid(VERSION, problem)));
    }
    if let Some(timeout) = headers.remove(TIMEOUT) {
        let Some(timeout) = grpc_timeout(&timeout) else {
            let problem = format!(
                "is {}; it must be a number of milliseconds of up to {TIMEOUT_DIGITS} digits",
                shown(&timeout)
            );
            return Err(failed(ServiceError::invalid(TIMEOUT, problem)));
        };
        headers.insert("grpc-timeout", timeout);
    }
    let [encoding, accepted] = if format.enveloped {
        ["connect-content-encoding", "connect-accept-encoding"].map(HeaderName::from_static)
    } else {
        [header::CONTENT_ENCODING, header::ACCEPT_ENCODING]
    };
    let packed = match headers.remove(&encoding) {
        None => false,
        Some(given) if given == "gzip" => true,
        Some(given) if given == "identity" || given.is_empty() => false,
        Some(given) => {
            let problem = format!("{encoding} is {}; it must be gzip or identity", shown(&given));
            return Err(Box::new(failure(&Status::unimplemented(problem), format)));
        }
    };
    let accepts = match headers.remove(&accepted) {
        Some(accepted) => is_gzip_among(&accepted),
        None => packed,
    };
    if accepts {
        headers.insert("grpc-accept-encoding", HeaderValue::from_static("gzip"));
    }
    headers.remove(header::CONTENT_LENGTH);
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/grpc"));
    Ok(Call {
        format,
        method,
        packed,
    })
}

/// The method that a request calls.
fn called(head: &Parts, format: Format) -> Result<&'static Method, Refusal> {
    let path = head.uri.path();
    let Some(method) = method(path) else {
        let like = match named_like(path).join(", ") {
            like if like.is_empty() => like,
            like => format!("; it has {like}"),
        };
        let problem = format!("{} is no method of this server{like}", quoted(path));
        return Err(Box::new(failure(&Status::unimplemented(problem), format)));
    };
    let streams = method.is_client_streaming() || method.is_server_streaming();
    if streams != format.enveloped {
        let right = Format {
            enveloped: streams,
            ..format
        };
        let kind = if streams { "a stream" } else { "no stream" };
        let problem = format!(
            "{} is {kind}; content-type is {}; it must be {}",
            method.name(),
            format.content_type(),
            right.content_type()
        );
        let status = Status::unimplemented(problem);
        return Err(Box::new(refusal(StatusCode::UNSUPPORTED_MEDIA_TYPE, &status)));
    }
    let both_ways = method.is_client_streaming() && method.is_server_streaming();
    if both_ways && head.version != Version::HTTP_2 {
        let problem = format!(
            "{} streams both ways, for which this protocol needs HTTP/2; this request is {:?}",
            method.name(),
            head.version
        );
        let status = Status::unimplemented(problem);
        return Err(Box::new(refusal(StatusCode::HTTP_VERSION_NOT_SUPPORTED, &status)));
    }
    Ok(method)
}

fn shown(value: &HeaderValue) -> String {
    quoted(&String::from_utf8_lossy(value.as_bytes()))
}

/// A timeout in milliseconds as gRPC has it.
fn grpc_timeout(millis: &HeaderValue) -> Option<HeaderValue> {
    let digits = millis.to_str().ok()?;
    if digits.len() > TIMEOUT_DIGITS || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let millis: u64 = digits.parse().ok()?;
    let timeout = if millis <= MAX_GRPC_MILLIS {
        format!("{millis}m")
    } else {
        format!("{}S", millis.div_ceil(1000))
    };
    timeout.parse().ok()
}
