//! Counts requests until they are answered: clients may begin more than they end.

use std::{
    pin::Pin,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    task::{Context, Poll},
};

use bytes::Bytes;
use http::Request;
use http_body::{Frame, SizeHint};
use tonic::{Status, body::Body};

use super::{
    ConnectionInfo,
    unread::{Reader, Waiting},
};

/// The bytes of a request that have arrived, which count until this is dropped.
#[derive(Debug)]
pub(crate) struct Arriving {
    _counter: Arc<Counter>,
}

#[derive(Debug)]
struct Counter {
    reader: Arc<Reader>,
    /// Largest number of bytes that count.
    most: usize,
    counted: Mutex<Waiting>,
}

impl Counter {
    fn add(&self, bytes: usize) {
        let mut counted = self.counted();
        let bytes = bytes.min(self.most.saturating_sub(counted.bytes));
        if bytes > 0 {
            counted.add(bytes, self.reader.begin(bytes));
        }
    }

    fn counted(&self) -> MutexGuard<'_, Waiting> {
        // No code panics while it holds the lock.
        self.counted.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The last owner ends the count: a body that another thread reads meanwhile may still add to it.
impl Drop for Counter {
    fn drop(&mut self) {
        self.reader.end(*self.counted());
    }
}

/// Counts the bytes of a request, up to so many.
pub(crate) fn arriving(request: Request<Body>, most: usize) -> (Request<Body>, Option<Arriving>) {
    let Some(connection) = request.extensions().get::<ConnectionInfo>() else {
        return (request, None);
    };
    let counter = Arc::new(Counter {
        reader: Arc::clone(&connection.reader),
        most,
        counted: Mutex::default(),
    });
    let counting = Arc::downgrade(&counter);
    let request = request.map(|inner| Body::new(ArrivingBody { inner, counting }));
    (request, Some(Arriving { _counter: counter }))
}

/// A body whose bytes count as long as [`Arriving`] lives.
struct ArrivingBody {
    inner: Body,
    counting: std::sync::Weak<Counter>,
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

    #[test]
    fn nothing_counts_of_a_body_that_is_read_while_its_request_ends() {
        let all = UnreadAnswers::new(usize::MAX);
        let reader = all.connect();
        for _ in 0..2_000 {
            let counter = Arc::new(Counter {
                reader: Arc::clone(&reader),
                most: usize::MAX,
                counted: Mutex::default(),
            });
            let body = ArrivingBody {
                inner: Body::new(Full::new(Bytes::from_static(b"request"))),
                counting: Arc::downgrade(&counter),
            };
            let arriving = Arriving { _counter: counter };
            thread::scope(|scope| {
                scope.spawn(|| body.collect().now_or_never());
                scope.spawn(|| drop(arriving));
            });
            assert_eq!(all.bytes(), 0);
        }
    }
}
