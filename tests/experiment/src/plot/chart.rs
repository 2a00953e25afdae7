//! Height, legend and drawing of all kinds of charts.

use super::{
    Chart, Series, grouped_bars, histogram,
    legend::Entry,
    scatter, stacked_bars, strips,
    svg::{Area, Drawn},
};

/// Below the rows of a chart, for its axis, in pixels.
const BELOW_ROWS: f64 = 54.0;

/// Height without title and legend at a width, in pixels.
pub(super) fn height(chart: &Chart, width: f64) -> f64 {
    match chart {
        Chart::Scatter { .. } => (0.78 * width).clamp(200.0, 440.0),
        Chart::Strips { series, .. } => BELOW_ROWS + strips::STRIP * series.len().max(1) as f64,
        Chart::Histogram { .. } => (0.64 * width).clamp(190.0, 320.0),
        Chart::StackedBars { rows, .. } => BELOW_ROWS + stacked_bars::ROW * rows.len().max(1) as f64,
        Chart::GroupedBars { .. } => (0.68 * width).clamp(230.0, 360.0),
    }
}

/// Entries of the legend. Strips have none, as they show their names.
pub(super) fn legend(chart: &Chart) -> Vec<Entry<'_>> {
    match chart {
        Chart::Scatter { series, .. } => entries(series),
        Chart::Strips { .. } => Vec::new(),
        Chart::Histogram { series, .. } => entries(series),
        Chart::StackedBars { series, .. } | Chart::GroupedBars { series, .. } => entries(series),
    }
}

fn entries<T>(series: &[Series<T>]) -> Vec<Entry<'_>> {
    series
        .iter()
        .map(|series| (series.name.as_str(), series.colour))
        .filter(|(name, _)| !name.is_empty())
        .collect()
}

/// Draws the chart without title and legend; returns the left and right ends of its plot, in pixels.
pub(super) fn draw(area: &Area<'_>, chart: &Chart) -> Drawn<(f64, f64)> {
    match chart {
        Chart::Scatter { x, y, series } => scatter::draw(area, x, y, series),
        Chart::Strips { x, series } => strips::draw(area, x, series),
        Chart::Histogram {
            label,
            start,
            width,
            series,
        } => histogram::draw(area, label, (*start, *width), series),
        Chart::StackedBars { label, rows, series } => stacked_bars::draw(area, label, rows, series),
        Chart::GroupedBars {
            label,
            groups,
            series,
        } => grouped_bars::draw(area, label, groups, series),
    }
}
