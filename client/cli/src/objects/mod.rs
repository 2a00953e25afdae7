//! `grasp objects`

mod create;
mod describe;
mod list;
pub(crate) mod marks;
mod mesh;
mod properties;
mod update;
mod watch;

pub(crate) use create::id_from_file;

use clap::{Args, Subcommand};
use grasp_client::{ClientError, GraspClient, v1::Atlas};
use serde_json::json;

use crate::{
    Failure, Output, ServerOptions,
    format::name_of,
    output::{message_json, table},
    values::full_name,
};

/// List, show, create, change, delete and watch objects, save their meshes, and show their atlases.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    List(list::Arguments),
    /// Show everything about an object except its mesh.
    ///
    /// With --json: the API's `GraspObject` in protobuf's JSON.
    Get(Named),
    Create(create::Arguments),
    Update(update::Arguments),
    /// Delete an object. Searches that run finish.
    ///
    /// With --json: {"deleted": NAME}.
    Delete(Delete),
    Watch(watch::Arguments),
    Mesh(mesh::Arguments),
    /// Show the state of an object's atlases, of the grasps that are known in advance for either hand.
    ///
    /// With --json: {"atlases": […]}, each the API's Atlas in protobuf's JSON.
    Atlas(Named),
}

#[derive(Args, Debug)]
pub(crate) struct Named {
    /// The object's name: "remote" or "objects/remote".
    name: String,
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Args, Debug)]
pub(crate) struct Delete {
    /// The object's name: "mug" or "objects/mug".
    name: String,
    /// Delete it only if it still has this etag.
    #[arg(long, value_name = "ETAG")]
    etag: Option<String>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(command: Command, output: Output) -> Result<(), Failure> {
    match command {
        Command::List(arguments) => list::run(arguments, output).await,
        Command::Get(arguments) => get(arguments, output).await,
        Command::Create(arguments) => create::run(arguments, output).await,
        Command::Update(arguments) => update::run(arguments, output).await,
        Command::Delete(arguments) => delete(arguments, output).await,
        Command::Watch(arguments) => watch::run(arguments, output).await,
        Command::Mesh(arguments) => mesh::run(arguments, output).await,
        Command::Atlas(arguments) => atlases(arguments, output).await,
    }
}

async fn get(arguments: Named, output: Output) -> Result<(), Failure> {
    let client = arguments.server.connect().await?;
    let object = client.get_object(full_name("objects", &arguments.name)).await?;
    describe::show(&client, &object, output).await
}

async fn delete(arguments: Delete, output: Output) -> Result<(), Failure> {
    let name = full_name("objects", &arguments.name);
    let client = arguments.server.connect().await?;
    client.delete_object(&name, arguments.etag).await?;
    output.write(&json!({ "deleted": name }), |_| format!("deleted {name}"))
}

async fn atlases(arguments: Named, output: Output) -> Result<(), Failure> {
    let name = full_name("objects", &arguments.name);
    let client = arguments.server.connect().await?;
    let mut table = table("hand | state | stamp | stamp of the learned");
    let mut written = Vec::new();
    for hand in ["left", "right"] {
        let atlas = client.get_atlas(format!("{name}/atlases/{hand}")).await?;
        written.push(message_json(&atlas)?);
        table.add_row([
            name_of(atlas.handedness()),
            describe::atlas(&atlas),
            atlas.stamp,
            atlas.learned_stamp,
        ]);
    }
    output.write(&json!({ "atlases": written }), |_| table.to_string())
}

/// The state of an object's atlas for its "left" or "right" hand; an empty one if the object is gone.
pub(crate) async fn atlas_of(client: &GraspClient, object: &str, hand: &str) -> Result<Atlas, ClientError> {
    match client.get_atlas(format!("{object}/atlases/{hand}")).await {
        Err(ClientError::NotFound(_)) => Ok(Atlas::default()),
        atlas => atlas,
    }
}
