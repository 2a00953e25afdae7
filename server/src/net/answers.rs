//! The layers that reject calls of clients that have too many or for which too much waits, and that count what waits; with the body
//! that counts.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use bytes::Bytes;
use http::{Request, Response};
use http_body::Frame;
use tonic::{Status, body::Body};
use tower::{Layer, Service};

use super::{
    ConnectionInfo,
    unread::{Answering, Reader},
};

/// Largest chunk that is handed to the transport at once, in bytes: what a slow client takes of it shows.
const CHUNK: usize = 32 << 10;

/// Rejects calls of connections that have too many, or on which too much waits unread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdmitLayer;

impl<S> Layer<S> for AdmitLayer {
    type Service = AdmitService<S>;

    fn layer(&self, inner: S) -> Self::Service {
        AdmitService(inner)
    }
}

/// A service in its [`AdmitLayer`].
#[derive(Clone, Debug)]
pub(crate) struct AdmitService<S>(S);

impl<S, B> Service<Request<B>> for AdmitService<S>
where
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Response<Body>, S::Error>> + Send>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.0.poll_ready(cx)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let connection = request.extensions().get::<ConnectionInfo>();
        let place = match connection.map(|connection| connection.calls.take()).transpose() {
            Ok(place) => place,
            Err(error) => return Box::pin(std::future::ready(Ok(Status::from(error).into_http()))),
        };
        let reader = reader_of(&request);
        let answer = self.0.call(request);
        Box::pin(async move {
            let answer = answer.await?;
            drop(place);
            match reader.map(|reader| reader.admit()) {
                Some(Err(error)) => Ok(Status::from(error).into_http()),
                _ => Ok(answer),
            }
        })
    }
}

/// What waits on a request's connection.
fn reader_of<B>(request: &Request<B>) -> Option<Arc<Reader>> {
    let connection = request.extensions().get::<ConnectionInfo>();
    connection.map(|connection| Arc::clone(&connection.reader))
}

/// Counts the answers of the services inside, and the requests that wait for them. Outermost, because other layers may copy
/// answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnreadLayer;

impl<S> Layer<S> for UnreadLayer {
    type Service = UnreadService<S>;

    fn layer(&self, inner: S) -> Self::Service {
        UnreadService(inner)
    }
}

/// A service in its [`UnreadLayer`].
#[derive(Clone, Debug)]
pub(crate) struct UnreadService<S>(S);

impl<S, B> Service<Request<B>> for UnreadService<S>
where
    S: Service<Request<B>, Response = Response<Body>>,
    S::Future: Send + 'static,
    S::Error: Send + 'static,
{
    type Response = Response<Body>;
    type Error = S::Error;
    type Future = Pin<Box<dyn Future<Output = Result<Response<Body>, S::Error>> + Send>>;

    fn poll_ready(&mut self, cx: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.0.poll_ready(cx)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let reader = reader_of(&request);
        let answering = reader.as_ref().map(Reader::answering);
        let answer = self.0.call(request);
        Box::pin(async move {
            let answer = answer.await?;
            let (Some(reader), Some(answering)) = (reader, answering) else {
                return Ok(answer);
            };
            Ok(answer.map(|body| {
                Body::new(CountedBody {
                    inner: body,
                    rest: None,
                    reader,
                    _answering: answering,
                })
            }))
        })
    }
}

/// A body whose chunks count until they are dropped.
struct CountedBody {
    inner: Body,
    /// What is left of the last frame of the inner body.
    rest: Option<Counted>,
    reader: Arc<Reader>,
    _answering: Answering,
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
                    Ok(data) => self.rest = Some(Counted::new(data, &self.reader)),
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                other => return other,
            }
        }
        let chunk = self.rest.as_mut().map(Counted::take_chunk);
        self.rest.take_if(|rest| rest.bytes.is_empty());
        Poll::Ready(chunk.map(|chunk| Ok(Frame::data(chunk))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_none() && self.inner.is_end_stream()
    }
}

/// Bytes that count until they are dropped.
struct Counted {
    bytes: Bytes,
    /// Since when they wait, as the reader counts.
    since: u64,
    reader: Arc<Reader>,
}

impl Counted {
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

impl AsRef<[u8]> for Counted {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.reader.remove(self.bytes.len(), self.since);
    }
}

#[cfg(test)]
mod tests {
    use http_body_util::{BodyExt as _, Full};

    use super::*;
    use crate::net::unread::UnreadAnswers;

    fn counted(content: Vec<u8>, reader: &Arc<Reader>) -> CountedBody {
        CountedBody {
            inner: Body::new(Full::new(Bytes::from(content))),
            rest: None,
            reader: Arc::clone(reader),
            _answering: reader.answering(),
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
}
