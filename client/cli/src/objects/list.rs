//! `grasp objects list`

use clap::Args;
use grasp_client::{Object, ObjectQuery};
use serde::Serialize;

use crate::{
    Ending,
    failure::Failure,
    output::{Output, table},
    server_options::ServerOptions,
};

/// List the objects of the server, all or those with certain labels.
///
/// With --json: {"objects": […]}, each like the output of `grasp objects get --json`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Labels that the objects must have, such as "level=kitchen AND fragile".
    #[arg(long, value_name = "FILTER", default_value = "", hide_default_value = true)]
    filter: String,
    /// `name`, `create_time` or `update_time`, each optionally followed by desc, with commas in between [default: name].
    #[arg(long, value_name = "FIELDS", default_value = "", hide_default_value = true)]
    order_by: String,
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Serialize)]
struct Answer {
    objects: Vec<Object>,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let query = ObjectQuery {
        filter: arguments.filter,
        order_by: arguments.order_by,
    };
    let objects = arguments.server.connect().await?.list_objects(&query).await?;
    output.write_message("ListObjectsResponse", &Answer { objects }, |answer| {
        let mut table = table(&[
            "object",
            ">triangles",
            ">mass",
            ">friction",
            "box",
            ">forbidden",
            "built in",
            "labels",
            ">atlas",
            "warnings",
        ]);
        for object in &answer.objects {
            table.add_row([
                object.name.clone(),
                object.triangle_count.to_string(),
                format!("{:.0} g", object.mass_kg * 1000.0),
                super::friction(object),
                super::size(object.box_half_extents),
                object.forbidden_triangle_count.to_string(),
                if object.built_in { "yes" } else { "no" }.to_owned(),
                super::labels(&object.labels),
                super::atlas(object.atlas.as_ref()),
                object.warnings.len().to_string(),
            ]);
        }
        table.to_string()
    })?;
    Ok(Ending::Done)
}
