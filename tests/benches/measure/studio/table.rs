//! The measurements as text.

use comfy_table::{CellAlignment, LineStyle, Table, TableStyle};

use crate::studio::Report;

const LINE_BELOW_HEADER: TableStyle =
    TableStyle::new().header_separator(LineStyle::none().fill('─').junction('─'));

/// A line per interval.
pub(crate) fn render(report: &Report) -> String {
    let mut table = Table::new();
    table.load_style(LINE_BELOW_HEADER);
    table.set_header([
        "from",
        "calls",
        "from atlases",
        "in 50 ms",
        "median",
        "p99",
        "memory",
    ]);
    for interval in &report.intervals {
        table.add_row([
            format!("{:.0} s", interval.from_seconds),
            interval.calls.to_string(),
            format!("{:.1} %", 100.0 * interval.share_from_atlases),
            format!("{:.1} %", 100.0 * interval.share_in_time),
            format!("{:.2} ms", interval.median_milliseconds),
            format!("{:.1} ms", interval.p99_milliseconds),
            format!("{:.0} MB", interval.megabytes),
        ]);
    }
    for column in table.column_iter_mut() {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let answered = match report.seconds_until_answered_from_atlases {
        Some(seconds) => format!("nine in ten calls are answered from atlases after {seconds:.0} s"),
        None => "fewer than nine in ten calls are answered from atlases at the end".to_owned(),
    };
    format!(
        "{} objects, created in {:.0} s; {} calls per second, exponent {}; memory {:.0} MB before and {:.0} MB with all \
         objects; {answered}\n\n{table}",
        report.objects,
        report.creation_seconds,
        report.calls_per_second,
        report.exponent,
        report.megabytes_before,
        report.megabytes_created,
    )
}
