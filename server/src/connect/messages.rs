//! The messages of calls over Connect: those of requests as gRPC's frames of protobuf, those of answers as JSON.
//!
//! Reading and writing JSON takes some 10 µs per kilobyte. Large messages are converted on other threads, as many as there are places,
//! for which they wait.

use std::{
    io::Read as _,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
};

use bytes::{Buf as _, BufMut as _, Bytes, BytesMut};
use flate2::read::MultiGzDecoder;
use grasp_proto::json::{bytes_of, text_of};
use http::{Request, Response};
use http_body::Frame;
use prost_reflect::MessageDescriptor;
use tokio::sync::Semaphore;
use tokio_util::task::AbortOnDropHandle;
use tonic::{Status, body::Body};

use super::requests::Call;
use crate::{
    call::{FramedMessages, is_upload},
    error::ServiceError,
    executor::run_blocking,
    limits::{BYTES_BESIDES_MESH, MAX_FIND_REQUEST},
    middleware::{Answer, FrameFilter, Middleware, PolledFrame, filtered, next_frame},
};

/// Bytes before a message: its flags, and its length.
pub(super) const PREFIX: usize = 5;

/// Flag of a message packed by gzip.
pub(super) const PACKED: u8 = 1;

/// The field of errors about all of the JSON.
const BODY: &str = "body";

/// Smallest message that is converted on another thread, in bytes.
const LARGE: usize = 32 << 10;

/// Bytes of JSON per byte of protobuf, for messages of numbers.
const JSON_GROWTH: usize = 5;

/// Least bytes of protobuf per value in JSON, on average and besides the mesh; values take tens of bytes while they are converted.
pub(crate) const BYTES_OF_VALUE: usize = 2;

/// The layer inside that of calls; see the module documentation.
#[derive(Clone, Debug)]
pub(crate) struct Transcoder {
    /// Largest message of an upload, in bytes of protobuf.
    pub largest_upload: usize,
    /// One permit per thread that converts messages.
    pub places: Arc<Semaphore>,
}

impl Transcoder {
    /// Largest message of a request as it is written, in bytes.
    fn limit(&self, path: &str, call: &Call) -> usize {
        match (is_upload(path), call.format.json) {
            (false, false) => MAX_FIND_REQUEST,
            (false, true) => JSON_GROWTH * MAX_FIND_REQUEST,
            (true, false) => self.largest_upload,
            // The mesh takes four characters for three bytes.
            (true, true) => self.largest_upload.div_ceil(3) * 4 + JSON_GROWTH * BYTES_BESIDES_MESH,
        }
    }
}

