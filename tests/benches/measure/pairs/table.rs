//! How many pairs of each reason are ranked right.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use grasp_tests::pairs::{pairing::Pair, reasons::Reason};
use serde::Serialize;

/// A line below the header only, like the tables of the command line.
pub(crate) const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// The columns of the table.
const HEADER: [&str; 5] = ["reason", "objects", "pairs", "ranked right", "mean margin"];

/// What stands for a figure of no pairs.
const NOTHING: &str = "–";

/// The pairs of a reason, or all.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Line {
    reason: &'static str,
    objects: usize,
    pairs: usize,
    right: usize,
    mean_margin: f32,
}

impl Line {
    fn new(reason: &'static str, pairs: &[&Pair<'_>]) -> Self {
        let mut objects: Vec<usize> = pairs.iter().map(|pair| pair.gathered.object).collect();
        objects.sort_unstable();
        objects.dedup();
        Self {
            reason,
            objects: objects.len(),
            pairs: pairs.len(),
            right: pairs.iter().filter(|pair| pair.is_right()).count(),
            mean_margin: pairs.iter().map(|pair| pair.margin()).sum::<f32>() / pairs.len() as f32,
        }
    }

    fn share_right(&self) -> f64 {
        self.right as f64 / self.pairs as f64
    }

    fn margin(&self) -> String {
        if self.pairs == 0 {
            NOTHING.to_owned()
        } else {
            format!("{:.3}", self.mean_margin)
        }
    }
}

/// One line for each reason, and one for all together.
pub(crate) fn lines(pairs: &[Pair<'_>]) -> Vec<Line> {
    let of_reason = |reason: Reason| {
        let own: Vec<_> = pairs.iter().filter(|pair| pair.reason == reason).collect();
        Line::new(reason.name(), &own)
    };
    let mut lines: Vec<Line> = Reason::ALL.into_iter().map(of_reason).collect();
    lines.push(Line::new("all", &pairs.iter().collect::<Vec<_>>()));
    lines
}

/// The table of the lines.
pub(crate) fn render(lines: &[Line]) -> String {
    let mut table = empty(HEADER.map(str::to_owned));
    for line in lines {
        table.add_row([
            line.reason.to_owned(),
            line.objects.to_string(),
            line.pairs.to_string(),
            percent(line.share_right()),
            line.margin(),
        ]);
    }
    table.to_string()
}

/// A table of texts, then numbers.
pub(crate) fn empty(header: impl IntoIterator<Item = String>) -> Table {
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header.into_iter().collect::<Vec<_>>());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A share as text; a dash if it is of nothing.
pub(crate) fn percent(share: f64) -> String {
    if share.is_nan() {
        NOTHING.to_owned()
    } else {
        format!("{:.1} %", 100.0 * share)
    }
}

/// The rows of the same table in HTML.
pub(crate) fn html_rows(lines: &[Line]) -> String {
    let row = |line: &Line| {
        format!(
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{}\n",
            line.reason,
            line.objects,
            line.pairs,
            percent(line.share_right()),
            line.margin()
        )
    };
    let header = format!("<tr><th>{}\n", HEADER.join("<th>"));
    [header].into_iter().chain(lines.iter().map(row)).collect()
}
