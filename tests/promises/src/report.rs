//! The promises with their targets and figures, as a table and as JSON.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use serde::Serialize;

/// The unit of a figure.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Unit {
    /// A share from 0 to 1, shown in percent.
    Share,
    /// Milliseconds.
    Milliseconds,
    /// Seconds.
    Seconds,
    /// Processor cores.
    Cores,
    /// MiB.
    Mebibytes,
}

impl Unit {
    fn format(self, value: f64) -> String {
        match self {
            Self::Share if value > 0.99 => format!("{:.2} %", 100.0 * value),
            Self::Share => format!("{:.1} %", 100.0 * value),
            Self::Milliseconds => format!("{value:.2} ms"),
            Self::Seconds => format!("{value:.2} s"),
            Self::Cores => format!("{value:.2} cores"),
            Self::Mebibytes => format!("{value:.1} MiB"),
        }
    }
}

/// The bounds of a figure: `must` decides, `aim` is reported.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Target {
    /// Not less than this.
    AtLeast { must: f64, aim: f64 },
    /// Not more than this.
    AtMost { must: f64, aim: f64 },
    /// Stated, not bound.
    Stated,
}

/// A promise and its figure.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// The promise in words.
    pub(crate) promise: String,
    /// Its bounds.
    pub(crate) target: Target,
    /// The unit of the bounds and of the figure.
    pub(crate) unit: Unit,
    /// The figure.
    pub(crate) measured: f64,
    /// How it was measured, and figures that explain it.
    pub(crate) how: String,
    /// Cores that other programs took meanwhile, in the mean.
    pub(crate) cores_of_others: f64,
}

/// Cores of other programs beyond which a missed bound shows nothing.
const MAX_CORES_OF_OTHERS: f64 = 0.1;

impl Row {
    /// A promise that the figure is not less than a bound.
    pub(crate) fn at_least(
        promise: &str,
        unit: Unit,
        [must, aim]: [f64; 2],
        measured: f64,
        how: String,
    ) -> Self {
        Self::new(promise, Target::AtLeast { must, aim }, unit, measured, how)
    }

    /// A promise that the figure is not more than a bound.
    pub(crate) fn at_most(
        promise: &str,
        unit: Unit,
        [must, aim]: [f64; 2],
        measured: f64,
        how: String,
    ) -> Self {
        Self::new(promise, Target::AtMost { must, aim }, unit, measured, how)
    }

    /// A figure without a bound.
    pub(crate) fn stated(promise: &str, unit: Unit, measured: f64, how: String) -> Self {
        Self::new(promise, Target::Stated, unit, measured, how)
    }

    /// A scenario that failed before there was a figure.
    pub(crate) fn failed(scenario: &str, error: String) -> Self {
        Self::at_least(scenario, Unit::Share, [1.0, 1.0], f64::NAN, error)
    }

    fn new(promise: &str, target: Target, unit: Unit, measured: f64, how: String) -> Self {
        Self {
            promise: promise.to_owned(),
            target,
            unit,
            measured,
            how,
            cores_of_others: 0.0,
        }
    }

    /// True unless a bound is missed. A figure that could not be measured misses it.
    pub(crate) fn is_kept(&self) -> bool {
        match self.target {
            Target::AtLeast { must, .. } => self.measured >= must,
            Target::AtMost { must, .. } => self.measured <= must,
            Target::Stated => true,
        }
    }

    /// True if other programs may be why a bound was missed.
    pub(crate) fn is_disturbed(&self) -> bool {
        self.cores_of_others > MAX_CORES_OF_OTHERS
    }

    /// The better of two measurements of the same promise; the later one of those that are only stated, and of missed ones the one that
    /// was not disturbed.
    pub(crate) fn better(self, later: Self) -> Self {
        let is_first_higher = self.measured > later.measured;
        let is_first_better = match self.target {
            Target::Stated => false,
            _ if self.is_kept() != later.is_kept() => self.is_kept(),
            _ if !self.is_kept() && self.is_disturbed() != later.is_disturbed() => later.is_disturbed(),
            _ if later.measured.is_nan() => true,
            Target::AtLeast { .. } => is_first_higher,
            Target::AtMost { .. } => !is_first_higher,
        };
        if is_first_better { self } else { later }
    }

    fn verdict(&self) -> &'static str {
        let reaches_aim = match self.target {
            Target::AtLeast { aim, .. } => self.measured >= aim,
            Target::AtMost { aim, .. } => self.measured <= aim,
            Target::Stated => return "",
        };
        match (self.is_kept(), reaches_aim) {
            (false, _) if self.is_disturbed() => "missed beside other programs",
            (false, _) => "MISSED",
            (true, false) => "kept",
            (true, true) => "kept, aim reached",
        }
    }

    fn target_text(&self) -> String {
        let (sign, must, aim) = match self.target {
            Target::AtLeast { must, aim } => ('≥', must, aim),
            Target::AtMost { must, aim } => ('≤', must, aim),
            Target::Stated => return "stated".to_owned(),
        };
        format!(
            "{sign} {} (aim {})",
            self.unit.format(must),
            self.unit.format(aim)
        )
    }
}

/// A line below the header only, like the tables of the command line.
const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The rows as a table.
pub(crate) fn table(rows: &[Row]) -> String {
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(["promise", "target", "measured", "", "how"]);
    for column in table.column_iter_mut().skip(2).take(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    for row in rows {
        table.add_row([
            row.promise.clone(),
            row.target_text(),
            row.unit.format(row.measured),
            row.verdict().to_owned(),
            row.how.clone(),
        ]);
    }
    table.to_string()
}

/// The quantile at a share from 0 to 1, the higher of two neighbours; NaN without values.
pub(crate) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    sorted[((share * last as f64).ceil() as usize).min(last)]
}
