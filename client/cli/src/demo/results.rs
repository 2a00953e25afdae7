//! The demo's results.

use std::fmt::Write as _;

use grasp_assets::holdouts::BuiltInHoldout;
use grasp_client::Outcome;
use serde_json::json;

use super::{Plan, asked::Asked, draw::Drawn};
use crate::{
    Failure, Output,
    format::rejections_at_a_glance,
    output::{table, write_json, write_line},
};

pub(super) fn write(
    plan: &Plan,
    all: &[Asked<&BuiltInHoldout>],
    drawn: &Drawn,
    output: Output,
) -> Result<(), Failure> {
    let found = all.iter().filter(|asked| asked.is_found()).count();
    if !output.json {
        return write_line(&describe(plan, all, drawn, found));
    }
    let mut grasps = Vec::new();
    for (asked, files) in all.iter().zip(&drawn.files) {
        let mut row = asked.to_json(files)?;
        row["object"] = json!(asked.what.object);
        row["holdout"] = json!(asked.name);
        grasps.push(row);
    }
    write_json(&json!({
        "folder": plan.folder,
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

fn describe(plan: &Plan, all: &[Asked<&BuiltInHoldout>], drawn: &Drawn, found: usize) -> String {
    let mut table = table(
        "object | holdout | outcome | >attempts | rejections | type | >comfort E | >server | >round trip",
    );
    for asked in all {
        let answer = &asked.answer;
        let outcome = match answer.outcome() {
            Outcome::Found => "found",
            Outcome::Aborted => "aborted",
            _ => "none in time",
        };
        let rejections = answer.report.as_ref().map(rejections_at_a_glance);
        let [grasp_type, comfort] = asked.type_and_comfort();
        let [server, round_trip] = asked.times();
        table.add_row([
            asked.what.object.clone(),
            short_name(asked.what).to_owned(),
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
        let (folder, overview) = (plan.folder.display(), overview.display());
        let _ = write!(
            text,
            "; pictures and scenes are in {folder}, an overview is {overview}"
        );
    }
    text
}
