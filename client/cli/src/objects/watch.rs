//! `grasp objects watch`

use clap::Args;
use grasp_client::v1::{Atlas, Handedness, ObjectChange, WatchObjectsResponse};

use super::describe;
use crate::{
    Failure, Output, ServerOptions,
    format::{joined, list, name_of},
    output::{write_line, write_message_line},
};

/// Widths of the columns, which cannot follow rows that are yet to come.
const CHANGES_WIDTH: usize = 22;
const NAME_WIDTH: usize = 28;

/// Show what happens to objects, until interrupted or the server shuts down.
///
/// Of an object that changes faster than the news are read, several changes come at once, with its latest state.
///
/// With --json, one line per news: a `WatchObjectsResponse` in protobuf's JSON.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Which objects, by labels or the start of the name: `labels.level = "kitchen" AND name = "objects/mug*"`.
    #[arg(long, value_name = "FILTER", default_value = "", hide_default_value = true)]
    filter: String,
    /// Show the present objects first.
    #[arg(long)]
    present: bool,
    /// End after so many news.
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let client = arguments.server.connect().await?;
    let mut watch = client.watch_objects(arguments.filter, arguments.present).await?;
    if !output.json {
        write_line(&line("change", "object", "mass", "atlas", "labels"))?;
    }
    let mut left = arguments.count;
    while left != Some(0)
        && let Some(news) = watch.next().await?
    {
        if output.json {
            write_message_line(&news)?;
        } else if !news.changes().any(|change| change == ObjectChange::PresentEnd) {
            write_line(&row(&news))?;
        }
        left = left.map(|left| left - 1);
    }
    Ok(())
}

/// A row of the table.
fn row(news: &WatchObjectsResponse) -> String {
    let changes = list(news.changes().map(name_of));
    let object = news.object.clone().unwrap_or_default();
    if matches!(
        news.changes().next_back(),
        Some(ObjectChange::Deleted | ObjectChange::Evicted)
    ) {
        return line(&changes, &object.name, "", "", "");
    }
    let mass = format!("{:.0} g", object.mass_kg * 1000.0);
    let count = news.atlases.len();
    let atlases = joined("; ", news.atlases.iter().map(|atlas| of_hand(atlas, count)));
    let labels = describe::labels(&object.labels);
    line(&changes, &object.name, &mass, &atlases, &labels)
}

/// The state of one of several atlases.
fn of_hand(atlas: &Atlas, count: usize) -> String {
    let state = describe::atlas(atlas);
    match atlas.handedness() {
        Handedness::Right if count == 1 => state,
        hand => format!("{}: {state}", name_of(hand)),
    }
}

fn line(changes: &str, name: &str, mass: &str, atlas: &str, labels: &str) -> String {
    let line = format!("{changes:CHANGES_WIDTH$}  {name:NAME_WIDTH$}  {mass:>7}  {atlas:18}  {labels}");
    line.trim_end().to_owned()
}
