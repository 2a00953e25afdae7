//! The server inside the process.

use std::{net::Ipv4Addr, net::Ipv6Addr, net::SocketAddr, time::Duration};

use grasp_client::GraspClient;
use grasp_server::{Config, ServeError};
use tokio::{net::TcpListener, sync::oneshot, task::JoinHandle};

use crate::failure::Failure;

/// A running server and a client that is connected to it.
#[derive(Debug)]
pub(super) struct LocalServer {
    pub(super) client: GraspClient,
    stop: oneshot::Sender<()>,
    serving: JoinHandle<Result<(), ServeError>>,
}

/// Serves on a free loopback port and connects; searches may take `budget`.
pub(super) async fn start(budget: Duration) -> Result<LocalServer, Failure> {
    let listener = listen()
        .await
        .map_err(|error| Failure::other("cannot listen on the loopback interface", error))?;
    let address = listener
        .local_addr()
        .map_err(|error| Failure::other("cannot tell the server's port", error))?;
    let mut config = Config::default();
    config.budgets.maximum = config.budgets.maximum.max(budget);
    let (stop, stopped) = oneshot::channel();
    let serving = tokio::spawn(grasp_server::run(listener, config, async {
        // A sender that was dropped stops the server, too.
        let _ = stopped.await;
    }));
    let client = GraspClient::connect(format!("http://{address}")).await?;
    // The first call of a connection exchanges settings; the searches shall be timed without that.
    client.health().await?;
    Ok(LocalServer {
        client,
        stop,
        serving,
    })
}

/// IPv6 first, as the server's own default; containers often have only IPv4.
async fn listen() -> std::io::Result<TcpListener> {
    match TcpListener::bind(SocketAddr::from((Ipv6Addr::LOCALHOST, 0))).await {
        Ok(listener) => Ok(listener),
        Err(_) => TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))).await,
    }
}

impl LocalServer {
    /// Closes the connection and waits for the server to end.
    pub(super) async fn stop(self) -> Result<(), Failure> {
        let Self {
            client,
            stop,
            serving,
        } = self;
        drop(client);
        // A server that ended by itself has nobody who listens; its result says why.
        let _ = stop.send(());
        serving
            .await
            .map_err(|error| Failure::other("the server broke down", error))?
            .map_err(|error| Failure::other("the server failed", error))
    }
}
