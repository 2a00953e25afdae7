//! The output of a finished run.

use std::fmt::Write as _;

use grasp_experiment::{
    claims::{self, Verdict},
    folder::Folder,
    report::{Report, verdicts_at_a_glance},
    table::{Table, Value},
};
use serde_json::{Map, json};

use crate::{Failure, Output, output};

pub(super) fn write(folder: &Folder, report: &Report, output: Output) -> Result<(), Failure> {
    let results = json!({
        "folder": folder.path(),
        "report": report.page,
        "ladder": rows(&report.ladder),
        "claims": rows(&claims::table(&report.claims)),
    });
    output.write(&results, |_| {
        format!(
            "{}\n{}{}\nThe report is {}",
            rendered(&report.ladder),
            departures(report),
            verdicts_at_a_glance(&report.claims),
            report.page.display()
        )
    })
}

/// The rows of a table as objects.
fn rows(table: &Table) -> Vec<Map<String, serde_json::Value>> {
    let as_json = |value: &Value| match value {
        Value::Text(text) => json!(text),
        Value::Count(count) => json!(count),
        Value::Number(number, _) => json!(number),
        Value::Missing => json!(null),
    };
    let as_object = |row: &Vec<Value>| {
        let names = table.header.iter().cloned();
        names.zip(row.iter().map(as_json)).collect()
    };
    table.rows.iter().map(as_object).collect()
}

/// Renders a table for the terminal.
fn rendered(table: &Table) -> String {
    let headed = table.header.iter().enumerate().map(|(column, name)| {
        let alignment = if table.is_numeric(column) { ">" } else { "" };
        format!("{alignment}{name}")
    });
    let header: Vec<String> = headed.collect();
    let mut rendered = output::table(&header.join(" | "));
    for row in &table.rows {
        rendered.add_row(row.iter().map(Value::to_text));
    }
    rendered.to_string()
}

/// The claims that this run contradicts, one per line.
fn departures(report: &Report) -> String {
    let mut text = String::new();
    for claim in &report.claims {
        if claim.verdict == Verdict::Differs {
            let (source, thesis, run) = (&claim.source, &claim.thesis, &claim.run);
            let _ = writeln!(text, "differs ({source}): {thesis}; here {run}");
        }
    }
    text
}
