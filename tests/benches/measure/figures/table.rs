//! The measurements as a table for readers and as JSON for scripts.

use std::time::Duration;

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use grasp_experiment::stats::quantile;
use serde::Serialize;

use crate::figures::Row;

/// Samples needed for a p99: at least one lies beyond it.
const MIN_SAMPLES_P99: usize = 100;
/// Samples needed for a p99.9.
const MIN_SAMPLES_P999: usize = 1000;

/// The unit of a value.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Unit {
    /// A time in seconds.
    Seconds,
    /// A count.
    Count,
    /// A ratio.
    Times,
    /// A share from 0 to 1.
    Share,
}

impl Unit {
    /// The value with its unit, for readers.
    fn format(self, value: f64) -> String {
        match self {
            Self::Seconds => time(value),
            Self::Count => format!("{value:.0}"),
            Self::Times if value >= 100.0 => format!("{value:.0} ×"),
            Self::Times => format!("{value:.2} ×"),
            Self::Share => format!("{:.2} %", 100.0 * value),
        }
    }
}

/// A time in a fitting unit with about three digits; may be negative.
pub(crate) fn time(seconds: f64) -> String {
    let (value, unit) = match seconds.abs() {
        ..1e-3 => (seconds * 1e6, "µs"),
        ..1.0 => (seconds * 1e3, "ms"),
        _ => (seconds, "s"),
    };
    let decimals = match value.abs() {
        ..9.995 => 2,
        ..99.95 => 1,
        _ => 0,
    };
    format!("{value:.decimals$} {unit}")
}

/// The spread of values. Outer quantiles are omitted if there are too few.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Spread {
    pub(crate) count: usize,
    pub(crate) median: f64,
    pub(crate) p99: Option<f64>,
    pub(crate) p999: Option<f64>,
    pub(crate) max: f64,
}

impl Spread {
    /// The spread of at least one value.
    pub(crate) fn of(values: &[f64]) -> Self {
        let at = |share| quantile(values, share).expect("there is at least one value");
        Self {
            count: values.len(),
            median: at(0.5),
            p99: (values.len() >= MIN_SAMPLES_P99).then(|| at(0.99)),
            p999: (values.len() >= MIN_SAMPLES_P999).then(|| at(0.999)),
            max: at(1.0),
        }
    }

    /// The spread of at least one time, in seconds.
    pub(crate) fn of_times(times: impl IntoIterator<Item = Duration>) -> Self {
        let seconds: Vec<f64> = times.into_iter().map(|time| time.as_secs_f64()).collect();
        Self::of(&seconds)
    }
}

/// The side of its limit on which a figure should be.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Side {
    /// Not above.
    AtMost,
    /// Not below.
    AtLeast,
}

/// A figure with its limit.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Target {
    figure: String,
    unit: Unit,
    value: f64,
    side: Side,
    limit: f64,
    met: bool,
}

impl Target {
    /// `value` of `figure` should not exceed `limit`.
    pub(crate) fn at_most(figure: &str, unit: Unit, value: f64, limit: f64) -> Self {
        Self {
            figure: figure.to_owned(),
            unit,
            value,
            side: Side::AtMost,
            limit,
            met: value <= limit,
        }
    }

    /// `value` of `figure` should reach `limit`.
    pub(crate) fn at_least(figure: &str, unit: Unit, value: f64, limit: f64) -> Self {
        Self {
            side: Side::AtLeast,
            met: value >= limit,
            ..Self::at_most(figure, unit, value, limit)
        }
    }

    /// Not met if the wait timed out; `value` is then the duration of the wait.
    pub(crate) fn failed_if(self, timed_out: bool) -> Self {
        Self {
            met: self.met && !timed_out,
            ..self
        }
    }

    fn describe(&self) -> String {
        let side = match self.side {
            Side::AtMost => "≤",
            Side::AtLeast => "≥",
        };
        format!("{} {side} {}", self.figure, self.unit.format(self.limit))
    }

    fn verdict(&self) -> String {
        let met = if self.met { "met" } else { "NOT MET" };
        format!("{met}: {}", self.unit.format(self.value))
    }
}

/// A line of the table.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Line {
    row: Row,
    what: String,
    unit: Unit,
    spread: Spread,
    /// A remark.
    remark: String,
    targets: Vec<Target>,
}

impl Line {
    /// A line without remark and targets.
    pub(crate) fn new(row: Row, what: impl Into<String>, unit: Unit, spread: Spread) -> Self {
        Self {
            row,
            what: what.into(),
            unit,
            spread,
            remark: String::new(),
            targets: Vec::new(),
        }
    }

    /// The line with a remark.
    pub(crate) fn remark(self, remark: impl Into<String>) -> Self {
        Self {
            remark: remark.into(),
            ..self
        }
    }

    /// The line with one more target.
    pub(crate) fn target(mut self, target: Target) -> Self {
        self.targets.push(target);
        self
    }

    /// The line with limits for median, p99 and p99.9, as far as there are enough samples.
    pub(crate) fn limits(mut self, median: f64, p99: f64, p999: Option<f64>) -> Self {
        let spread = self.spread;
        let figures = [
            ("median", Some(spread.median), Some(median)),
            ("p99", spread.p99, Some(p99)),
            ("p99.9", spread.p999, p999),
        ];
        for (figure, value, limit) in figures {
            if let (Some(value), Some(limit)) = (value, limit) {
                self.targets
                    .push(Target::at_most(figure, self.unit, value, limit));
            }
        }
        self
    }
}

/// A line below the header only, like the tables of the command line.
const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The table of all lines.
pub(crate) fn render(lines: &[Line]) -> String {
    let header = [
        "row", "of", "n", "median", "p99", "p99.9", "max", "target", "", "remark",
    ];
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header);
    for (name, column) in header.iter().zip(table.column_iter_mut()) {
        if matches!(*name, "n" | "median" | "p99" | "p99.9" | "max") {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    for line in lines {
        let spread = line.spread;
        let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| line.unit.format(value));
        let targets: Vec<_> = line.targets.iter().map(Target::describe).collect();
        let verdicts: Vec<_> = line.targets.iter().map(Target::verdict).collect();
        table.add_row([
            line.row.name().to_owned(),
            line.what.clone(),
            spread.count.to_string(),
            cell(Some(spread.median)),
            cell(spread.p99),
            cell(spread.p999),
            cell(Some(spread.max)),
            targets.join("\n"),
            verdicts.join("\n"),
            line.remark.clone(),
        ]);
    }
    let targets = || lines.iter().flat_map(|line| &line.targets);
    let met = targets().filter(|target| target.met).count();
    format!("{table}\n\n{met} of {} targets are met.", targets().count())
}
