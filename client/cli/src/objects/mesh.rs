//! `grasp objects mesh`

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::{
    Ending,
    failure::Failure,
    output::{Output, message_json, pairs},
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
struct Answer {
    file: PathBuf,
    bytes: usize,
    object: Value,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let client = arguments.server.connect().await?;
    let mesh = client.get_mesh(super::full_name(&arguments.name)).await?;
    std::fs::write(&arguments.out, &mesh.glb)
        .map_err(|error| Failure::other(format!("cannot write {}", arguments.out.display()), error))?;
    let answer = Answer {
        file: arguments.out,
        bytes: mesh.glb.len(),
        object: message_json("Object", &mesh.object)?,
    };
    let object = &mesh.object;
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
