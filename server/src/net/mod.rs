//! Accepts connections, bounds their number, calls, unread answers and arriving bytes, and closes them.
//!
//! The accept loop replaces the transport's, which retries immediately when an accept fails: with all file descriptors in use,
//! that costs most of a core.

mod answers;
mod unread;

use std::{
    io,
    pin::Pin,
    sync::{Arc, atomic::Ordering},
    task::{Context, Poll},
    time::Duration,
};

use futures_util::future::select_all;
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    sync::{OwnedSemaphorePermit, Semaphore, mpsc},
    time::Sleep,
};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};
use tonic::transport::server::Connected;

use crate::{
    client::Client,
    listen::{Listener, Stream},
};
pub(crate) use answers::{UnreadCount, arriving};
pub(crate) use unread::{Reader, UnreadAnswers};

/// Largest headers of a request, in bytes.
pub(crate) const MAX_HEADERS: usize = 16 << 10;

/// Longest wait for a client's HTTP/2 preface, or as many bytes of a request.
const PREFACE_TIME: Duration = Duration::from_secs(10);

/// First pause after an accept failed for lack of resources; doubles up to [`MAX_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(10);

/// Longest pause, and so the longest delay after resources are free again.
const MAX_PAUSE: Duration = Duration::from_secs(1);

const PREFACE: &[u8; 24] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Largest part of an HTTP/1 request's headers that is read at once, in bytes.
const HEADERS_READ: usize = 4 << 10;

/// Accepts connections until `stop`, which closes the listeners immediately; beyond `most` open ones of all listeners together, others
/// wait in the kernel's queue. `close` ends every connection.
pub(crate) fn accept(
    mut listeners: Vec<Listener>,
    most: usize,
    unread: Arc<UnreadAnswers>,
    stop: CancellationToken,
    close: CancellationToken,
) -> ReceiverStream<io::Result<Connection>> {
    // One connection may wait while the transport sets up the previous one.
    let (sender, receiver) = mpsc::channel(1);
    let accepting = async move {
        let places = Arc::new(Semaphore::new(most));
        let mut pause = FIRST_PAUSE;
        // The semaphore is never closed.
        while let Ok(place) = Arc::clone(&places).acquire_owned().await {
            match accept_any(&mut listeners).await {
                Ok((stream, client)) => {
                    pause = FIRST_PAUSE;
                    let connection = Connection::new(stream, place, unread.connect(client), close.clone());
                    if sender.send(Ok(connection)).await.is_err() {
                        return;
                    }
                }
                Err(error) if concerns_one_connection(&error) => {
                    tracing::debug!(%error, "a connection ended before it was accepted");
                }
                Err(error) => {
                    tracing::warn!(%error, ?pause, "cannot accept connections");
                    tokio::time::sleep(pause).await;
                    pause = (pause * 2).min(MAX_PAUSE);
                }
            }
        }
    };
    tokio::spawn(stop.run_until_cancelled_owned(accepting));
    ReceiverStream::new(receiver)
}

/// The next connection of any listener. The one that had it comes last the next time.
async fn accept_any(listeners: &mut [Listener]) -> io::Result<(Stream, Client)> {
    let accepting = listeners.iter().map(|listener| Box::pin(listener.accept()));
    let (stream, index, others) = select_all(accepting).await;
    drop(others);
    listeners.rotate_left(index + 1);
    stream
}

/// True if only one connection is lost. All other errors are a lack of resources.
fn concerns_one_connection(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionAborted
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::Interrupted
    )
}

/// A connection that counts to the server's limit. Reading fails if the client does not send as many bytes as the HTTP/2
/// preface has in time, or if the headers of an HTTP/1 request are too large; reading and writing fail once the connection is cut
/// off.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: Stream,
    closed: Pin<Box<WaitForCancellationFutureOwned>>,
    cut_off: Pin<Box<WaitForCancellationFutureOwned>>,
    reader: Arc<Reader>,
    preface: Option<Preface>,
    /// `None` as long as the client may speak HTTP/2.
    headers: Option<Headers>,
    _place: OwnedSemaphorePermit,
}

#[derive(Debug)]
struct Preface {
    missing: usize,
    deadline: Pin<Box<Sleep>>,
}

/// The headers of HTTP/1 requests, which come one after the other.
#[derive(Debug)]
struct Headers {
    /// The requests whose headers have been read.
    requests: u64,
    /// Bytes read since then, without the rest of that request.
    read: usize,
}

impl Connection {
    fn new(
        stream: Stream,
        place: OwnedSemaphorePermit,
        reader: Arc<Reader>,
        close: CancellationToken,
    ) -> Self {
        Self {
            stream,
            closed: Box::pin(close.cancelled_owned()),
            cut_off: Box::pin(reader.cut_off.clone().cancelled_owned()),
            reader,
            preface: Some(Preface {
                missing: PREFACE.len(),
                deadline: Box::pin(tokio::time::sleep(PREFACE_TIME)),
            }),
            headers: None,
            _place: place,
        }
    }

