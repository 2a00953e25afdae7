//! `grasp health`

use clap::Args;
use grasp_client::Health;
use serde_json::json;

use crate::{EXIT_CODES, Ending, Failure, Output, ServerOptions};

const ABOUT: &str = r#"Check whether the server accepts requests; the exit code is 0 exactly if it does.

With --json: {"health": "serving" | "not_serving" | "unknown"}."#;

/// Check whether the server accepts requests; the exit code is 0 exactly if it does.
#[derive(Args, Debug)]
#[command(long_about = ABOUT, after_help = EXIT_CODES)]
pub(crate) struct Arguments {
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let health = arguments.server.connect().await?.health().await?;
    let (text, ending) = match health {
        Health::Serving => ("serving", Ending::Done),
        Health::NotServing => ("not serving", Ending::NotServing),
        Health::Unknown => ("unknown", Ending::NotServing),
    };
    output.write(&json!({ "health": health }), |_| text.to_owned())?;
    Ok(ending)
}
