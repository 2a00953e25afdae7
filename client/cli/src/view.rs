//! `grasp view`

use std::{
    net::{Ipv4Addr, Ipv6Addr, SocketAddr},
    process::{Command, Stdio},
};

use clap::Args;
use grasp_server::{Config, config::StorePlace};
use serde_json::json;
use tokio::net::TcpListener;

use crate::{EXIT_CODES, Ending, Failure, Output};

const ABOUT: &str = "\
Show objects, hands and grasps in a browser.

A server starts inside this process, on the loopback interface, and runs until it is interrupted. It prints the address of its
page, and opens it. Other clients may call it, too. Created objects and rigs are kept in memory.

With --json: {\"url\": …}.";

/// Show objects, hands and grasps in a browser.
#[derive(Args, Clone, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    /// The port to listen on. Default: a free one.
    #[arg(long, value_name = "PORT", default_value_t = 0)]
    port: u16,
    /// Do not open a browser.
    #[arg(long)]
    no_open: bool,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    // Prefers IPv6, like the server's default; containers often have IPv4 only.
    let addresses = [
        SocketAddr::from((Ipv6Addr::LOCALHOST, arguments.port)),
        SocketAddr::from((Ipv4Addr::LOCALHOST, arguments.port)),
    ];
    let failed = |error| Failure::other("cannot listen on the loopback interface", error);
    let listener = TcpListener::bind(&addresses[..]).await.map_err(failed)?;
    let url = format!("http://{}/", listener.local_addr().map_err(failed)?);
    let config = Config {
        place: StorePlace::Memory,
        viewer: true,
        ..Config::default()
    };
    output.write(&json!({ "url": url }), |_| {
        format!("The viewer is at {url} until you press Ctrl+C.")
    })?;
    if !arguments.no_open {
        open(&url);
    }
    let served = grasp_server::run(listener, config, std::future::pending()).await;
    served.map_err(|error| Failure::other("the server failed", error))?;
    Ok(Ending::Done)
}

/// Opens a page in the user's browser, if there is one: the address is printed anyway.
fn open(url: &str) {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let quiet = Stdio::null;
    let started = Command::new(opener)
        .arg(url)
        .stdin(quiet())
        .stdout(quiet())
        .stderr(quiet())
        .spawn();
    if let Err(error) = started {
        tracing::info!(%error, opener, "cannot open a browser");
    }
}
