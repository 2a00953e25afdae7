//! Packs large messages with gzip for clients that accept it.
//!
//! Packing takes some 20 µs per kilobyte, too long for the threads that handle requests. It runs on as many other threads as there
//! are places; a message that finds no place is sent unpacked. Packing would only delay a message that fits
//! into the first round trip.

use std::{
    io::Write as _,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use bytes::{BufMut as _, Bytes, BytesMut};
use flate2::{Compression, write::GzEncoder};
use http::{HeaderMap, HeaderValue, Response};
use http_body::Frame;
use tokio::{sync::Semaphore, task::JoinHandle};
use tonic::{Status, body::Body};

use super::STATUS;
use crate::middleware::{FrameFilter, PolledFrame, filtered, is_gzip_among, next_frame};

/// Smallest packed message, in bytes: the initial window of a TCP connection (RFC 6928: ten segments).
const MIN_PACKED: usize = 14 << 10;

const ACCEPTED: &str = "grpc-accept-encoding";

const ENCODING: &str = "grpc-encoding";

/// Bytes before a message: whether it is packed, and its length.
const PREFIX: usize = 5;

/// The answer with its large messages packed, each if one of the `places` is free.
pub(super) fn packing(mut answer: Response<Body>, places: Arc<Semaphore>) -> Response<Body> {
    // An error has no messages.
    if answer.headers().contains_key(STATUS) {
        return answer;
    }
    let gzip = HeaderValue::from_static("gzip");
    answer.headers_mut().insert(ENCODING, gzip);
    let packer = Packer {
        packing: None,
        places,
    };
    answer.map(|inner| filtered(inner, packer))
}

pub(super) fn accepts_gzip(headers: &HeaderMap) -> bool {
    headers.get_all(ACCEPTED).iter().any(is_gzip_among)
}

struct Packer {
    /// The frame being packed, which is the next to be sent.
    packing: Option<JoinHandle<Bytes>>,
    places: Arc<Semaphore>,
}

impl FrameFilter for Packer {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        loop {
            if let Some(packing) = &mut self.packing {
                let packed = std::task::ready!(Pin::new(packing).poll(cx));
                self.packing = None;
                // Fails only after a panic, which is logged, or when the server ends.
                let packed = packed.map_err(|error| Status::internal(error.to_string()));
                return Poll::Ready(Some(packed.map(Frame::data)));
            }
            let frame = match std::task::ready!(next_frame(inner, cx)) {
                Some(Ok(frame)) => frame,
                other => return Poll::Ready(other),
            };
            let messages = match frame.into_data() {
                Ok(messages) => messages,
                Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
            };
            let is_large = Messages(messages.clone()).any(|(_, message)| message.len() >= MIN_PACKED);
            let place = is_large.then(|| Arc::clone(&self.places).try_acquire_owned());
            let Some(Ok(place)) = place else {
                return Poll::Ready(Some(Ok(Frame::data(messages))));
            };
            self.packing = Some(tokio::task::spawn_blocking(move || {
                let _place = place;
                packed(messages)
            }));
        }
    }

    fn is_empty(&self) -> bool {
        self.packing.is_none()
    }
}

/// The messages of a frame, each with its prefix and without. An incomplete message can only be the last.
pub(crate) struct Messages(pub(crate) Bytes);

impl Iterator for Messages {
    type Item = (Bytes, Bytes);

    fn next(&mut self) -> Option<(Bytes, Bytes)> {
        if self.0.is_empty() {
            return None;
        }
        let length = match *self.0 {
            [_, a, b, c, d, ..] => PREFIX.saturating_add(u32::from_be_bytes([a, b, c, d]) as usize),
            _ => usize::MAX,
        };
        let whole = self.0.split_to(length.min(self.0.len()));
        let message = whole.slice(PREFIX.min(whole.len())..);
        Some((whole, message))
    }
}

/// The same messages, the large ones packed if that makes them smaller.
fn packed(messages: Bytes) -> Bytes {
    let mut all = BytesMut::with_capacity(messages.len());
    for (whole, message) in Messages(messages) {
        let smaller = (message.len() >= MIN_PACKED).then(|| gzip(&message));
        match smaller.filter(|smaller| smaller.len() < message.len()) {
            Some(smaller) => {
                all.put_u8(1);
                all.put_u32(smaller.len() as u32);
                all.put_slice(&smaller);
            }
            None => all.put_slice(&whole),
        }
    }
    all.freeze()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    // Writing to memory does not fail.
    let written = packer.write_all(bytes).and_then(|()| packer.finish());
    written.unwrap_or_else(|_| bytes.to_vec())
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use flate2::read::GzDecoder;
    use http_body_util::{BodyExt as _, Full};

    use super::*;

    fn framed(message: &[u8]) -> Vec<u8> {
        let length = u32::try_from(message.len()).unwrap().to_be_bytes();
        [&[0], &length[..], message].concat()
    }

    fn unpacked(messages: &Bytes) -> Vec<(bool, Vec<u8>)> {
        let unpacked = Messages(messages.clone()).map(|(whole, message)| {
            let mut content = message.to_vec();
            if whole[0] == 1 {
                content.clear();
                GzDecoder::new(&*message)
                    .read_to_end(&mut content)
                    .expect("it is gzip");
            }
            (whole[0] == 1, content)
        });
        unpacked.collect()
    }

    async fn passed(content: Vec<u8>, places: &Arc<Semaphore>) -> Bytes {
        let packer = Packer {
            packing: None,
            places: Arc::clone(places),
        };
        let body = filtered(Body::new(Full::new(content.into())), packer);
        body.collect().await.expect("it does not fail").to_bytes()
    }

    /// Incompressible bytes.
    fn noise(length: usize) -> Vec<u8> {
        let mut state = 1_u64;
        let next = |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        };
        (0..length).map(next).collect()
    }

    #[tokio::test]
    async fn only_large_messages_that_become_smaller_and_find_a_place_are_packed() {
        let places = Arc::new(Semaphore::new(1));
        let messages = [
            vec![7; 3],
            vec![8; 3 * MIN_PACKED],
            noise(2 * MIN_PACKED),
            Vec::new(),
        ];
        let content: Vec<u8> = messages.iter().flat_map(|message| framed(message)).collect();
        let found = unpacked(&passed(content.clone(), &places).await);
        let expected = [false, true, false, false].into_iter().zip(messages);
        assert_eq!(found, expected.collect::<Vec<_>>());
        assert_eq!(places.available_permits(), 1);
        let none = Arc::new(Semaphore::new(0));
        assert_eq!(passed(content.clone(), &none).await, content);
        for odd in [&[0, 0, 0, 1][..], &[0, 0, 0, 0, 9, 1], &[]] {
            assert_eq!(packed(Bytes::copy_from_slice(odd)), odd, "it is no message");
        }
    }
}
