//! Table and JSON of the everyday objects.

use std::{fmt::Write as _, path::Path, time::Duration};

use grasp_client::v1;
use serde::Serialize;

use super::{
    super::{Plan, draw::Drawn},
    Asked,
};
use crate::{
    failure::Failure,
    format::{comfort, grasp_type_name, human_time},
    output::{Output, serialize_message, table},
};

/// Output of `--json`.
#[derive(Serialize)]
struct Results<'a> {
    folder: &'a Path,
    page: &'a Path,
    overview: Option<&'a Path>,
    one_hand: usize,
    found: usize,
    grasps: Vec<Row<'a>>,
}

/// One object.
#[derive(Serialize)]
struct Row<'a> {
    object: &'a str,
    what: &'a str,
    mass_kg: f64,
    beyond_one_hand: Option<&'a str>,
    picture: &'a Path,
    scene: &'a Path,
    #[serde(serialize_with = "serialize_message")]
    answer: &'a v1::FindGraspResponse,
    round_trip_seconds: f64,
    #[serde(skip)]
    outcome_name: &'a str,
}

pub(super) fn write(
    plan: &Plan,
    page: &Path,
    asked: &[Asked],
    drawn: &Drawn,
    output: Output,
) -> Result<(), Failure> {
    let within_one_hand = || asked.iter().filter(|asked| asked.beyond().is_none());
    let files = drawn.pictures.iter().zip(&drawn.scenes);
    let results = Results {
        folder: &plan.folder,
        page,
        overview: drawn.overview.as_deref(),
        one_hand: within_one_hand().count(),
        found: within_one_hand().filter(|asked| asked.is_found()).count(),
        grasps: asked
            .iter()
            .zip(files)
            .map(|(asked, (picture, scene))| Row {
                object: asked.object.name,
                what: asked.object.what,
                mass_kg: asked.object.mass_kg(),
                beyond_one_hand: asked.beyond(),
                picture,
                scene,
                answer: &asked.answer,
                round_trip_seconds: asked.round_trip.as_secs_f64(),
                outcome_name: outcome_name(asked),
            })
            .collect(),
    };
    output.write(&results, |results| describe(results, plan.budget))
}

/// The outcome in a few words.
pub(super) fn outcome_name(asked: &Asked) -> &'static str {
    match (asked.is_found(), asked.beyond()) {
        (true, None) => "found",
        (false, None) => "none in time",
        (true, Some(_)) => "found, but takes two hands",
        (false, Some(_)) => "takes two hands",
    }
}

/// A mass with a unit that suits it.
pub(super) fn human_mass(kilograms: f64) -> String {
    let grams = kilograms * 1000.0;
    match grams {
        ..1.0 => format!("{grams:.2} g"),
        ..1000.0 => format!("{grams:.0} g"),
        _ => format!("{kilograms:.1} kg"),
    }
}

fn describe(results: &Results<'_>, budget: Duration) -> String {
    let mut table = table(&[
        "object",
        ">mass",
        "outcome",
        "type",
        ">comfort E",
        ">attempts",
        ">server",
        ">round trip",
    ]);
    for row in &results.grasps {
        let grasp = row.answer.grasp();
        table.add_row([
            row.object.to_owned(),
            human_mass(row.mass_kg),
            row.outcome_name.to_owned(),
            grasp.map_or_else(|| "-".to_owned(), grasp_type_name),
            grasp.map_or_else(|| "-".to_owned(), comfort),
            row.answer.attempts().to_string(),
            human_time(row.answer.search_time().as_secs_f64()),
            human_time(row.round_trip_seconds),
        ]);
    }
    let mut text = table.to_string();
    let _ = write!(
        text,
        "\n{} of {} that one hand can hold ({:.0} %) found within {}; all pictures are on {}",
        results.found,
        results.one_hand,
        100.0 * results.found as f64 / results.one_hand as f64,
        human_time(budget.as_secs_f64()),
        results.page.display()
    );
    text
}
