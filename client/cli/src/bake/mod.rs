//! `grasp bake`

mod folder;
mod growth;

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use grasp_client::GraspClient;
use grasp_server::FolderObject;
use serde::Serialize;

use crate::{
    Ending, Failure, Output, ServerOptions, blocking,
    input::{id_from_file, parse_duration},
    output::{bar, joined, table},
};
use folder::{Density, read_folder};
use growth::{in_the_way, is_done, register, try_givers};

/// Polling interval of the state of all objects.
const PAUSE: Duration = Duration::from_millis(500);

/// Register a folder of meshes, and wait until the server knows how both hands grasp them.
///
/// Every NAME.obj, .stl, .ply, .glb or .gltf becomes objects/NAME, in lower case and with hyphens. NAME.toml gives its mass and
/// other properties (see docker/README.md). Without it, the file is in metres, and the mass is the volume times the density of the
/// material that groups, objects, nodes or materials of the file are named after, or 400 kg/m³.
///
/// May be interrupted and started again: no object is registered twice, and a server that saves its objects continues their
/// atlases where it stopped, even after a restart.
///
/// Exit code 4 if objects were rejected, otherwise 3 if one got no grips or was taken from no test giver; the table says why.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The folder.
    folder: PathBuf,
    /// Number of objects whose atlases grow at the same time. The server's cache must have room for them.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..))]
    at_a_time: u16,
    /// Test givers per object: hands that hold it by a grasp found without its atlas, and from which it is then taken. The table
    /// counts givers without a hold separately.
    #[arg(long, value_name = "N", default_value_t = 12)]
    givers: u16,
    /// Time limit of each search for a grasp from a test giver.
    #[arg(long, value_name = "DURATION", default_value = "50ms", value_parser = parse_duration)]
    budget: Duration,
    /// Delete and recreate objects of the same names that were created from other files.
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
    output.write(&rows, |rows| describe(rows))?;
    Ok(if rows.iter().any(|row| row.error.is_some()) {
        Ending::Rejected
    } else if rows.iter().any(Row::is_out_of_reach) {
        Ending::NoGrasp
    } else {
        Ending::Done
    })
}

async fn bake(
    arguments: &Arguments,
    client: &GraspClient,
    objects: Vec<FolderObject>,
) -> Result<Vec<Row>, Failure> {
    let progress = bar(objects.len() as u64, "{percent:>3} %, {eta} left,");
    let mut left = objects.into_iter().enumerate();
    // Rows with their places in the table.
    let mut growing: Vec<(usize, Row)> = Vec::new();
    let mut done: Vec<(usize, Row)> = Vec::new();
    // When an atlas of any object last grew.
    let mut grew = Instant::now();
    loop {
        while growing.len() < usize::from(arguments.at_a_time)
            && let Some((place, object)) = left.next()
        {
            progress.set_message(id_from_file(&object.mesh));
            let row = register(client, object, arguments.replace).await?;
            if row.error.is_none() {
                grew = Instant::now();
                growing.push((place, row));
            } else {
                progress.inc(1);
                done.push((place, row));
            }
        }
        if growing.is_empty() {
            break;
        }
        let count = growing.len();
        for (place, mut row) in std::mem::take(&mut growing) {
            if !is_done(client, &mut row, &mut grew).await? {
                growing.push((place, row));
                continue;
            }
            progress.set_message(row.name.clone());
            if row.error.is_none() {
                row.givers = try_givers(client, &row.name, arguments.givers, arguments.budget).await?;
                if row.is_out_of_reach() {
                    row.in_the_way = in_the_way(client, &row.name).await?;
                }
            }
            progress.inc(1);
            done.push((place, row));
        }
        if growing.len() == count {
            tokio::time::sleep(PAUSE).await;
        }
    }
    progress.finish_and_clear();
    done.sort_by_key(|(place, _)| *place);
    Ok(done.into_iter().map(|(_, row)| row).collect())
}

