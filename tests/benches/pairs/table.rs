//! How many pairs of each reason are ranked right.

use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};
use grasp_tests::pairs::{pairing::Pair, reasons::Reason};
use serde::Serialize;

/// A line below the header only, like the tables of the command line.
pub(crate) const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

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
            mean_margin: pairs.iter().map(|pair| pair.margin()).sum::<f32>() / pairs.len().max(1) as f32,
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
    let mut table = empty(&["reason", "objects", "pairs", "ranked right", "mean margin"]);
    for line in lines {
        table.add_row([
            line.reason.to_owned(),
            line.objects.to_string(),
            line.pairs.to_string(),
            percent(line.right, line.pairs),
            format!("{:.3}", line.mean_margin),
        ]);
    }
    table.to_string()
}

/// A table of texts, then numbers.
pub(crate) fn empty(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(LINE_BELOW_HEADER)
        .set_content_arrangement(ContentArrangement::Disabled)
        .set_header(header);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn percent(part: usize, whole: usize) -> String {
    if whole == 0 {
        "–".to_owned()
    } else {
        format!("{:.1} %", 100.0 * part as f32 / whole as f32)
    }
}

/// The rows of the same table in HTML.
pub(crate) fn html_rows(lines: &[Line]) -> String {
    let row = |line: &Line| {
        format!(
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{:.3}\n",
            line.reason,
            line.objects,
            line.pairs,
            percent(line.right, line.pairs),
            line.mean_margin
        )
    };
    let header = "<tr><th>reason<th>objects<th>pairs<th>ranked right<th>mean margin\n".to_owned();
    [header].into_iter().chain(lines.iter().map(row)).collect()
}
