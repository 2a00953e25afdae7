//! A connection that can be ended from outside.

use std::{
    io,
    pin::Pin,
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
use tonic::transport::server::{Connected, TcpConnectInfo};

/// Bytes of the client's HTTP/2 preface (RFC 9113, 3.4).
const PREFACE_BYTES: usize = 24;

/// A TCP connection that holds one of the server's places. Reading ends when the server closes, or when the client
/// did not send the preface of HTTP/2 in time: the transport waits for that without end.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: TcpStream,
    closed: Pin<Box<WaitForCancellationFutureOwned>>,
    preface: Option<Preface>,
    _place: OwnedSemaphorePermit,
}

/// A preface that is still to come.
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
        close: CancellationToken,
        preface_time: Duration,
    ) -> Self {
        Self {
            stream,
            closed: Box::pin(close.cancelled_owned()),
            preface: Some(Preface {
                missing: PREFACE_BYTES,
                deadline: Box::pin(tokio::time::sleep(preface_time)),
            }),
            _place: place,
        }
    }
}

impl Connected for Connection {
    type ConnectInfo = TcpConnectInfo;

    fn connect_info(&self) -> TcpConnectInfo {
        self.stream.connect_info()
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        use std::future::Future as _;
        if self.closed.as_mut().poll(cx).is_ready() {
            // Nothing read is the end of the stream.
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
        Pin::new(&mut self.stream).poll_write(cx, buffer)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffers: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
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

    /// A client's end, and the server's end of the same connection.
    async fn connected(close: CancellationToken, preface_time: Duration) -> (TcpStream, Connection) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        let (stream, _) = listener.accept().await.unwrap();
        let place = Arc::new(Semaphore::new(1)).acquire_owned().await.unwrap();
        (client, Connection::new(stream, place, close, preface_time))
    }

    #[tokio::test]
    async fn a_client_without_a_preface_is_left() {
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
    async fn after_the_preface_there_is_all_the_time_until_the_end() {
        let close = CancellationToken::new();
        let (mut client, mut connection) = connected(close.clone(), Duration::from_millis(20)).await;
        client.write_all(&[b'x'; PREFACE_BYTES]).await.unwrap();
        connection.read_exact(&mut [0; PREFACE_BYTES]).await.unwrap();
        let reading = tokio::spawn(async move { connection.read_to_end(&mut Vec::new()).await });
        // Longer than the preface may take.
        tokio::time::sleep(Duration::from_millis(60)).await;
        assert!(!reading.is_finished());
        close.cancel();
        assert_eq!(reading.await.unwrap().unwrap(), 0);
        drop(client);
    }
}
