//! Table and JSON of the everyday objects.

use std::path::Path;

use grasp_everyday::EverydayObject;
use serde_json::json;

use super::super::{Plan, asked::Asked, draw::Drawn};
use crate::{
    Failure, Output,
    format::human_time,
    output::{table, write_json, write_line},
};

pub(super) fn write(
    plan: &Plan,
    page: &Path,
    all: &[Asked<EverydayObject>],
    drawn: &Drawn,
    output: Output,
) -> Result<(), Failure> {
    let within_one_hand = || all.iter().filter(|asked| asked.beyond().is_none());
    let one_hand = within_one_hand().count();
    let found = within_one_hand().filter(|asked| asked.is_found()).count();
    if !output.json {
        return write_line(&format!(
            "{}\n{found} of {one_hand} that one hand can hold ({:.0} %) found within {}; all pictures are on {}",
            table_of(all),
            100.0 * found as f64 / one_hand as f64,
            human_time(plan.budget.as_secs_f64()),
            page.display()
        ));
    }
    let mut grasps = Vec::new();
    for (asked, files) in all.iter().zip(&drawn.files) {
        let mut row = asked.to_json(files)?;
        row["object"] = json!(asked.name);
        row["what"] = json!(asked.what.what);
        row["mass_kg"] = json!(asked.what.mass_kg());
        row["beyond_one_hand"] = json!(asked.beyond());
        grasps.push(row);
    }
    write_json(&json!({
        "folder": plan.folder,
        "page": page,
        "overview": drawn.overview,
        "one_hand": one_hand,
        "found": found,
        "grasps": grasps,
    }))
}

/// The outcome in a few words.
pub(super) fn outcome_name(asked: &Asked<EverydayObject>) -> &'static str {
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

fn table_of(all: &[Asked<EverydayObject>]) -> String {
    let mut table = table("object | >mass | outcome | type | >comfort E | >attempts | >server | >round trip");
    for asked in all {
        let [grasp_type, comfort] = asked.type_and_comfort();
        let [server, round_trip] = asked.times();
        table.add_row([
            asked.name.to_owned(),
            human_mass(asked.what.mass_kg()),
            outcome_name(asked).to_owned(),
            grasp_type,
            comfort,
            asked.answer.attempts().to_string(),
            server,
            round_trip,
        ]);
    }
    table.to_string()
}
