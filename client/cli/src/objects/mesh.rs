//! `grasp objects mesh`

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::Named;
use crate::{
    Failure, Output,
    output::{message_json, pairs, write_file},
    values::full_name,
};

/// Save an object's mesh, as searches use it, as a GLB file.
///
/// In metres and +Y up. Triangles that must not be touched have the material "forbidden".
///
/// With --json: {"file": PATH, "bytes": N, "object": …} with the object as in `grasp objects get --json`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    object: Named,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let client = arguments.object.server.connect().await?;
    let name = full_name("objects", &arguments.object.name);
    let mesh = client.get_mesh(&name).await?;
    let object = client.get_object(&name).await?;
    let (file, bytes) = (arguments.out, mesh.glb.len());
    write_file(&file, &mesh.glb)?;
    let answer = json!({ "file": file, "bytes": bytes, "object": message_json(&object)? });
    let (all, forbidden) = (object.triangle_count, object.forbidden_triangle_count);
    output.write(&answer, |_| {
        pairs(&[
            ("object", name),
            ("file", file.display().to_string()),
            ("size", format!("{bytes} bytes")),
            ("mesh", format!("{all} triangles, {forbidden} of them forbidden")),
        ])
    })
}
