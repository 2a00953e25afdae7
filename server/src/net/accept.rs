//! The accept loop.
//!
//! It replaces the transport's loop, which retries immediately when an accept fails: with all file descriptors in use,
//! that costs most of a core.

use std::{io, sync::Arc, time::Duration};

use tokio::{
    net::TcpListener,
    sync::{Semaphore, mpsc},
};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;

use super::{Connection, unread::UnreadAnswers};

/// First pause after an accept failed for lack of resources; doubles up to [`MAX_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(10);

/// Longest pause, and so the longest delay after resources are free again.
const MAX_PAUSE: Duration = Duration::from_secs(1);

/// Bounds on connections.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AcceptLimits {
    /// Largest number of connections; others wait in the kernel's queue.
    pub connections: usize,
    /// Longest wait for a client's HTTP/2 preface, or as many bytes of a request.
    pub preface: Duration,
    /// Largest headers of an HTTP/1 request, in bytes.
    pub headers: usize,
    /// Largest number of concurrent calls per connection; more are rejected.
    pub calls: usize,
}

/// Accepts connections until `stop`, which closes the listener immediately. `close` ends every connection.
pub(crate) fn accept(
    listener: TcpListener,
    limits: AcceptLimits,
    unread: Arc<UnreadAnswers>,
    stop: CancellationToken,
    close: CancellationToken,
) -> ReceiverStream<io::Result<Connection>> {
    // One connection may wait while the transport sets up the previous one.
    let (sender, receiver) = mpsc::channel(1);
    tokio::spawn(async move {
        let accepting = accept_all(listener, limits, unread, close, sender);
        stop.run_until_cancelled_owned(accepting).await;
    });
    ReceiverStream::new(receiver)
}

async fn accept_all(
    listener: TcpListener,
    limits: AcceptLimits,
    unread: Arc<UnreadAnswers>,
    close: CancellationToken,
    sender: mpsc::Sender<io::Result<Connection>>,
) {
    let places = Arc::new(Semaphore::new(limits.connections));
    let mut pause = FIRST_PAUSE;
    // The semaphore is never closed.
    while let Ok(place) = Arc::clone(&places).acquire_owned().await {
        match listener.accept().await {
            Ok((stream, _)) => {
                pause = FIRST_PAUSE;
                // Small messages must not wait for others. If this fails, the first read fails too.
                let _ = stream.set_nodelay(true);
                let connection = Connection::new(stream, place, unread.connect(), close.clone(), limits);
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
