//! The server inside this process.

use std::{
    net::{Ipv4Addr, Ipv6Addr, SocketAddr},
    time::Duration,
};

use grasp_client::GraspClient;
use grasp_server::{Config, ServeError, config::StorePlace};
use tokio::{net::TcpListener, sync::oneshot, task::JoinHandle};

use crate::Failure;

/// A running server and a connected client.
#[derive(Debug)]
pub(super) struct LocalServer {
    pub(super) client: GraspClient,
    stop: oneshot::Sender<()>,
    serving: JoinHandle<Result<(), ServeError>>,
}

/// Starts a server on a free loopback port that allows searches of `budget`, and connects to it.
pub(super) async fn start(budget: Duration) -> Result<LocalServer, Failure> {
    // Prefers IPv6, like the server's default; containers often have IPv4 only.
    let addresses = [
        SocketAddr::from((Ipv6Addr::LOCALHOST, 0)),
        SocketAddr::from((Ipv4Addr::LOCALHOST, 0)),
    ];
    let listener = TcpListener::bind(&addresses[..]).await;
    let listener =
        listener.map_err(|error| Failure::other("cannot listen on the loopback interface", error))?;
    let address = listener
        .local_addr()
        .map_err(|error| Failure::other("cannot determine the server's port", error))?;
    let mut config = Config {
        place: StorePlace::Memory,
        ..Config::default()
    };
    config.budgets.maximum = config.budgets.maximum.max(budget);
    let (stop, stopped) = oneshot::channel();
    let serving = tokio::spawn(grasp_server::run(listener, config, async {
        // A dropped sender stops the server, too.
        let _ = stopped.await;
    }));
    let client = GraspClient::connect(format!("http://{address}")).await?;
    // The first call of a connection exchanges settings; keep that out of the measured times.
    client.health().await?;
    Ok(LocalServer {
        client,
        stop,
        serving,
    })
}

impl LocalServer {
    /// Closes the connection and waits until the server has stopped.
    pub(super) async fn stop(self) -> Result<(), Failure> {
        drop(self.client);
        // Fails if the server stopped by itself; its result says why.
        let _ = self.stop.send(());
        let served = self.serving.await;
        let served = served.map_err(|error| Failure::other("the server panicked", error))?;
        served.map_err(|error| Failure::other("the server failed", error))
    }
}
