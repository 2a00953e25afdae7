//! Counts answers until they are read, and requests until they are answered: clients may begin more than they end.

use std::{
    sync::{Arc, Weak},
    task::{Context, Poll},
};

use bytes::Bytes;
use http::{Request, Response};
use http_body::Frame;
use tonic::body::Body;

use super::reader::{OpenRequest, Reader, WaitingBytes};
use crate::{
    middleware::{Answer, FrameFilter, Middleware, PolledFrame, filtered, next_frame},
    sync::{Mutex, locked},
};

/// Largest chunk handed to the transport at once, in bytes: small enough to show the progress of a slow client.
const CHUNK: usize = 32 << 10;

/// Counts the answers of the services inside, and the requests that wait for them. Outermost, because other layers may copy
/// answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnreadCount;

impl<B> Middleware<B> for UnreadCount {
    fn handle<E, F>(&self, request: Request<B>, next: impl FnOnce(Request<B>) -> F) -> Answer<E>
    where
        E: Send + 'static,
        F: Future<Output = Result<Response<Body>, E>> + Send + 'static,
    {
        let reader = request.extensions().get::<Arc<Reader>>().cloned();
        let open = reader.as_ref().map(Reader::begin_request);
        let answer = next(request);
        Box::pin(async move {
            let answer = answer.await?;
            let (Some(reader), Some(mut request)) = (reader, open) else {
                return Ok(answer);
            };
            request.answered();
            let counting = AnswerCount {
                rest: None,
                reader,
                request,
            };
            Ok(answer.map(|inner| filtered(inner, counting)))
        })
    }
}

struct AnswerCount {
    /// The rest of the last frame of the body.
    rest: Option<CountedBytes>,
    reader: Arc<Reader>,
    request: OpenRequest,
}

impl FrameFilter for AnswerCount {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        if self.rest.is_none() {
            match next_frame(inner, cx) {
                Poll::Ready(Some(Ok(frame))) => match frame.into_data() {
                    Ok(data) => self.rest = Some(CountedBytes::new(data, &self.reader)),
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                other => return other,
            }
        }
        self.request.sent();
        let chunk = self.rest.as_mut().map(CountedBytes::take_chunk);
        self.rest.take_if(|rest| rest.bytes.is_empty());
        Poll::Ready(chunk.map(|chunk| Ok(Frame::data(chunk))))
    }

    fn is_empty(&self) -> bool {
        self.rest.is_none()
    }
}

/// Bytes that count until they are dropped.
struct CountedBytes {
    bytes: Bytes,
    /// When they began to wait, by the reader's clock.
    since: u64,
    reader: Arc<Reader>,
}

impl CountedBytes {
    fn new(bytes: Bytes, reader: &Arc<Reader>) -> Self {
        Self {
            since: reader.add(bytes.len()),
            bytes,
            reader: Arc::clone(reader),
        }
    }

    /// Splits off the first chunk, which then counts for itself.
    fn take_chunk(&mut self) -> Bytes {
        let chunk = self.bytes.split_to(self.bytes.len().min(CHUNK));
        Bytes::from_owner(Self {
            bytes: chunk,
            since: self.since,
            reader: Arc::clone(&self.reader),
        })
    }
}

impl AsRef<[u8]> for CountedBytes {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl Drop for CountedBytes {
    fn drop(&mut self) {
        self.reader.remove(self.bytes.len(), self.since);
    }
}

/// Counts the bytes of a request that have arrived until it is dropped.
#[derive(Debug)]
pub(crate) struct ArrivingBytes {
    reader: Arc<Reader>,
    most: usize,
    counted: Mutex<WaitingBytes>,
}

impl ArrivingBytes {
    fn add(&self, bytes: usize) {
        let mut counted = locked(&self.counted);
        let bytes = bytes.min(self.most.saturating_sub(counted.bytes));
        if bytes > 0 {
            counted.add(bytes, self.reader.begin(bytes));
        }
    }
}

/// The last owner ends the count: a body that another thread reads meanwhile may still add to it.
impl Drop for ArrivingBytes {
    fn drop(&mut self) {
        self.reader.end(*locked(&self.counted));
    }
}

/// Counts the bytes of a request, up to so many.
pub(crate) fn arriving(request: Request<Body>, most: usize) -> (Request<Body>, Option<Arc<ArrivingBytes>>) {
    let Some(reader) = request.extensions().get::<Arc<Reader>>() else {
        return (request, None);
    };
    let bytes = Arc::new(ArrivingBytes {
        reader: Arc::clone(reader),
        most,
        counted: Mutex::default(),
    });
    let counting = ArrivalCount(Arc::downgrade(&bytes));
    let request = request.map(|inner| filtered(inner, counting));
    (request, Some(bytes))
}

struct ArrivalCount(Weak<ArrivingBytes>);

impl FrameFilter for ArrivalCount {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        let polled = next_frame(inner, cx);
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(data) = frame.data_ref()
            && let Some(counting) = self.0.upgrade()
        {
            counting.add(data.len());
        }
        polled
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use futures_util::FutureExt as _;
    use http_body_util::{BodyExt as _, Full};

    use super::*;
    use crate::{client::Client, net::connections::Connections};

    #[tokio::test]
    async fn chunks_count_until_they_are_dropped() {
        let all = Connections::new(1, usize::MAX);
        let content: Vec<u8> = (0..3 * CHUNK + 5).map(|byte| byte as u8).collect();
        let connection = all.admit(&Client::Local).expect("there is a place");
        let counting = AnswerCount {
            rest: None,
            reader: Arc::clone(&connection),
            request: connection.begin_request(),
        };
        let mut body = filtered(Body::new(Full::new(content.clone().into())), counting);
        let mut chunks = Vec::new();
        while let Some(frame) = body.frame().await {
            chunks.push(frame.expect("it does not fail").into_data().expect("it is data"));
            assert_eq!(all.unread_bytes(), content.len());
        }
        assert_eq!(chunks.concat(), content);
        assert_eq!(chunks.len(), 4);
        let first = chunks.remove(0);
        drop(chunks);
        assert_eq!(all.unread_bytes(), CHUNK);
        drop(first);
        assert_eq!(all.unread_bytes(), 0);
    }

    #[test]
    fn nothing_counts_of_a_body_that_is_read_while_its_request_ends() {
        let all = Connections::new(1, usize::MAX);
        let reader = all.admit(&Client::Local).expect("there is a place");
        for _ in 0..2_000 {
            let arriving = Arc::new(ArrivingBytes {
                reader: Arc::clone(&reader),
                most: usize::MAX,
                counted: Mutex::default(),
            });
            let counting = ArrivalCount(Arc::downgrade(&arriving));
            let body = filtered(Body::new(Full::new("request".into())), counting);
            thread::scope(|scope| {
                scope.spawn(|| body.collect().now_or_never());
                scope.spawn(|| drop(arriving));
            });
            assert_eq!(all.unread_bytes(), 0);
        }
    }
}
