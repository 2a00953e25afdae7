//! `grasp objects mesh`

use std::path::PathBuf;

use clap::Args;
use grasp_client::v1::GraspObject;
use serde::Serialize;

use crate::{
    Ending,
    failure::Failure,
    output::{Output, pairs, serialize_message},
    server_options::ServerOptions,
};

/// Save an object's mesh, as searches use it, as a GLB file.
///
/// In metres and +Y up. Triangles that must not be touched have the material "forbidden".
///
/// With --json: {"file": PATH, "bytes": N, "object": …} with the object as in `grasp objects get --json`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The object's name: "remote" or "objects/remote".
    name: String,
    /// The file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Serialize)]
struct Answer<'a> {
    file: PathBuf,
    bytes: usize,
    #[serde(serialize_with = "serialize_message")]
    object: &'a GraspObject,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let client = arguments.server.connect().await?;
    let name = super::full_name(&arguments.name);
    let mesh = client.get_mesh(&name).await?;
    let object = client.get_object(&name).await?;
    std::fs::write(&arguments.out, &mesh.glb)
        .map_err(|error| Failure::other(format!("cannot write {}", arguments.out.display()), error))?;
    let answer = Answer {
        file: arguments.out,
        bytes: mesh.glb.len(),
        object: &object,
    };
    output.write(&answer, |answer| {
        pairs(&[
            ("object", object.name.clone()),
            ("file", answer.file.display().to_string()),
            ("size", format!("{} bytes", answer.bytes)),
            (
                "mesh",
                format!(
                    "{} triangles, {} of them forbidden",
                    object.triangle_count, object.forbidden_triangle_count
                ),
            ),
        ])
    })?;
    Ok(Ending::Done)
}
