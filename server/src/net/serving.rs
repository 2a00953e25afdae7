//! Serves one connection over HTTP/2 or HTTP/1, until it ends, has no call for too long, or is old.

use std::{
    convert::Infallible,
    hash::{BuildHasher as _, RandomState},
    pin::{Pin, pin},
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use bytes::Bytes;
use http::{Request, Response, Version};
use http_body::Body as _;
use http_body_util::BodyExt as _;
use hyper::{body::Incoming, service::service_fn};
use hyper_util::{
    rt::{TokioExecutor, TokioIo, TokioTimer},
    server::conn::auto,
};
use tokio::time::Instant;
use tokio_util::{either::Either, sync::CancellationToken};
use tonic::{Status, body::Body};
use tower::ServiceExt as _;

use super::{
    connections::ConnectionPlace,
    frames::MIN_DATA,
    reader::{Phase, Reader},
    stream::WatchedStream,
};
use crate::{
    listen::Stream,
    middleware::{FrameFilter, PolledFrame, filtered, next_frame},
    sync::{Mutex, locked},
    tls::{Tls, TlsStream},
};

/// Largest headers of a request, in bytes.
const MAX_HEADERS: usize = 16 << 10;

/// Longest wait for a client's HTTP/2 preface, or as many bytes of a request, with the handshake of TLS.
const PREFACE_TIME: Duration = Duration::from_secs(5);

/// Largest number of open streams per connection.
const STREAMS_PER_CONNECTION: u32 = 100;

/// Largest number of streams that a client may open and reset before the server has seen them: all of its calls, when it gives them
/// up because the server is busy. The budget of frames bounds how often.
const PENDING_RESETS: usize = STREAMS_PER_CONNECTION as usize;

/// Flow-control window of a stream, in bytes.
const STREAM_WINDOW: u32 = 256 << 10;

/// Flow-control window of a connection, in bytes.
const CONNECTION_WINDOW: u32 = 1 << 20;

/// Largest HTTP/2 frame, in bytes.
const MAX_FRAME: u32 = 16 << 10;

/// Largest body of a request that is read although the answer does not need it, in bytes, and the longest wait for it.
const MAX_DRAINED: u64 = 64 << 10;
const DRAIN_TIME: Duration = Duration::from_millis(500);

/// Interval of pings on a silent connection.
const KEEPALIVE_EVERY: Duration = Duration::from_secs(30);

/// Time limit for the answer to a ping.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);

/// How long a client that was told to open no more calls may be without one before its connection is closed.
const GOODBYE: Duration = Duration::from_secs(1);

/// A service that answers every request.
pub(crate) trait Service:
    tower::Service<Request<Body>, Response = Response<Body>, Error = Infallible, Future: Send>
    + Clone
    + Send
    + 'static
{
}

impl<S> Service for S where
    S: tower::Service<Request<Body>, Response = Response<Body>, Error = Infallible, Future: Send>
        + Clone
        + Send
        + 'static
{
}

/// How connections are served.
#[derive(Clone, Debug)]
pub(crate) struct ConnectionServer<S> {
    pub service: S,
    /// Certificates, with which connections of TCP are encrypted.
    pub tls: Option<Arc<Tls>>,
    pub lifetime: Lifetime,
}

/// How long connections are served.
#[derive(Clone, Debug)]
pub(crate) struct Lifetime {
    /// Longest time without a call.
    pub idle: Duration,
    /// Age from which a connection takes no more calls, give or take a tenth.
    pub age: Duration,
    /// Cancelled to end connections when they have no more calls.
    pub stop: CancellationToken,
    /// Cancelled to end connections at once.
    pub close: CancellationToken,
}

impl<S: Service> ConnectionServer<S> {
    /// Serves a connection to its end.
    pub(super) async fn serve(self, stream: Stream, place: ConnectionPlace) {
        let Self {
            service,
            tls,
            mut lifetime,
        } = self;
        let stream = match (tls, stream) {
            (Some(tls), tcp @ Either::Left(_)) => {
                Either::Right(TlsStream::new(tls.config(), tcp, Arc::clone(&place.peer)))
            }
            // A socket of the file system is private without.
            (_, stream) => Either::Left(stream),
        };
        // Of its own, so that connections do not share a lock whenever they are polled.
        for token in [&mut lifetime.stop, &mut lifetime.close] {
            *token = token.child_token();
        }
        let reader = Arc::clone(&place);
        let answering = service_fn(move |request: Request<Incoming>| {
            let is_http_2 = request.version() == Version::HTTP_2;
            let is_short = request
                .body()
                .size_hint()
                .upper()
                .is_some_and(|most| most <= MAX_DRAINED);
            let rest = is_http_2.then(UnreadRest::default);
            let mut request = request.map(|body| match &rest {
                Some(rest) => rest.lend(Body::new(body)),
                None => filtered(Body::new(body), ChunkCount(Arc::clone(&reader))),
            });
            request.extensions_mut().insert(Arc::clone(&reader));
            let answer = service.clone().oneshot(request);
            async move {
                let answer = answer.await?;
                let Some(rest) = rest else { return Ok(answer) };
                if is_short {
                    rest.drain().await;
                }
                Ok::<_, Infallible>(answer.map(|body| filtered(body, rest)))
            }
        });
        let io = TokioIo::new(WatchedStream::new(stream, Arc::clone(&place)));
        let transport = transport();
        let mut connection = pin!(transport.serve_connection(io, answering));
        let leaving = lifetime.until_leaving(&place);
        tokio::select! {
            biased;
            () = lifetime.close.cancelled() => return,
            () = place.closed() => return,
            ended = &mut connection => {
                if let Err(error) = ended {
                    tracing::debug!(%error, client = %place.client, "a connection ended with an error");
                }
                return;
            }
            () = leaving => {}
        }
        connection.as_mut().graceful_shutdown();
        tokio::select! {
            biased;
            () = lifetime.close.cancelled() => {}
            () = place.closed() => {}
            _ = &mut connection => {}
            () = until_idle_for(&place, GOODBYE) => {}
        }
    }
}

impl Lifetime {
    /// Waits until the connection should take no more calls: it is old, idle or without its preface for too long, or the server stops.
    async fn until_leaving(&self, reader: &Reader) {
        // Connections that began together do not end together.
        let old = Instant::now() + self.age.mul_f64(0.9 + 0.2 * random_fraction());
        loop {
            let left = match reader.phase() {
                Phase::Greeting { since } => reader.left(since, PREFACE_TIME),
                Phase::Idle { since } => reader.left(since, self.idle),
                Phase::Answering => self.idle,
            };
            let now = Instant::now();
            if now >= old || left.is_zero() {
                return;
            }
            tokio::select! {
                () = self.stop.cancelled() => return,
                () = tokio::time::sleep_until(old.min(now + left)) => {}
            }
        }
    }
}

/// Waits until a connection has had no call for a time that begins now.
async fn until_idle_for(reader: &Reader, time: Duration) {
    let start = reader.all.now();
    loop {
        let left = match reader.phase() {
            Phase::Greeting { since } | Phase::Idle { since } => reader.left(since.max(start), time),
            Phase::Answering => time,
        };
        if left.is_zero() {
            return;
        }
        tokio::time::sleep(left).await;
    }
}

/// The part of a request's body that nobody reads any more, until the answer has been sent. HTTP/2 resets a stream whose body is
/// dropped before, and its answer is lost.
#[derive(Clone, Default)]
struct UnreadRest(Arc<Mutex<Option<Body>>>);

impl UnreadRest {
    /// A body that comes back when it is dropped before its end.
    fn lend(&self, body: Body) -> Body {
        let rest = self.clone();
        Body::new(LentBody { body, rest })
    }

    /// Reads it, for a client that does not expect its answer before it has sent its request (curl up to 7.88).
    async fn drain(&self) {
        let rest = locked(&self.0).take();
        if let Some(mut rest) = rest {
            let at_end = async { while let Some(Ok(_)) = rest.frame().await {} };
            let _ = tokio::time::timeout(DRAIN_TIME, at_end).await;
            *locked(&self.0) = Some(rest);
        }
    }
}

impl FrameFilter for UnreadRest {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        next_frame(inner, cx)
    }
}

