//! Real servers inside the test.

use std::net::Ipv4Addr;

use grasp_server::{Config, config::StorePlace};
use tokio::{net::TcpListener, task::JoinHandle};

/// Starts a server on a free port; returns its URL and its end.
pub(crate) async fn serve(
    config: Config,
    stopped: impl Future<Output = ()> + Send + 'static,
) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let serving = tokio::spawn(async { grasp_server::run(listener, config, stopped).await.unwrap() });
    (url, serving)
}

/// The URL of a server that lives as long as the test.
pub(crate) async fn real_server() -> String {
    let config = Config {
        place: StorePlace::Memory,
        ..Config::default()
    };
    serve(config, std::future::pending()).await.0
}

/// The same, without atlases.
pub(crate) async fn server_without_atlases() -> String {
    let config = Config {
        builder_threads: 0,
        place: StorePlace::Memory,
        ..Config::default()
    };
    serve(config, std::future::pending()).await.0
}
