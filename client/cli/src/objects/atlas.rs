//! `grasp objects atlas`

use clap::Args;
use grasp_client::v1::Atlas;
use serde_json::json;

use crate::{
    Ending,
    failure::Failure,
    format::name_of,
    output::{Output, message_json, table, write_json, write_line},
    server_options::ServerOptions,
};

/// Show the state of an object's atlases, of the grasps that are known in advance for either hand.
///
/// With --json: {"atlases": […]}, each the API's Atlas in protobuf's JSON.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The object's name: "remote" or "objects/remote".
    name: String,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let name = super::full_name(&arguments.name);
    let client = arguments.server.connect().await?;
    let mut atlases = Vec::new();
    for hand in ["left", "right"] {
        atlases.push(client.get_atlas(format!("{name}/atlases/{hand}")).await?);
    }
    if output.is_json() {
        let atlases = atlases.iter().map(message_json).collect::<Result<Vec<_>, _>>()?;
        write_json(&json!({ "atlases": atlases }))?;
    } else {
        write_line(&describe(&atlases))?;
    }
    Ok(Ending::Done)
}

fn describe(atlases: &[Atlas]) -> String {
    let mut table = table(&["hand", "state", "stamp", "stamp of the learned"]);
    for atlas in atlases {
        table.add_row([
            name_of(atlas.handedness()),
            super::atlas(atlas),
            atlas.stamp.clone(),
            atlas.learned_stamp.clone(),
        ]);
    }
    table.to_string()
}
