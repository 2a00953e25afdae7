//! Counts answers until they are read, and requests until they are answered: clients may begin more than they end.

use std::{
    pin::Pin,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
    task::{Context, Poll},
};

use bytes::Bytes;
use http::{Request, Response};
use http_body::{Frame, SizeHint};
use tonic::{Status, body::Body};

use super::unread::{Reader, WaitingBytes};
use crate::middleware::{Answer, Middleware};

/// Largest chunk that is handed to the transport at once, in bytes: what a slow client takes of it shows.
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
        let open = reader.as_ref().map(|reader| reader.answering());
        let answer = next(request);
        Box::pin(async move {
            let answer = answer.await?;
            let Some(reader) = reader else { return Ok(answer) };
            Ok(answer.map(|inner| {
                Body::new(CountedBody {
                    inner,
                    rest: None,
                    reader,
                    _open: open,
                })
            }))
        })
    }
}

/// A body whose chunks count until they are dropped.
struct CountedBody {
    inner: Body,
    /// What is left of the last frame of the inner body.
    rest: Option<CountedBytes>,
    reader: Arc<Reader>,
    _open: Option<Arc<()>>,
}

impl http_body::Body for CountedBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if self.rest.is_none() {
            match Pin::new(&mut self.inner).poll_frame(cx) {
                Poll::Ready(Some(Ok(frame))) => match frame.into_data() {
                    Ok(data) => self.rest = Some(CountedBytes::new(data, &self.reader)),
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                other => return other,
            }
        }
        let chunk = self.rest.as_mut().map(CountedBytes::take_chunk);
        self.rest.take_if(|rest| rest.bytes.is_empty());
        Poll::Ready(chunk.map(|chunk| Ok(Frame::data(chunk))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_none() && self.inner.is_end_stream()
    }
}

/// Bytes that count until they are dropped.
struct CountedBytes {
    bytes: Bytes,
    /// Since when they wait, as the reader counts.
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
    /// Largest number of bytes that count.
    most: usize,
    counted: Mutex<WaitingBytes>,
}

impl ArrivingBytes {
    fn add(&self, bytes: usize) {
        let mut counted = self.counted();
        let bytes = bytes.min(self.most.saturating_sub(counted.bytes));
        if bytes > 0 {
            counted.add(bytes, self.reader.begin(bytes));
        }
    }

    fn counted(&self) -> MutexGuard<'_, WaitingBytes> {
        // No code panics while it holds the lock.
        self.counted.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The last owner ends the count: a body that another thread reads meanwhile may still add to it.
impl Drop for ArrivingBytes {
    fn drop(&mut self) {
        self.reader.end(*self.counted());
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
    let counting = Arc::downgrade(&bytes);
    let request = request.map(|inner| Body::new(ArrivingBody { inner, counting }));
    (request, Some(bytes))
}

/// A body whose bytes count as long as [`ArrivingBytes`] lives.
struct ArrivingBody {
    inner: Body,
    counting: Weak<ArrivingBytes>,
}

impl http_body::Body for ArrivingBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let polled = Pin::new(&mut self.inner).poll_frame(cx);
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(data) = frame.data_ref()
            && let Some(counting) = self.counting.upgrade()
        {
            counting.add(data.len());
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use futures_util::FutureExt as _;
    use http_body_util::{BodyExt as _, Full};

    use super::*;
    use crate::net::unread::UnreadAnswers;

    fn counted(content: Vec<u8>, reader: &Arc<Reader>) -> CountedBody {
        CountedBody {
            inner: Body::new(Full::new(Bytes::from(content))),
            rest: None,
            reader: Arc::clone(reader),
            _open: None,
        }
    }

    #[tokio::test]
    async fn chunks_count_until_they_are_dropped() {
        let all = UnreadAnswers::new(usize::MAX);
        let content: Vec<u8> = (0..3 * CHUNK + 5).map(|byte| byte as u8).collect();
        let mut body = counted(content.clone(), &all.connect());
        let mut chunks = Vec::new();
        while let Some(frame) = body.frame().await {
            chunks.push(frame.expect("it does not fail").into_data().expect("it is data"));
            assert_eq!(all.bytes(), content.len());
        }
        assert_eq!(chunks.concat(), content);
        assert_eq!(chunks.len(), 4);
        let first = chunks.remove(0);
        drop(chunks);
        assert_eq!(all.bytes(), CHUNK);
        drop(first);
        assert_eq!(all.bytes(), 0);
    }

    #[test]
    fn nothing_counts_of_a_body_that_is_read_while_its_request_ends() {
        let all = UnreadAnswers::new(usize::MAX);
        let reader = all.connect();
        for _ in 0..2_000 {
            let arriving = Arc::new(ArrivingBytes {
                reader: Arc::clone(&reader),
                most: usize::MAX,
                counted: Mutex::default(),
            });
            let body = ArrivingBody {
                inner: Body::new(Full::new(Bytes::from_static(b"request"))),
                counting: Arc::downgrade(&arriving),
            };
            thread::scope(|scope| {
                scope.spawn(|| body.collect().now_or_never());
                scope.spawn(|| drop(arriving));
            });
            assert_eq!(all.bytes(), 0);
        }
    }
}
