//! The demo's results.

use std::{fmt::Write as _, path::Path};

use grasp_assets::holdouts::BuiltInHoldout;
use grasp_client::Outcome;
use serde_json::json;

use super::{answer::AnsweredHoldout, draw::Drawn};
use crate::{
    Failure, Output,
    format::rejections_at_a_glance,
    output::{table, write_json, write_line},
};

pub(super) fn write(
    folder: &Path,
    all: &[AnsweredHoldout],
    drawn: &Drawn,
    output: Output,
) -> Result<(), Failure> {
    let found = all.iter().filter(|answered| answered.is_found()).count();
    if !output.json {
        return write_line(&describe(folder, all, drawn, found));
    }
    let mut grasps = Vec::new();
    for (answered, files) in all.iter().zip(&drawn.files) {
        let mut row = answered.to_json(files)?;
        row["object"] = json!(answered.holdout.object);
        row["holdout"] = json!(answered.holdout.name);
        grasps.push(row);
    }
    write_json(&json!({
        "folder": folder,
        "overview": drawn.overview,
        "found": found,
        "grasps": grasps,
    }))
}

/// The holdout's name without its object, which has its own column.
fn short_name(holdout: &BuiltInHoldout) -> &str {
    let rest = holdout.name.strip_prefix(&holdout.object);
    let rest = rest.and_then(|rest| rest.strip_prefix('-'));
    rest.unwrap_or(&holdout.name)
}

fn describe(folder: &Path, all: &[AnsweredHoldout], drawn: &Drawn, found: usize) -> String {
    let mut table = table(
        "object | holdout | outcome | >attempts | rejections | type | >comfort E | >server | >round trip",
    );
    for answered in all {
        let answer = &answered.answer;
        let outcome = match answer.outcome() {
            Outcome::Found => "found",
            Outcome::Aborted => "aborted",
            _ => "none in time",
        };
        let rejections = answer.report.as_ref().map(rejections_at_a_glance);
        let [grasp_type, comfort] = answered.type_and_comfort();
        let [server, round_trip] = answered.times();
        table.add_row([
            answered.holdout.object.clone(),
            short_name(answered.holdout).to_owned(),
            outcome.to_owned(),
            answer.attempts().to_string(),
            rejections.unwrap_or_default(),
            grasp_type,
            comfort,
            server,
            round_trip,
        ]);
    }
    let mut text = format!("{table}\n{found} of {} found", all.len());
    if let Some(overview) = &drawn.overview {
        let (folder, overview) = (folder.display(), overview.display());
        let _ = write!(
            text,
            "; pictures and scenes are in {folder}, an overview is {overview}"
        );
    }
    text
}
