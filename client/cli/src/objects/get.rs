//! `grasp objects get`

use clap::Args;

use crate::{Ending, failure::Failure, output::Output, server_options::ServerOptions};

const ABOUT: &str = r"Show everything about an object except its mesh.

With --json: the API's GraspObject in protobuf's JSON.";

/// Show everything about an object except its mesh.
#[derive(Args, Debug)]
#[command(long_about = ABOUT)]
pub(crate) struct Arguments {
    /// The object's name: "remote" or "objects/remote".
    name: String,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let client = arguments.server.connect().await?;
    let object = client.get_object(super::full_name(&arguments.name)).await?;
    super::show(&client, &object, output).await
}
