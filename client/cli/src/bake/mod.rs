//! `grasp bake`

mod atlases;
mod densities;
mod folder;
mod givers;
mod reasons;
mod register;
mod results;

use std::{collections::VecDeque, path::PathBuf, time::Duration};

use clap::Args;
use grasp_client::GraspClient;

use crate::{Ending, Failure, Output, ServerOptions, blocking, progress_bar::bar, values::parse_duration};
use atlases::Waiting;
use folder::{Baked, read_folder};
use results::Row;

/// Register a folder of meshes, and wait until the server knows how both hands grasp them.
///
/// Every NAME.obj, .stl, .ply, .glb or .gltf becomes objects/NAME, in lower case and with hyphens. NAME.toml gives its mass and
/// what else a folder of objects says (see docker/README.md). Without it the file is in metres, and the mass is the volume times
/// a density: that of the material which groups, objects, nodes or materials of the file are named after, or 400 kg/m³.
///
/// May be interrupted and started again: what is registered already is not registered again, and a server that saves its objects
/// goes on with its atlases where it stopped, even after a restart.
///
/// Exit code 4 if objects were rejected, and otherwise 3 if one got no grips or could be taken from no test giver; the table says
/// why.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The folder.
    folder: PathBuf,
    /// Objects whose atlases grow at a time. The server must have room for them in its cache.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..))]
    at_a_time: u16,
    /// Test givers per object: hands that hold it as a search without its atlas finds, from which it is then taken. The table
    /// counts givers for whom none is found in time separately.
    #[arg(long, value_name = "N", default_value_t = 12)]
    givers: u16,
    /// Time limit of each taking from a test giver.
    #[arg(long, value_name = "DURATION", default_value = "50ms", value_parser = parse_duration)]
    budget: Duration,
    /// Delete objects of the same names that were created from other files, and create them from these.
    #[arg(long)]
    replace: bool,
    #[command(flatten)]
    server: ServerOptions,
}

pub(crate) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let folder = arguments.folder.clone();
    let objects = blocking(move || read_folder(&folder)).await?;
    let client = arguments.server.connect().await?;
    let rows = Box::pin(bake(&arguments, &client, objects)).await?;
    output.write(&rows, |rows| results::describe(rows))?;
    Ok(if rows.iter().any(|row| row.error.is_some()) {
        Ending::Rejected
    } else if rows.iter().any(Row::is_out_of_reach) {
        Ending::NoGrasp
    } else {
        Ending::Done
    })
}

async fn bake(arguments: &Arguments, client: &GraspClient, objects: Vec<Baked>) -> Result<Vec<Row>, Failure> {
    let progress = bar(
        atlases::STEPS * objects.len() as u64,
        "{percent:>3} %, {eta} left,",
    );
    let mut left: VecDeque<(usize, Baked)> = objects.into_iter().enumerate().collect();
    let mut waiting = Waiting::new(client);
    let mut rows = Vec::new();
    while !(left.is_empty() && waiting.is_empty()) {
        while waiting.len() < usize::from(arguments.at_a_time)
            && let Some((place, object)) = left.pop_front()
        {
            progress.set_message(object.id.clone());
            let row = register::register(client, object, arguments.replace).await?;
            if row.error.is_none() {
                waiting.add(place, row);
            } else {
                progress.inc(atlases::STEPS);
                rows.push((place, row));
            }
        }
        for (place, mut row) in waiting.ready(&progress).await? {
            progress.set_message(row.name.clone());
            if row.error.is_none() {
                row.givers = givers::answered(client, &row.name, arguments.givers, arguments.budget).await?;
                if row.is_out_of_reach() {
                    row.in_the_way = reasons::in_the_way(client, &row.name).await?;
                }
            }
            rows.push((place, row));
        }
    }
    progress.finish_and_clear();
    rows.sort_by_key(|(place, _)| *place);
    Ok(rows.into_iter().map(|(_, row)| row).collect())
}
