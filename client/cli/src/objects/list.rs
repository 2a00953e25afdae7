//! `grasp objects list`

use clap::Args;
use grasp_client::v1::{ListObjectsRequest, ListObjectsResponse, ObjectView};

use super::{atlas_of, describe};
use crate::{
    Failure, Output, ServerOptions,
    format::yes_or_no,
    output::{table, write_line, write_message},
};

/// List the objects of the server, all or some.
///
/// With --json: {"objects": […]}, each like the output of `grasp objects get --json`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Which objects, by labels or the start of the name: `labels.level = "kitchen" AND name = "objects/mug*"`.
    #[arg(long, value_name = "FILTER", default_value = "", hide_default_value = true)]
    filter: String,
    /// `name` or `create_time`, optionally followed by desc [default: name].
    #[arg(long, value_name = "FIELD", default_value = "", hide_default_value = true)]
    order_by: String,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let view = if output.json {
        ObjectView::Full
    } else {
        ObjectView::Basic
    };
    let request = ListObjectsRequest {
        filter: arguments.filter,
        order_by: arguments.order_by,
        view: view.into(),
        ..ListObjectsRequest::default()
    };
    let client = arguments.server.connect().await?;
    let objects = client.list_objects(&request).await?;
    if output.json {
        return write_message(&ListObjectsResponse {
            objects,
            ..ListObjectsResponse::default()
        });
    }
    let mut table = table(
        "object | >triangles | >mass | >friction | box | >forbidden | built in | labels | >atlas | warnings",
    );
    for object in &objects {
        table.add_row([
            object.name.clone(),
            object.triangle_count.to_string(),
            format!("{:.0} g", object.mass_kg * 1000.0),
            describe::friction(object),
            describe::size(object),
            object.forbidden_triangle_count.to_string(),
            yes_or_no(object.built_in),
            describe::labels(&object.labels),
            describe::atlas(&atlas_of(&client, &object.name, "right").await?),
            object.warnings.len().to_string(),
        ]);
    }
    write_line(&table.to_string())
}
