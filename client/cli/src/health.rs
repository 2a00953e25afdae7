//! `grasp health`

use clap::Args;
use grasp_client::Health;
use serde::Serialize;

use crate::{EXIT_CODES, Ending, failure::Failure, output::Output, server_options::ServerOptions};

const ABOUT: &str = r#"Check whether the server accepts requests; the exit code is 0 exactly if it does.

With --json: {"health": "serving" | "not_serving" | "unknown"}."#;

/// Check whether the server accepts requests; the exit code is 0 exactly if it does.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Serialize)]
struct Answer {
    health: Health,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let health = arguments.server.connect().await?.health().await?;
    output.write(&Answer { health }, |answer| {
        match answer.health {
            Health::Serving => "serving",
            Health::NotServing => "not serving",
            Health::Unknown => "unknown",
        }
        .to_owned()
    })?;
    Ok(match health {
        Health::Serving => Ending::Done,
        Health::NotServing | Health::Unknown => Ending::NotServing,
    })
}