impl Middleware<Body> for Transcoder {
    fn handle<E, F>(&self, mut request: Request<Body>, next: impl FnOnce(Request<Body>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static,
    {
        let Some(call) = request.extensions_mut().remove::<Call>() else {
            return Box::pin(next(request));
        };
        let path = request.uri().path();
        let besides_mesh = if is_upload(path) {
            BYTES_BESIDES_MESH
        } else {
            MAX_FIND_REQUEST
        };
        let limits = MessageLimits {
            bytes: self.limit(path, &call),
            values: besides_mesh / BYTES_OF_VALUE,
        };
        let reader = Reader {
            call: call.clone(),
            limits,
            buffer: BytesMut::new(),
            ended: false,
            taken: false,
            converter: Converter::new(&self.places),
        };
        let answer = next(request.map(|body| filtered(body, reader)));
        if !call.format.json {
            return Box::pin(answer);
        }
        let writer = Writer {
            call,
            converter: Converter::new(&self.places),
        };
        Box::pin(async move { Ok(answer.await?.map(|body| filtered(body, writer))) })
    }
}

/// Converts one message after the other.
struct Converter {
    running: Option<AbortOnDropHandle<Result<Bytes, ServiceError>>>,
    places: Arc<Semaphore>,
}

impl Converter {
    fn new(places: &Arc<Semaphore>) -> Self {
        Self {
            running: None,
            places: Arc::clone(places),
        }
    }

    /// Begins to convert `bytes` bytes; returns the result if it is there at once.
    fn begin(
        &mut self,
        bytes: usize,
        convert: impl FnOnce() -> Result<Bytes, ServiceError> + Send + 'static,
    ) -> Option<Result<Bytes, ServiceError>> {
        if bytes < LARGE {
            return Some(convert());
        }
        let places = Arc::clone(&self.places);
        self.running = Some(AbortOnDropHandle::new(tokio::spawn(async move {
            // Nothing closes the semaphore.
            let place = places.acquire_owned().await;
            run_blocking(move || {
                let _place = place;
                convert()
            })
            .await
            .flatten()
        })));
        None
    }

    /// The message that is being converted, if any.
    fn poll(&mut self, cx: &mut Context<'_>) -> Poll<Option<Result<Bytes, ServiceError>>> {
        let Some(running) = &mut self.running else {
            return Poll::Ready(None);
        };
        let converted = ready!(Pin::new(running).poll(cx));
        self.running = None;
        // Fails only after a panic, which is logged, or when the server ends.
        Poll::Ready(Some(converted.unwrap_or(Err(ServiceError::Panicked))))
    }
}

fn converted(result: Result<Bytes, ServiceError>) -> PolledFrame {
    Poll::Ready(Some(result.map(Frame::data).map_err(Status::from)))
}

/// Bounds on a message of a request.
#[derive(Clone, Copy)]
struct MessageLimits {
    /// As it is written, and unpacked.
    bytes: usize,
    /// Values in JSON.
    values: usize,
}

/// Reads the messages of a request.
struct Reader {
    call: Call,
    limits: MessageLimits,
    /// The bytes of the next message that have arrived, and perhaps of others.
    buffer: BytesMut,
    /// The request has arrived to its end.
    ended: bool,
    /// The bare message has been read.
    taken: bool,
    converter: Converter,
}

impl FrameFilter for Reader {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        loop {
            if let Some(message) = ready!(self.converter.poll(cx)) {
                return converted(message);
            }
            match self.next() {
                Err(error) => return converted(Err(error)),
                Ok(Some((message, packed))) => {
                    let (call, limits, length) = (self.call.clone(), self.limits, message.len());
                    let convert = move || read(&call, message, packed, limits);
                    if let Some(message) = self.converter.begin(length, convert) {
                        return converted(message);
                    }
                    continue;
                }
                Ok(None) if self.ended => return Poll::Ready(None),
                Ok(None) => {}
            }
            match ready!(next_frame(inner, cx)) {
                Some(Ok(frame)) => {
                    if let Ok(data) = frame.into_data() {
                        self.buffer.extend_from_slice(&data);
                    }
                }
                Some(Err(error)) => return Poll::Ready(Some(Err(error))),
                None => self.ended = true,
            }
        }
    }

    fn is_empty(&self) -> bool {
        self.ended && self.converter.running.is_none()
    }
}

impl Reader {
    /// The next message, if it has arrived, and whether it is packed.
    fn next(&mut self) -> Result<Option<(Bytes, bool)>, ServiceError> {
        if self.call.format.enveloped {
            return self.next_of_stream();
        }
        let limit = self.limits.bytes;
        if self.buffer.len() > limit {
            return Err(ServiceError::MessageTooLarge { limit });
        }
        let whole = self.ended && !std::mem::replace(&mut self.taken, self.ended);
        Ok(whole.then(|| (self.buffer.split().freeze(), self.call.packed)))
    }

    fn next_of_stream(&mut self) -> Result<Option<(Bytes, bool)>, ServiceError> {
        let malformed = |problem: String| Err(ServiceError::Malformed(problem));
        let Some(&[flags, a, b, c, d]) = self.buffer.first_chunk::<PREFIX>() else {
            let left = self.buffer.len();
            return match left {
                1.. if self.ended => malformed(format!(
                    "the request ends after {left} of an envelope's 5 first bytes"
                )),
                _ => Ok(None),
            };
        };
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        if flags & !PACKED != 0 {
            return malformed(format!(
                "the flags of an envelope are {flags}; they must be 0, or 1 if it is packed"
            ));
        }
        if flags & PACKED != 0 && !self.call.packed {
            return malformed("an envelope is packed, but connect-content-encoding is not gzip".to_owned());
        }
        let limit = self.limits.bytes;
        if length > limit {
            return Err(ServiceError::MessageTooLarge { limit });
        }
        let arrived = self.buffer.len() - PREFIX;
        if arrived < length {
            if self.ended {
                return malformed(format!(
                    "the request ends after {arrived} of {length} bytes of an envelope"
                ));
            }
            return Ok(None);
        }
        self.buffer.advance(PREFIX);
        Ok(Some((self.buffer.split_to(length).freeze(), flags & PACKED != 0)))
    }
}

/// A message of a request as a frame of gRPC.
fn read(call: &Call, message: Bytes, packed: bool, limits: MessageLimits) -> Result<Bytes, ServiceError> {
    let mut message = message;
    if packed && !message.is_empty() {
        message = unpacked(&message, limits.bytes)?;
    }
    if call.format.json {
        message = protobuf(&call.method.input(), &message, limits.values)?.into();
    }
    Ok(framed(&message))
}

pub(crate) fn protobuf(
    message: &MessageDescriptor,
    text: &[u8],
    most_values: usize,
) -> Result<Vec<u8>, ServiceError> {
    if text.trim_ascii().is_empty() {
        return Err(ServiceError::invalid(
            BODY,
            "is empty; it must be a JSON object, such as {}",
        ));
    }
    if values(text) > most_values {
        let problem = format!("has {} values; it may have {most_values}", values(text));
        return Err(ServiceError::invalid(BODY, problem));
    }
    bytes_of(message, text)
        .map_err(|error| ServiceError::invalid(error.path.unwrap_or_else(|| BODY.to_owned()), error.problem))
}

/// Number of values in a JSON text, at most: each follows a bracket or a comma outside texts.
fn values(text: &[u8]) -> usize {
    let (mut values, mut rest) = (1, text.iter());
    while let Some(byte) = rest.next() {
        match byte {
            b'{' | b'[' | b',' => values += 1,
            b'"' => {
                while let Some(b'\\') = rest.find(|byte| matches!(byte, b'"' | b'\\')) {
                    rest.next();
                }
            }
            _ => {}
        }
    }
    values
}

fn unpacked(message: &[u8], limit: usize) -> Result<Bytes, ServiceError> {
    let mut content = Vec::new();
    let read = MultiGzDecoder::new(message)
        .take(limit as u64 + 1)
        .read_to_end(&mut content);
    read.map_err(|error| {
        ServiceError::Malformed(format!("a message is packed, but not with gzip: {error}"))
    })?;
    if content.len() > limit {
        return Err(ServiceError::MessageTooLarge { limit });
    }
    Ok(content.into())
}

fn framed(message: &[u8]) -> Bytes {
    let mut frame = BytesMut::with_capacity(PREFIX + message.len());
    put_frame(&mut frame, message);
    frame.freeze()
}

fn put_frame(frames: &mut BytesMut, message: &[u8]) {
    frames.put_u8(0);
    frames.put_u32(message.len() as u32);
    frames.put_slice(message);
}

/// Writes the messages of an answer as JSON.
struct Writer {
    call: Call,
    converter: Converter,
}

impl FrameFilter for Writer {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        loop {
            if let Some(messages) = ready!(self.converter.poll(cx)) {
                return converted(messages);
            }
            let frame = match ready!(next_frame(inner, cx)) {
                Some(Ok(frame)) => frame,
                other => return Poll::Ready(other),
            };
            let messages = match frame.into_data() {
                Ok(messages) => messages,
                Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
            };
            let call = self.call.clone();
            if let Some(messages) = self
                .converter
                .begin(messages.len(), move || written(&call, messages))
            {
                return converted(messages);
            }
        }
    }

