//! The measurements as a table for readers and as JSON for scripts.

use std::time::Duration;

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use grasp_experiment::stats::quantile;
use serde::Serialize;

use crate::deadlines::{
    Report,
    calls::{Call, End, Load},
};

/// Target: share of calls that are late.
const LATE: f64 = 0.02;

/// The calls of one kind in a cell. Times are in milliseconds.
#[derive(Debug, Serialize)]
pub(crate) struct Row {
    /// "busy" or "idle again".
    condition: &'static str,
    deadline: f64,
    in_flight: usize,
    /// "ordinary" or "hard".
    kind: &'static str,
    calls: usize,
    /// Shares of the calls.
    found: f64,
    exhausted: f64,
    late: f64,
    /// The deadline less the time of a search that exhausted its budget.
    reserve_median: Option<f64>,
    reserve_max: Option<f64>,
    /// What the answer took beyond that time, in the client.
    beyond_search_median: Option<f64>,
    beyond_search_p99: Option<f64>,
    /// The whole call.
    round_trip_p99: Option<f64>,
}

/// The rows of a cell.
pub(crate) fn rows(condition: &'static str, load: &Load, calls: &[Call]) -> Vec<Row> {
    [("ordinary", false), ("hard", true)]
        .into_iter()
        .map(|(kind, is_hard)| {
            let calls: Vec<Call> = calls
                .iter()
                .copied()
                .filter(|call| call.is_hard == is_hard)
                .collect();
            row(condition, kind, load, &calls)
        })
        .collect()
}

fn row(condition: &'static str, kind: &'static str, load: &Load, calls: &[Call]) -> Row {
    let share = |end: End| calls.iter().filter(|call| call.end == end).count() as f64 / calls.len() as f64;
    let exhausted = || calls.iter().filter(|call| call.end == End::Exhausted);
    let reserves: Vec<f64> = exhausted()
        .filter_map(|call| Some(milliseconds(load.deadline.saturating_sub(call.search_time?))))
        .collect();
    let beyond_search: Vec<f64> = exhausted()
        .filter_map(|call| Some(milliseconds(call.round_trip.saturating_sub(call.search_time?))))
        .collect();
    let round_trips: Vec<f64> = calls.iter().map(|call| milliseconds(call.round_trip)).collect();
    Row {
        condition,
        deadline: milliseconds(load.deadline),
        in_flight: load.in_flight,
        kind,
        calls: calls.len(),
        found: share(End::Found),
        exhausted: share(End::Exhausted),
        late: share(End::Late),
        reserve_median: quantile(&reserves, 0.5),
        reserve_max: quantile(&reserves, 1.0),
        beyond_search_median: quantile(&beyond_search, 0.5),
        beyond_search_p99: quantile(&beyond_search, 0.99),
        round_trip_p99: quantile(&round_trips, 0.99),
    }
}

fn milliseconds(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

/// A line below the header only, like the tables of the command line.
const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The table of all rows, in milliseconds.
pub(crate) fn render(report: &Report) -> String {
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header([
            "machine",
            "calls",
            "deadline",
            "in flight",
            "n",
            "found",
            "exhausted",
            "late",
            "reserve, median",
            "max",
            "beyond search, median",
            "p99",
            "whole call, p99",
        ]);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let time = |time: Option<f64>| time.map_or_else(|| "–".to_owned(), |time| format!("{time:.1}"));
    for row in &report.rows {
        table.add_row([
            row.condition.to_owned(),
            row.kind.to_owned(),
            format!("{:.0}", row.deadline),
            row.in_flight.to_string(),
            row.calls.to_string(),
            percent(row.found),
            percent(row.exhausted),
            percent(row.late),
            time(row.reserve_median),
            time(row.reserve_max),
            time(row.beyond_search_median),
            time(row.beyond_search_p99),
            time(row.round_trip_p99),
        ]);
    }
    let load = |load: &Option<String>| load.clone().unwrap_or_else(|| "unknown".to_owned());
    let met = report.rows.iter().filter(|row| row.late <= LATE).count();
    format!(
        "{}; {} burners; load average {} before and {} after; times in ms\n\n{table}\n\n\
         in {met} of {} rows, no more than {:.0} % are late",
        report.machine,
        report.burners,
        load(&report.load_before),
        load(&report.load_after),
        report.rows.len(),
        100.0 * LATE
    )
}
