//! Options of all commands that call a server, and `grasp health`.

use std::time::Duration;

use clap::Args;
use grasp_client::{ClientError, GraspClient, Health, RetryPolicy};
use serde_json::json;

use crate::{EXIT_CODES, Ending, Failure, Output, input::parse_duration};

/// Which server to call, and its time limits.
#[derive(Args, Debug)]
#[command(next_help_heading = "Server")]
pub(crate) struct ServerOptions {
    /// The server's URL.
    #[arg(
        long,
        global = true,
        value_name = "URL",
        env = "GRASP_SERVER",
        default_value = "http://[::1]:50051"
    )]
    server: String,
    /// Time limit for connecting.
    #[arg(long, global = true, value_name = "DURATION", default_value = "5s", value_parser = parse_duration)]
    connect_timeout: Duration,
    /// Time limit of a call, retries included; a search's budget is added.
    #[arg(long, global = true, value_name = "DURATION", default_value = "10s", value_parser = parse_duration)]
    timeout: Duration,
    /// Largest number of attempts while the server is unavailable.
    #[arg(long, global = true, value_name = "N", default_value_t = RetryPolicy::default().max_attempts)]
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

const ABOUT: &str = r#"Check whether the server accepts requests; the exit code is 0 exactly if it does.

With --json: {"health": "serving" | "not_serving" | "unknown"}."#;

/// Check whether the server accepts requests; the exit code is 0 exactly if it does.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn health(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let health = arguments.server.connect().await?.health().await?;
    let (text, ending) = match health {
        Health::Serving => ("serving", Ending::Done),
        Health::NotServing => ("not serving", Ending::NotServing),
        Health::Unknown => ("unknown", Ending::NotServing),
    };
    output.write(&json!({ "health": health }), |_| text.to_owned())?;
    Ok(ending)
}
