//! The demo's results.

use std::{fmt::Write as _, path::Path};

use grasp_client::{Outcome, v1};
use serde::Serialize;

use super::{Asked, draw::Drawn};
use crate::{
    failure::Failure,
    format::{comfort, grasp_type_name, human_time, rejections_at_a_glance},
    output::{Output, serialize_message, table},
};

/// Output of `--json`.
#[derive(Serialize)]
struct Results<'a> {
    folder: &'a Path,
    overview: Option<&'a Path>,
    found: usize,
    grasps: Vec<Row<'a>>,
}

/// One holdout.
#[derive(Serialize)]
struct Row<'a> {
    object: &'a str,
    holdout: &'a str,
    picture: &'a Path,
    scene: &'a Path,
    #[serde(serialize_with = "serialize_message")]
    answer: &'a v1::FindGraspResponse,
    round_trip_seconds: f64,
}

pub(super) fn write(folder: &Path, asked: &[Asked], drawn: &Drawn, output: Output) -> Result<(), Failure> {
    let grasps: Vec<_> = asked
        .iter()
        .zip(drawn.pictures.iter().zip(&drawn.scenes))
        .map(|(asked, (picture, scene))| Row {
            object: &asked.holdout.object,
            holdout: &asked.holdout.name,
            picture,
            scene,
            answer: &asked.answer,
            round_trip_seconds: asked.round_trip.as_secs_f64(),
        })
        .collect();
    let results = Results {
        folder,
        overview: drawn.overview.as_deref(),
        found: grasps
            .iter()
            .filter(|row| row.answer.outcome() == Outcome::Found)
            .count(),
        grasps,
    };
    output.write(&results, describe)
}

/// The holdout's name without its object, which has its own column.
fn short_name<'a>(row: &Row<'a>) -> &'a str {
    row.holdout
        .strip_prefix(row.object)
        .and_then(|rest| rest.strip_prefix('-'))
        .unwrap_or(row.holdout)
}

fn describe(results: &Results<'_>) -> String {
    let mut table = table(&[
        "object",
        "holdout",
        "outcome",
        ">attempts",
        "rejections",
        "type",
        ">comfort E",
        ">server",
        ">round trip",
    ]);
    for row in &results.grasps {
        let grasp = row.answer.grasp();
        table.add_row([
            row.object.to_owned(),
            short_name(row).to_owned(),
            match row.answer.outcome() {
                Outcome::Found => "found",
                Outcome::Aborted => "aborted",
                _ => "none in time",
            }
            .to_owned(),
            row.answer.attempts().to_string(),
            row.answer
                .report
                .as_ref()
                .map(rejections_at_a_glance)
                .unwrap_or_default(),
            grasp.map_or_else(|| "-".to_owned(), grasp_type_name),
            grasp.map_or_else(|| "-".to_owned(), comfort),
            human_time(row.answer.search_time().as_secs_f64()),
            human_time(row.round_trip_seconds),
        ]);
    }
    let mut text = table.to_string();
    let _ = write!(text, "\n{} of {} found", results.found, results.grasps.len());
    if let Some(overview) = results.overview {
        let _ = write!(
            text,
            "; pictures and scenes are in {}, an overview is {}",
            results.folder.display(),
            overview.display()
        );
    }
    text
}
