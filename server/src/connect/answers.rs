//! Answers: gRPC's frames and status, converted to Connect's.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    task::{Context, Poll},
};

use bytes::{BufMut as _, Bytes, BytesMut};
use http::{HeaderMap, HeaderName, HeaderValue, Response, StatusCode, header};
use http_body::Frame;
use http_body_util::{BodyExt as _, Full};
use serde::Serialize;
use tonic::{Code, Status, body::Body};

use super::{
    Format,
    errors::{ErrorBody, http_status},
    messages::{PACKED, PREFIX},
};
use crate::{
    call::REQUEST_ID,
    error::CHALLENGE,
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
};

/// Flag of the envelope that ends a stream.
const END: u8 = 2;

const GZIP: HeaderValue = HeaderValue::from_static("gzip");

/// Headers that are not metadata.
const OF_PROTOCOL: [&str; 7] = [
    "content-type",
    "date",
    "grpc-accept-encoding",
    "grpc-encoding",
    "grpc-message",
    "grpc-status",
    "grpc-status-details-bin",
];

/// The answer of the services as one of Connect.
pub(super) async fn answered(mut answer: Response<Body>, format: Format) -> Response<Body> {
    // A header, even where the others are trailers.
    let id = answer.headers_mut().remove(REQUEST_ID);
    let mut answer = reframed(answer, format).await;
    answer.headers_mut().extend(id.map(|id| (REQUEST_ID, id)));
    answer
}

async fn reframed(answer: Response<Body>, format: Format) -> Response<Body> {
    if let Some(status) = Status::from_header_map(answer.headers()) {
        return failure(&status, format);
    }
    if format.enveloped {
        return stream(answer, format);
    }
    let (head, body) = answer.into_parts();
    let collected = match body.collect().await {
        Ok(collected) => collected,
        Err(status) => return failure(&status, format),
    };
    let trailers = collected.trailers().cloned().unwrap_or_default();
    let status = status_in(&trailers);
    let mut frame = collected.to_bytes();
    if status.code() != Code::Ok {
        return failure(&status, format);
    }
    if frame.len() < PREFIX {
        return failure(&Status::internal("the answer has no message"), format);
    }
    let prefix = frame.split_to(PREFIX);
    let mut answer = whole(StatusCode::OK, format.content_type(), frame);
    let headers = answer.headers_mut();
    if prefix[0] & PACKED != 0 {
        headers.insert(header::CONTENT_ENCODING, GZIP);
    }
    headers.extend(metadata(&head.headers));
    headers.extend(trailing(&trailers));
    answer
}

/// A status as the answer to a call.
pub(super) fn failure(status: &Status, format: Format) -> Response<Body> {
    if format.enveloped {
        let end = end_of_stream(status);
        return whole(StatusCode::OK, format.content_type(), end);
    }
    refusal(http_status(status.code()).0, status)
}

/// An error that is no message of a stream, with a status of HTTP.
pub(super) fn refusal(http: StatusCode, status: &Status) -> Response<Body> {
    let mut answer = whole(http, "application/json", json(&ErrorBody::from(status)).into());
    let mut metadata = status.metadata().clone().into_headers();
    if let Some(challenge) = metadata.remove(CHALLENGE) {
        answer.headers_mut().insert(CHALLENGE, challenge);
    }
    answer.headers_mut().extend(trailing(&metadata));
    answer
}

fn whole(http: StatusCode, content_type: &'static str, body: Bytes) -> Response<Body> {
    let length = body.len().into();
    let mut answer = Response::new(Body::new(Full::new(body)));
    *answer.status_mut() = http;
    let headers = answer.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(content_type));
    // Layers outside do not know it from the body.
    headers.insert(header::CONTENT_LENGTH, length);
    answer
}

/// The frames of gRPC are envelopes already; only the status at the end is not.
fn stream(answer: Response<Body>, format: Format) -> Response<Body> {
    let (head, body) = answer.into_parts();
    let mut answer = Response::new(filtered(body, StreamEnd::default()));
    let headers = answer.headers_mut();
    let content_type = HeaderValue::from_static(format.content_type());
    headers.insert(header::CONTENT_TYPE, content_type);
    if head.headers.contains_key("grpc-encoding") {
        headers.insert("connect-content-encoding", GZIP);
    }
    headers.extend(metadata(&head.headers));
    answer
}

/// Ends a stream with an envelope that has the status and the trailing metadata.
#[derive(Default)]
struct StreamEnd {
    ended: bool,
}

impl FrameFilter for StreamEnd {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        if self.ended {
            return Poll::Ready(None);
        }
        let status = match std::task::ready!(next_frame(inner, cx)) {
            Some(Ok(frame)) => match frame.into_trailers() {
                Ok(trailers) => status_in(&trailers),
                Err(message) => return Poll::Ready(Some(Ok(message))),
            },
            Some(Err(status)) => status,
            None => status_in(&HeaderMap::new()),
        };
        self.ended = true;
        Poll::Ready(Some(Ok(Frame::data(end_of_stream(&status)))))
    }

    fn is_empty(&self) -> bool {
        self.ended
    }
}

/// The message that ends a stream.
#[derive(Serialize)]
struct EndOfStream<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<ErrorBody>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    metadata: BTreeMap<&'a str, Vec<Cow<'a, str>>>,
}

fn end_of_stream(status: &Status) -> Bytes {
    let trailers = status.metadata().clone().into_headers();
    let mut metadata: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for (name, value) in own(&trailers) {
        let value = String::from_utf8_lossy(value.as_bytes());
        metadata.entry(name.as_str()).or_default().push(value);
    }
    let text = json(&EndOfStream {
        error: (status.code() != Code::Ok).then(|| status.into()),
        metadata,
    });
    let mut envelope = BytesMut::with_capacity(PREFIX + text.len());
    envelope.put_u8(END);
    envelope.put_u32(text.len() as u32);
    envelope.put_slice(&text);
    envelope.freeze()
}

fn json(value: &impl Serialize) -> Vec<u8> {
    // Texts, lists and maps of texts are always JSON.
    serde_json::to_vec(value).unwrap_or_default()
}

fn status_in(trailers: &HeaderMap) -> Status {
    Status::from_header_map(trailers).unwrap_or_else(|| Status::unknown("the answer ended without a status"))
}

/// Headers that are neither HTTP's nor gRPC's.
fn own(headers: &HeaderMap) -> impl Iterator<Item = (&HeaderName, &HeaderValue)> {
    headers
        .iter()
        .filter(|(name, _)| !OF_PROTOCOL.contains(&name.as_str()))
}

fn metadata(headers: &HeaderMap) -> impl Iterator<Item = (HeaderName, HeaderValue)> {
    own(headers).map(|(name, value)| (name.clone(), value.clone()))
}

/// Trailing metadata as headers.
fn trailing(headers: &HeaderMap) -> impl Iterator<Item = (HeaderName, HeaderValue)> {
    own(headers).filter_map(|(name, value)| {
        let name = format!("trailer-{name}").parse().ok()?;
        Some((name, value.clone()))
    })
}