#[derive(Clone, Debug, Default, Serialize)]
struct Row {
    /// "objects/{object}".
    name: String,
    mesh: String,
    created: bool,
    /// Its mass in kilograms; `None` if it was rejected.
    mass_kg: Option<f32>,
    /// The density that its mass was computed with; `None` if a manifest has the mass.
    density: Option<Density>,
    /// Number of triangles; `None` if it was rejected.
    triangles: Option<u32>,
    /// The atlases of the right and of the left hand; `None` on a server without atlases.
    grips: Option<[Grips; 2]>,
    /// True if the atlases stopped growing before they were complete.
    stalled: bool,
    /// Why atlases do not grow, if the server says.
    growth: Option<String>,
    givers: Givers,
    /// Why hands cannot hold the object alone, if it is out of reach; `None` if they can.
    in_the_way: Option<String>,
    warnings: Vec<String>,
    error: Option<String>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
struct Grips {
    entries: u32,
    /// True if growth is complete, even without entries.
    complete: bool,
}

/// Counts of test givers.
#[derive(Clone, Debug, Default, Serialize)]
struct Givers {
    /// Givers for whom a hold was sought.
    requested: u16,
    /// Givers with a hold.
    tried: u16,
    /// Givers from whom the object was taken.
    answered: u16,
    /// Why it could not be taken from the last of the other givers.
    last_failure: Option<String>,
}

impl Row {
    /// True if a hand got no grips, or it was taken from no test giver.
    fn is_out_of_reach(&self) -> bool {
        self.lacks_grips() || (self.givers.requested > 0 && self.givers.answered == 0)
    }

    /// True if the server keeps atlases, and a hand has no grips.
    fn lacks_grips(&self) -> bool {
        self.grips
            .is_some_and(|grips| grips.iter().any(|hand| hand.entries == 0))
    }

    /// Problems of the object, and why it has no more grips or givers.
    fn notes(&self) -> String {
        let givers = &self.givers;
        let (requested, tried, answered) = (givers.requested, givers.tried, givers.answered);
        let has_ceased = self.stalled || self.lacks_grips();
        let growth = self.growth.as_ref().filter(|_| has_ceased);
        let failure = givers.last_failure.as_ref().filter(|_| answered < tried);
        let notes = [
            self.error.clone(),
            growth.map(|why| format!("its atlases do not grow: {why}")),
            self.in_the_way.clone(),
            (tried < requested).then(|| format!("{} givers found no hold of it", requested - tried)),
            failure.map(|why| format!("not taken from {} givers, the last: {why}", tried - answered)),
        ];
        joined("; ", notes.into_iter().flatten().chain(self.warnings.clone()))
    }
}

fn describe(rows: &[Row]) -> String {
    let mut all = table("object |  | >mass | density | >triangles | >grips r + l | >givers | notes");
    for row in rows {
        let state = match (&row.error, row.created) {
            (Some(_), _) => "rejected",
            (None, true) => "new",
            (None, false) => "",
        };
        let mass = row.mass_kg.map(|mass| format!("{:.0} g", 1000.0 * mass));
        let density = row.density.as_ref().map(|density| {
            let material = density.material.unwrap_or("by default");
            format!("{:.0} kg/m³, {material}", density.kg_per_m3)
        });
        let triangles = row.triangles.map(|count| count.to_string());
        let entries = row.grips.map(|grips| grips.map(|hand| hand.entries));
        let grips = entries.map(|[right, left]| format!("{right} + {left}"));
        let (requested, answered) = (row.givers.requested, row.givers.answered);
        let givers = (requested > 0).then(|| format!("{answered} of {requested}"));
        all.add_row([
            row.name.clone(),
            state.to_owned(),
            mass.unwrap_or_default(),
            density.unwrap_or_default(),
            triangles.unwrap_or_default(),
            grips.unwrap_or_default(),
            givers.unwrap_or_default(),
            row.notes(),
        ]);
    }
    all.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_count_givers_without_a_hold_and_failed_takes() {
        let row = Row {
            givers: Givers {
                requested: 12,
                tried: 11,
                answered: 10,
                last_failure: Some("limited by the giver".to_owned()),
            },
            ..Row::default()
        };
        let expected =
            "1 givers found no hold of it; not taken from 1 givers, the last: limited by the giver";
        assert_eq!(row.notes(), expected);
    }
}