struct LentBody {
    body: Body,
    rest: UnreadRest,
}

impl http_body::Body for LentBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> PolledFrame {
        next_frame(&mut self.body, cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }
}

impl Drop for LentBody {
    fn drop(&mut self) {
        if !self.body.is_end_stream() {
            *locked(&self.rest.0) = Some(std::mem::take(&mut self.body));
        }
    }
}

/// Counts the small chunks of a request over HTTP/1, as frames of HTTP/2 are.
struct ChunkCount(Arc<Reader>);

impl FrameFilter for ChunkCount {
    fn poll(&mut self, inner: &mut Body, cx: &mut Context<'_>) -> PolledFrame {
        let polled = next_frame(inner, cx);
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && frame.data_ref().is_some_and(|data| data.len() < MIN_DATA)
            && !self.0.spend_frames(1)
        {
            return Poll::Ready(Some(Err(Status::cancelled("the connection is being closed"))));
        }
        polled
    }
}

fn transport() -> auto::Builder<TokioExecutor> {
    let mut builder = auto::Builder::new(TokioExecutor::new());
    builder
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(STREAMS_PER_CONNECTION)
        .max_header_list_size(MAX_HEADERS as u32)
        .max_pending_accept_reset_streams(PENDING_RESETS)
        .initial_stream_window_size(STREAM_WINDOW)
        .initial_connection_window_size(CONNECTION_WINDOW)
        .max_frame_size(MAX_FRAME)
        .keep_alive_interval(KEEPALIVE_EVERY)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT);
    // With a timer, the headers of a request have to arrive within 30 s. The buffer bounds their size, and that of requests that wait
    // for the answers to others.
    builder.http1().timer(TokioTimer::new()).max_buf_size(MAX_HEADERS);
    builder
}

/// A number from 0 to 1, from the standard library's randomly keyed hasher.
fn random_fraction() -> f64 {
    f64::from((RandomState::new().hash_one(0_u8) >> 32) as u32) / f64::from(u32::MAX)
}
