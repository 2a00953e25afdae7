//! Answers from the objects' atlases.

use std::collections::BTreeSet;

use crate::{
    data::Data,
    plan::{Cell, Set},
    record::{Record, SearchFigures, Source},
    stats::{mean, quantile},
    table::{Table, Value},
};

/// A row per holdout of the set with atlases, next to the times of the same set without.
pub fn atlas_answers(data: &Data<'_>) -> Table {
    let mut table = Table::new(
        "atlas",
        "Answers from the atlases, by holdout, beside fresh ones (set Physical)",
        [
            "holdout",
            "grips in the atlas",
            "answers",
            "from the atlas, %",
            "different grasps",
            "valid candidates",
            "median µs",
            "99 % below, µs",
            "fresh: median µs",
            "fresh: 99 % below, µs",
            "times as fast",
        ],
    );
    for &holdout in &data.settings.holdouts {
        let own: Vec<_> = data
            .valid(Set::ATLAS)
            .filter(|record| record.cell.holdout == holdout)
            .collect();
        let Some(first) = own.first().and_then(|record| record.search?.atlas) else {
            continue;
        };
        let known = own
            .iter()
            .filter(|record| matches!(record.source, Source::AtlasEntry(_)))
            .count();
        let searches: Vec<_> = own.iter().filter_map(|record| record.search).collect();
        let candidates: Vec<_> = searches
            .iter()
            .filter_map(|search| Some(search.atlas?.candidates as f64))
            .collect();
        let times = microseconds(&searches);
        let fresh = microseconds(&data.searches(Cell {
            set: Set::PHYSICAL,
            ..own[0].cell
        }));
        let medians = quantile(&times, 0.5).zip(quantile(&fresh, 0.5));
        table.push(vec![
            own[0].cell.built_in().name.clone().into(),
            first.entries.into(),
            (own.len() as u64).into(),
            Value::decimals(100.0 * known as f64 / own.len() as f64, 0),
            different_grasps(own.iter().copied()).into(),
            Value::number(mean(&candidates)),
            Value::number(quantile(&times, 0.5)),
            Value::number(quantile(&times, 0.99)),
            Value::number(quantile(&fresh, 0.5)),
            Value::number(quantile(&fresh, 0.99)),
            Value::number(medians.map(|(known, fresh)| fresh / known)),
        ]);
    }
    table
}

/// Times of searches in microseconds.
fn microseconds(searches: &[SearchFigures]) -> Vec<f64> {
    searches
        .iter()
        .map(|search| search.nanoseconds as f64 / 1e3)
        .collect()
}

/// Number of distinct grasps in valid records: an atlas answers a holdout with the same grip every time.
pub(crate) fn different_grasps<'a>(records: impl Iterator<Item = &'a Record>) -> u64 {
    let grasps: BTreeSet<_> = records
        .map(|record| {
            let seed = record.source.attempt().map(|_| record.seed);
            (record.cell.holdout, record.source, seed)
        })
        .collect();
    grasps.len() as u64
}
