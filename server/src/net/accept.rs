//! The accept loop.
//!
//! It is the server's own because the transport's loop tries again at once when an accept fails: with all file
//! descriptors in use, that costs most of a core.

use std::{io, sync::Arc, time::Duration};

use tokio::{
    net::TcpListener,
    sync::{Semaphore, mpsc},
};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;

use super::Connection;

/// First pause after an accept failed for want of resources; doubled up to [`LONGEST_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(10);

/// Longest pause: how late the server may notice that resources are there again.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// What bounds the connections.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AcceptLimits {
    /// How many there may be; others wait in the kernel's queue.
    pub connections: usize,
    /// How long a client may take to send the preface of HTTP/2.
    pub preface: Duration,
}

/// Accepts connections until `stop`; then the listener is closed at once. `close` ends every connection.
pub(crate) fn accept(
    listener: TcpListener,
    limits: AcceptLimits,
    stop: CancellationToken,
    close: CancellationToken,
) -> ReceiverStream<io::Result<Connection>> {
    // One connection waits while the transport sets up the one before.
    let (sender, receiver) = mpsc::channel(1);
    tokio::spawn(async move {
        let accepting = accept_all(listener, limits, close, sender);
        stop.run_until_cancelled_owned(accepting).await;
    });
    ReceiverStream::new(receiver)
}

async fn accept_all(
    listener: TcpListener,
    limits: AcceptLimits,
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
                // Small messages must not wait for others. A connection that is gone already shows at its first read.
                let _ = stream.set_nodelay(true);
                let connection = Connection::new(stream, place, close.clone(), limits.preface);
                if sender.send(Ok(connection)).await.is_err() {
                    return;
                }
            }
            Err(error) if is_of_the_connection(&error) => {
                tracing::debug!(%error, "a connection ended before it was accepted");
            }
            Err(error) => {
                tracing::warn!(%error, ?pause, "cannot accept connections");
                tokio::time::sleep(pause).await;
                pause = (pause * 2).min(LONGEST_PAUSE);
            }
        }
    }
}

/// Is it only the one connection that is lost? Everything else is a want of resources.
fn is_of_the_connection(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionAborted
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
            | io::ErrorKind::Interrupted
    )
}
