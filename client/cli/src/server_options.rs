//! Options of all commands that call a server.

use std::time::Duration;

use clap::Args;
use grasp_client::{ClientError, GraspClient, RetryPolicy};

use crate::values::parse_duration;

/// Which server to call, and its time limits.
#[derive(Args, Debug)]
#[command(next_help_heading = "Server")]
pub(crate) struct ServerOptions {
    /// The server's URL.
    #[arg(
        long,
        value_name = "URL",
        env = "GRASP_SERVER",
        default_value = "http://[::1]:50051"
    )]
    server: String,
    /// Time limit for connecting.
    #[arg(long, value_name = "DURATION", default_value = "5s", value_parser = parse_duration)]
    connect_timeout: Duration,
    /// Time limit of a call, retries included; a search's budget is added.
    #[arg(long, value_name = "DURATION", default_value = "10s", value_parser = parse_duration)]
    timeout: Duration,
    /// Largest number of attempts while the server is unavailable.
    #[arg(long, value_name = "N", default_value_t = RetryPolicy::default().max_attempts)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..))]
    tries: u32,
}

impl ServerOptions {
    /// Connects to the server.
    pub(crate) async fn connect(&self) -> Result<GraspClient, ClientError> {
        GraspClient::builder(&self.server)
            .connect_timeout(self.connect_timeout)
            .call_timeout(self.timeout)
            .retry(RetryPolicy {
                max_attempts: self.tries,
                ..RetryPolicy::default()
            })
            .connect()
            .await
    }
}
