//! The measurements as a table.

use std::time::Duration;

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

/// Samples needed for a p99 and a p99.9: at least one lies beyond it.
const MIN_SAMPLES_P99: usize = 100;
const MIN_SAMPLES_P999: usize = 1000;

/// The unit of a value.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Unit {
    /// A time in seconds.
    Seconds,
    /// A ratio.
    Times,
    /// A share from 0 to 1.
    Share,
}

impl Unit {
    /// The value with its unit.
    fn format(self, value: f64) -> String {
        match self {
            Self::Seconds => time(value),
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

/// The quantile at a share from 0 to 1, with linear interpolation; `None` without values.
pub(crate) fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = share * (sorted.len().checked_sub(1)? as f64);
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(below + (above - below) * place.fract())
}

/// The spread of values. Outer quantiles are omitted if there are too few.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    count: usize,
    pub(crate) median: f64,
    pub(crate) p99: Option<f64>,
    p999: Option<f64>,
    max: f64,
}

impl Spread {
    /// The spread of values; of none, everything is NaN.
    pub(crate) fn of(values: &[f64]) -> Self {
        let at = |share| quantile(values, share).unwrap_or(f64::NAN);
        Self {
            count: values.len(),
            median: at(0.5),
            p99: (values.len() >= MIN_SAMPLES_P99).then(|| at(0.99)),
            p999: (values.len() >= MIN_SAMPLES_P999).then(|| at(0.999)),
            max: at(1.0),
        }
    }

    /// The spread of times, in seconds.
    pub(crate) fn of_times(times: impl IntoIterator<Item = Duration>) -> Self {
        let seconds: Vec<f64> = times.into_iter().map(|time| time.as_secs_f64()).collect();
        Self::of(&seconds)
    }
}

/// A figure with its limit, as text, and whether it keeps to it.
#[derive(Clone, Debug)]
struct Target {
    limit: String,
    verdict: String,
    is_met: bool,
}

/// A line of the table.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    what: String,
    unit: Unit,
    spread: Spread,
    remark: String,
    targets: Vec<Target>,
}

impl Line {
    /// A line without remark and targets.
    pub(crate) fn new(what: impl Into<String>, unit: Unit, spread: Spread) -> Self {
        Self {
            what: what.into(),
            unit,
            spread,
            remark: String::new(),
            targets: Vec::new(),
        }
    }

    /// The line of times.
    pub(crate) fn of_times(what: impl Into<String>, times: impl IntoIterator<Item = Duration>) -> Self {
        Self::new(what, Unit::Seconds, Spread::of_times(times))
    }

    /// The line with a remark.
    pub(crate) fn remark(self, remark: impl Into<String>) -> Self {
        Self {
            remark: remark.into(),
            ..self
        }
    }

    /// The line with the target that `value` of `figure` should not exceed `limit`.
    pub(crate) fn at_most(self, figure: &str, unit: Unit, value: f64, limit: f64) -> Self {
        self.target(&format!("{figure} ≤"), unit, [value, limit], value <= limit)
    }

    /// The line with the target that `value` of `figure` should reach `limit`.
    pub(crate) fn at_least(self, figure: &str, unit: Unit, value: f64, limit: f64) -> Self {
        self.target(&format!("{figure} ≥"), unit, [value, limit], value >= limit)
    }

    fn target(mut self, figure: &str, unit: Unit, [value, limit]: [f64; 2], is_met: bool) -> Self {
        let met = if is_met { "met" } else { "NOT MET" };
        self.targets.push(Target {
            limit: format!("{figure} {}", unit.format(limit)),
            verdict: format!("{met}: {}", unit.format(value)),
            is_met,
        });
        self
    }

    /// The line with limits for median, p99 and p99.9, as far as there are enough samples.
    pub(crate) fn limits(self, median: f64, p99: f64, p999: Option<f64>) -> Self {
        let (unit, spread) = (self.unit, self.spread);
        let figures = [
            ("median", Some(spread.median), Some(median)),
            ("p99", spread.p99, Some(p99)),
            ("p99.9", spread.p999, p999),
        ];
        figures
            .into_iter()
            .fold(self, |line, (figure, value, limit)| match (value, limit) {
                (Some(value), Some(limit)) => line.at_most(figure, unit, value, limit),
                _ => line,
            })
    }
}

/// A line below the header only, like the tables of the command line.
const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The table of all lines.
pub(crate) fn render(lines: &[Line]) -> String {
    let header = ["of", "n", "median", "p99", "p99.9", "max", "target", "", "remark"];
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header);
    for column in table.column_iter_mut().skip(1).take(5) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    for line in lines {
        let spread = line.spread;
        let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| line.unit.format(value));
        let of_targets = |text: fn(&Target) -> &str| {
            let texts: Vec<&str> = line.targets.iter().map(text).collect();
            texts.join("\n")
        };
        table.add_row([
            line.what.clone(),
            spread.count.to_string(),
            cell(Some(spread.median)),
            cell(spread.p99),
            cell(spread.p999),
            cell(Some(spread.max)),
            of_targets(|target| &target.limit),
            of_targets(|target| &target.verdict),
            line.remark.clone(),
        ]);
    }
    let targets = || lines.iter().flat_map(|line| &line.targets);
    let met = targets().filter(|target| target.is_met).count();
    format!("{table}\n\n{met} of {} targets are met.", targets().count())
}
