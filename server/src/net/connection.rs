//! A connection that the server can close at any time.

use std::{
    io,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::TcpStream,
    sync::OwnedSemaphorePermit,
    time::Sleep,
};
use tokio_util::sync::{CancellationToken, WaitForCancellationFutureOwned};
use tonic::transport::server::Connected;

use super::unread::Reader;

/// Bytes of the client's HTTP/2 preface (RFC 9113, 3.4).
const PREFACE_BYTES: usize = 24;

/// A TCP connection that counts to the server's limit. Reading ends when the server closes the connection, and fails if
/// the client does not send the HTTP/2 preface in time, for which the transport would wait forever. Reading and writing fail
/// once the connection is cut off because its client does not read.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: TcpStream,
    closed: Pin<Box<WaitForCancellationFutureOwned>>,
    cut_off: Pin<Box<WaitForCancellationFutureOwned>>,
    reader: Arc<Reader>,
    preface: Option<Preface>,
    _place: OwnedSemaphorePermit,
}

/// An incomplete preface.
#[derive(Debug)]
struct Preface {
    missing: usize,
    deadline: Pin<Box<Sleep>>,
}

impl Connection {
    /// Wraps an accepted connection.
    pub(crate) fn new(
        stream: TcpStream,
        place: OwnedSemaphorePermit,
        reader: Arc<Reader>,
        close: CancellationToken,
        preface_time: Duration,
    ) -> Self {
        Self {
            stream,
            closed: Box::pin(close.cancelled_owned()),
            cut_off: Box::pin(reader.cut_off().cancelled_owned()),
            reader,
            preface: Some(Preface {
                missing: PREFACE_BYTES,
                deadline: Box::pin(tokio::time::sleep(preface_time)),
            }),
            _place: place,
        }
    }

    /// Fails once the connection is cut off.
    fn check_cut_off(&mut self, cx: &mut Context<'_>) -> io::Result<()> {
        match self.cut_off.as_mut().poll(cx) {
            Poll::Ready(()) => Err(io::ErrorKind::ConnectionAborted.into()),
            Poll::Pending => Ok(()),
        }
    }
}

/// What requests know of their connection.
#[derive(Clone, Debug)]
pub(crate) struct ConnectionInfo {
    /// What of the answers waits for the client.
    pub(super) reader: Arc<Reader>,
}

impl Connected for Connection {
    type ConnectInfo = ConnectionInfo;

    fn connect_info(&self) -> ConnectionInfo {
        ConnectionInfo {
            reader: Arc::clone(&self.reader),
        }
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
        let read = Pin::new(&mut self.stream).poll_read(cx, buffer);
        if let Some(preface) = &mut self.preface {
            preface.missing = preface.missing.saturating_sub(buffer.filled().len() - before);
            if preface.missing == 0 {
                self.preface = None;
            } else if preface.deadline.as_mut().poll(cx).is_ready() {
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
        }
        read
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
    use std::sync::Arc;

    use tokio::{
        io::{AsyncReadExt as _, AsyncWriteExt as _},
        net::TcpListener,
        sync::Semaphore,
    };

    use super::*;
    use crate::net::unread::UnreadAnswers;

    /// A client's end, and the server's end of the same connection.
    async fn connected(close: CancellationToken, preface_time: Duration) -> (TcpStream, Connection) {
        let reader = UnreadAnswers::new(usize::MAX).connect();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        let (stream, _) = listener.accept().await.unwrap();
        let place = Arc::new(Semaphore::new(1)).acquire_owned().await.unwrap();
        (
            client,
            Connection::new(stream, place, reader, close, preface_time),
        )
    }

    #[tokio::test]
    async fn reading_fails_without_a_preface() {
        let (mut client, mut connection) =
            connected(CancellationToken::new(), Duration::from_millis(20)).await;
        client.write_all(b"PRI * HTTP/2.0").await.unwrap();
        let mut read = Vec::new();
        let error = connection.read_to_end(&mut read).await.unwrap_err();
        assert_eq!(
            (error.kind(), read.as_slice()),
            (io::ErrorKind::TimedOut, &b"PRI * HTTP/2.0"[..])
        );
    }

    #[tokio::test]
    async fn after_the_preface_reading_lasts_until_close() {
        let close = CancellationToken::new();
        let (mut client, mut connection) = connected(close.clone(), Duration::from_millis(20)).await;
        client.write_all(&[b'x'; PREFACE_BYTES]).await.unwrap();
        connection.read_exact(&mut [0; PREFACE_BYTES]).await.unwrap();
        let reading = tokio::spawn(async move { connection.read_to_end(&mut Vec::new()).await });
        // Longer than the limit for the preface.
        tokio::time::sleep(Duration::from_millis(60)).await;
        assert!(!reading.is_finished());
        close.cancel();
        assert_eq!(reading.await.unwrap().unwrap(), 0);
        drop(client);
    }
}