    fn check_cut_off(&mut self, cx: &mut Context<'_>) -> io::Result<()> {
        match self.cut_off.as_mut().poll(cx) {
            Poll::Ready(()) => Err(io::ErrorKind::ConnectionAborted.into()),
            Poll::Pending => Ok(()),
        }
    }

    /// Reads from the socket; of an HTTP/1 request's headers no more than allowed.
    fn poll_read_within_limits(
        &mut self,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let Some(headers) = &mut self.headers else {
            return Pin::new(&mut self.stream).poll_read(cx, buffer);
        };
        let requests = self.reader.requests.load(Ordering::Relaxed);
        if headers.requests != requests {
            *headers = Headers { requests, read: 0 };
        }
        if !self.reader.awaits_headers() {
            return Pin::new(&mut self.stream).poll_read(cx, buffer);
        }
        let left = MAX_HEADERS.saturating_sub(headers.read);
        if left == 0 {
            tracing::debug!("closing a connection whose request has too large headers");
            return Poll::Ready(Err(io::ErrorKind::InvalidData.into()));
        }
        let mut part = [0; HEADERS_READ];
        let most = left.min(HEADERS_READ).min(buffer.remaining());
        let mut part = ReadBuf::new(&mut part[..most]);
        let read = Pin::new(&mut self.stream).poll_read(cx, &mut part);
        headers.read += part.filled().len();
        buffer.put_slice(part.filled());
        read
    }
}

impl Connected for Connection {
    type ConnectInfo = Arc<Reader>;

    fn connect_info(&self) -> Arc<Reader> {
        Arc::clone(&self.reader)
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.check_cut_off(cx)?;
        if self.closed.as_mut().poll(cx).is_ready() {
            // Reading 0 bytes means the end of the stream.
            return Poll::Ready(Ok(()));
        }
        let before = buffer.filled().len();
        let this = &mut *self;
        let polled = this.poll_read_within_limits(cx, buffer);
        if let Some(preface) = &mut this.preface {
            let read = &buffer.filled()[before..];
            let from = PREFACE.len() - preface.missing;
            let compared = read.len().min(preface.missing);
            preface.missing -= compared;
            if this.headers.is_none() && read[..compared] != PREFACE[from..from + compared] {
                this.headers = Some(Headers {
                    requests: 0,
                    read: from + read.len(),
                });
            }
            if preface.missing == 0 {
                this.preface = None;
            } else if preface.deadline.as_mut().poll(cx).is_ready() {
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
        }
        polled
    }
}

impl AsyncWrite for Connection {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buffer: &[u8]) -> Poll<io::Result<usize>> {
        self.check_cut_off(cx)?;
        Pin::new(&mut self.stream).poll_write(cx, buffer)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffers: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.check_cut_off(cx)?;
        Pin::new(&mut self.stream).poll_write_vectored(cx, buffers)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use tokio::{
        io::{AsyncReadExt as _, AsyncWriteExt as _},
        net::TcpStream,
    };

    use super::*;

    #[tokio::test]
    async fn headers_of_http_1_are_bounded_and_bodies_are_not() {
        let reader = UnreadAnswers::new(usize::MAX).connect(Client::Local);
        let listener = Listener::bind(&"127.0.0.1:0".parse().unwrap()).await.unwrap();
        let address = listener.address().unwrap().to_string();
        let mut client = TcpStream::connect(address).await.unwrap();
        let (stream, _) = listener.accept().await.unwrap();
        let place = Arc::new(Semaphore::new(1)).acquire_owned().await.unwrap();
        let mut connection = Connection::new(stream, place, Arc::clone(&reader), CancellationToken::new());
        let sending = tokio::spawn(async move {
            // More than is read before reading fails.
            let _ = client.write_all(&vec![b'P'; 20 * MAX_HEADERS]).await;
            client
        });
        connection.read_exact(&mut [0; 1000]).await.unwrap();
        // A request with headers of 1000 bytes and a long body.
        let answering = reader.answering();
        let mut body = vec![0; 5 * MAX_HEADERS];
        connection.read_exact(&mut body).await.unwrap();
        // Its answer has ended; the rest is headers of the next one.
        drop(answering);
        let mut read = Vec::new();
        let error = connection.read_to_end(&mut read).await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
        assert!(read.len() <= MAX_HEADERS, "{} bytes", read.len());
        // After another request, as many bytes of headers may arrive again.
        drop(reader.answering());
        let mut next = vec![0; MAX_HEADERS];
        connection.read_exact(&mut next).await.unwrap();
        let error = connection.read_exact(&mut [0; 1]).await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
        drop(sending);
    }
}
