//! `grasp objects delete`

use clap::Args;
use serde::Serialize;

use crate::{Ending, failure::Failure, output::Output, server_options::ServerOptions};

/// Delete an object. Searches that run finish.
///
/// With --json: {"deleted": NAME}.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The object's name: "mug" or "objects/mug".
    name: String,
    /// Delete it only if it still has this etag.
    #[arg(long, value_name = "ETAG")]
    etag: Option<String>,
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Serialize)]
struct Answer {
    deleted: String,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let name = super::full_name(&arguments.name);
    let client = arguments.server.connect().await?;
    client.delete_object(name.as_str(), arguments.etag).await?;
    output.write(&Answer { deleted: name }, |answer| {
        format!("deleted {}", answer.deleted)
    })?;
    Ok(Ending::Done)
}
