//! Lists of all grasps and attempts: the data of the figures, with what reproduces each row.

use grasp_synthesis::{base::rejection::Rejection, model::hand::Digit};
use serde::Serialize;

use super::comfort::{contacts_of, touching_digits};
use crate::{
    data::Data,
    plan::Cell,
    record::{Details, Record, STEP_NAMES, Source, output_type},
    table::{Table, Value},
};

/// The columns of [`origin`].
const ORIGIN: [&str; 10] = [
    "validity",
    "strategy",
    "bend_ratios",
    "atlas",
    "threads",
    "holdout",
    "number",
    "seed",
    "attempt",
    "atlas_entry",
];

/// All valid grasps, including those on more threads and of Figure 5.20's columns. `atlas` says whether an atlas was
/// used, and `attempt` or `atlas_entry` where the grasp came from.
pub fn grasp_list(data: &Data<'_>) -> Table {
    let mut header: Vec<_> = ORIGIN.to_vec();
    header.extend(["attempts", "prunes", "milliseconds"]);
    header.extend(Rejection::THESIS.map(|rejection| output_type(Some(rejection))));
    header.extend([
        "touching_digits",
        "contacts",
        "wrench_angle_degrees",
        "comfort",
        "sufficient_distributions",
    ]);
    let mut table = Table::new("grasps", "All valid grasps", header);
    for record in data.records() {
        let Some(search) = record.search.filter(|_| record.is_valid()) else {
            continue;
        };
        let mut row = origin(record);
        row.extend([
            search.attempts.into(),
            search.pruned_placements.into(),
            Value::number(search.nanoseconds as f64 / 1e6),
        ]);
        row.extend(search.rejections.map(Value::from));
        let details = record.details.as_ref();
        row.push(Value::decimals(details.map(touching_digits), 0));
        row.push(Value::decimals(details.map(contacts_of), 0));
        let grasp = record.grasp();
        row.push(Value::number(
            grasp.map(|grasp| f64::from(grasp.wrench_angle_degrees)),
        ));
        row.push(Value::number(grasp.map(|grasp| f64::from(grasp.comfort))));
        let sufficient = grasp.and_then(|grasp| grasp.sufficient_distributions);
        row.push(Value::decimals(sufficient.map(f64::from), 0));
        table.push(row);
    }
    table
}

/// All examined attempts: the positive and the negative sets on one thread.
pub fn attempt_list(data: &Data<'_>) -> Table {
    let mut header: Vec<_> = ORIGIN.map(str::to_owned).to_vec();
    header.extend(
        [
            "output_type",
            "wrist_distance_cm",
            "palm_distance_cm",
            "upward_wrist_angle_degrees",
            "forward_wrist_angle_degrees",
            "palm_com_palm_angle_degrees",
        ]
        .map(str::to_owned),
    );
    for digit in Digit::ALL {
        let name = format!("{digit:?}").to_lowercase();
        header.extend(
            ["yaw_degrees", "bend_degrees", "bend_ratio", "contacts"].map(|of| format!("{name}_{of}")),
        );
    }
    header.extend(STEP_NAMES.map(|name| format!("{}_us", name.to_lowercase().replace(' ', "_"))));
    let mut table = Table::new("attempts", "All attempts of the grasp sets", header);
    for record in data.records() {
        if let Some(details) = &record.details {
            let mut row = origin(record);
            row.push(output_type(record.rejection).into());
            row.extend(details_of(details));
            table.push(row);
        }
    }
    table
}

/// The columns that reproduce a record.
fn origin(record: &Record) -> Vec<Value> {
    let Cell { set, threads, .. } = record.cell;
    let or_missing = |index: Option<u64>| index.map_or(Value::Missing, Value::from);
    let entry = match record.source {
        Source::Attempt(_) | Source::Nowhere => None,
        Source::AtlasEntry(entry) => Some(u64::from(entry)),
    };
    vec![
        spelled(set.validity),
        format!("{:?}", set.strategy).to_uppercase().into(),
        spelled(set.bend_ratios),
        if set.atlas { "allowed" } else { "none" }.into(),
        (threads as u64).into(),
        record.cell.built_in().name.clone().into(),
        record.number.into(),
        record.seed.into(),
        or_missing(record.source.attempt()),
        or_missing(entry),
    ]
}

/// A choice as on the command line.
fn spelled(choice: impl Serialize) -> Value {
    let name = serde_json::to_value(choice);
    let name = name.ok().and_then(|name| name.as_str().map(str::to_owned));
    name.map_or(Value::Missing, |name| name.replace('_', "-").into())
}

fn details_of(details: &Details) -> Vec<Value> {
    let measures = details.measures.as_ref();
    let mut row: Vec<_> = [
        measures.map(|measures| measures.wrist_distance_cm),
        measures.map(|measures| measures.palm_distance_cm),
        measures.map(|measures| measures.upward_degrees),
        measures.map(|measures| measures.forward_degrees),
        measures.and_then(|measures| measures.palm_com_palm_degrees),
    ]
    .map(|value| Value::number(value.map(f64::from)))
    .to_vec();
    for digit in 0..5 {
        match details.digits.get(digit) {
            Some(posed) => row.extend([
                Value::number(f64::from(posed.yaw_degrees)),
                Value::number(f64::from(posed.bend_degrees)),
                Value::number(posed.bend_ratio.map(f64::from)),
                u64::from(posed.contacts).into(),
            ]),
            None => row.extend([const { Value::Missing }; 4]),
        }
    }
    row.extend(match details.step_nanoseconds {
        Some(times) => times.map(|time| Value::number(time as f64 / 1e3)),
        None => [const { Value::Missing }; 5],
    });
    row
}