    fn is_empty(&self) -> bool {
        self.converter.running.is_none()
    }
}

/// Frames of protobuf as frames of JSON.
fn written(call: &Call, messages: Bytes) -> Result<Bytes, ServiceError> {
    let mut frames = BytesMut::new();
    for (_, message) in FramedMessages(messages) {
        let text = text_of(&call.method.output(), &message).map_err(|error| {
            tracing::error!(%error, method = call.method.full_name(), "cannot write an answer as JSON");
            ServiceError::Panicked
        })?;
        put_frame(&mut frames, &text);
    }
    Ok(frames.freeze())
}

#[cfg(test)]
mod tests {
    use http_body_util::{BodyExt as _, StreamBody};

    use super::{super::Format, *};
    use crate::methods::method;

    #[test]
    fn values_are_counted_outside_texts() {
        for (text, expected) in [
            ("{}", 2),
            (r#"{"a": [1, 2, {}], "b": "x"}"#, 7),
            (r#"{"a,[{": "\\", "b": "\",\",[{"}"#, 3),
            (r#"{"cut \"#, 2),
            ("[[[[,,,,", 9),
        ] {
            assert_eq!(values(text.as_bytes()), expected, "{text}");
        }
    }

    #[tokio::test]
    async fn envelopes_are_read_in_pieces_of_any_size() {
        let call = Call {
            format: Format {
                json: true,
                enveloped: true,
            },
            method: method("/grasp.v1.GraspService/TrackHoldout").unwrap(),
            packed: false,
        };
        let texts = [
            r#"{"frame": {"sequence": "1"}}"#,
            "{}",
            r#"{"frame": {"committed": true}}"#,
        ];
        let sent = texts.map(|text| framed(text.as_bytes())).concat();
        let expected = [&[0x12, 2, 0x10, 1][..], &[], &[0x12, 2, 0x38, 1]]
            .map(framed)
            .concat();
        for size in (1..=12).chain([sent.len()]) {
            let pieces: Vec<_> = sent
                .chunks(size)
                .map(|piece| Ok::<_, Status>(Frame::data(Bytes::copy_from_slice(piece))))
                .collect();
            let reader = Reader {
                call: call.clone(),
                limits: MessageLimits {
                    bytes: 100,
                    values: 10,
                },
                buffer: BytesMut::new(),
                ended: false,
                taken: false,
                converter: Converter::new(&Arc::new(Semaphore::new(0))),
            };
            let body = Body::new(StreamBody::new(tokio_stream::iter(pieces)));
            let read = filtered(body, reader).collect().await.unwrap().to_bytes();
            assert_eq!(read, expected, "pieces of {size}");
        }
    }
}
