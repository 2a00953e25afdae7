//! `grasp objects list`

use clap::Args;
use grasp_client::Object;
use serde::Serialize;

use crate::{
    Ending,
    failure::Failure,
    output::{Output, table},
    server_options::ServerOptions,
};

/// List all objects of the server.
///
/// With --json: {"objects": […]}, each like the output of `grasp objects get --json`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Serialize)]
struct Answer {
    objects: Vec<Object>,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let objects = arguments.server.connect().await?.list_objects().await?;
    output.write(&Answer { objects }, |answer| {
        let mut table = table(&[
            "object",
            ">triangles",
            ">mass",
            ">friction",
            "box",
            ">forbidden",
            "built in",
            ">atlas",
            "warnings",
        ]);
        for object in &answer.objects {
            table.add_row([
                object.name.clone(),
                object.triangle_count.to_string(),
                format!("{:.0} g", object.mass_kg * 1000.0),
                object.friction.to_string(),
                super::size(object.box_half_extents),
                object.forbidden_triangle_count.to_string(),
                if object.built_in { "yes" } else { "no" }.to_owned(),
                super::atlas(object.atlas.as_ref()),
                object.warnings.len().to_string(),
            ]);
        }
        table.to_string()
    })?;
    Ok(Ending::Done)
}
