//! The accept loop.

use std::{io, sync::Arc, time::Duration};

use futures_util::future::select_all;
use tokio_util::{sync::CancellationToken, task::TaskTracker};

use super::{
    connections::Connections,
    serving::{ConnectionServer, Service},
};
use crate::{
    client::Client,
    listen::{Listener, Stream},
};

/// First pause after an accept failed for lack of resources; doubles up to [`MAX_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_millis(10);

/// Longest pause, and so the longest delay after resources are free again.
const MAX_PAUSE: Duration = Duration::from_millis(500);

/// Accepts and serves connections until `stop`, which closes the listeners immediately, and returns when all connections have ended.
/// Each one is accepted before it is judged: beyond its client's share of the places, it is closed unless an idle one makes room.
pub(crate) async fn accept<S: Service>(
    mut listeners: Vec<Listener>,
    connections: Arc<Connections>,
    server: ConnectionServer<S>,
    stop: CancellationToken,
) {
    let tasks = TaskTracker::new();
    let spawning = tasks.clone();
    let accepting = async move {
        let mut pause = FIRST_PAUSE;
        loop {
            match accept_any(&mut listeners).await {
                Ok((stream, client)) => {
                    pause = FIRST_PAUSE;
                    if let Some(place) = connections.admit(&client) {
                        spawning.spawn(server.clone().serve(stream, place));
                    } else {
                        tracing::debug!(%client, "refused a connection");
                    }
                }
                Err(error) if concerns_one_connection(&error) => {
                    tracing::debug!(%error, "a connection ended before it was accepted");
                }
                Err(error) => {
                    tracing::warn!(%error, ?pause, "cannot accept connections");
                    connections.make_room();
                    tokio::time::sleep(pause).await;
                    pause = (pause * 2).min(MAX_PAUSE);
                }
            }
        }
    };
    stop.run_until_cancelled(accepting).await;
    tasks.close();
    tasks.wait().await;
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
