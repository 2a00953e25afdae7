//! Counts in bins, with stacked series.

use plotters::{element::Rectangle, style::Color};

use super::{
    Axis, Series, dots,
    frame::{self, Marks, Side},
    numbers,
    svg::{Area, Drawn},
};

/// Share of a bin's width that its bar fills.
const FILLED: f64 = 0.96;
/// Height of the plot relative to the highest bar.
const HEADROOM: f64 = 1.05;

/// Draws the chart; returns the left and right ends of its plot, in pixels.
pub(super) fn draw(
    area: &Area<'_>,
    label: &str,
    (start, width): (f64, f64),
    series: &[Series<u64>],
) -> Drawn<(f64, f64)> {
    let bins = series.iter().map(|series| series.values.len()).max().unwrap_or(0);
    let end = |start: f64, width: f64| start + width * bins.max(1) as f64;
    // Bins that an axis cannot show get numbers.
    let can_be_shown = width > 0.0 && numbers::ends(start, end(start, width)) == (start, end(start, width));
    let (start, width) = if can_be_shown { (start, width) } else { (0.0, 1.0) };
    let count = |series: &Series<u64>, bin: usize| series.values.get(bin).map_or(0.0, |count| *count as f64);
    let highest = (0..bins)
        .map(|bin| series.iter().map(|series| count(series, bin)).sum())
        .fold(0.0, f64::max);

    let x = Axis {
        label: label.to_owned(),
        min: start,
        max: end(start, width),
    };
    let y = Side {
        label: "Count".to_owned(),
        ends: (0.0, if highest > 0.0 { HEADROOM * highest } else { 1.0 }),
        marks: Marks::Counts,
    };
    let mut plot = frame::draw(area, &Side::numbers(&x), &y, 0.0)?;
    let mut feet = vec![0.0; bins];
    for series in series {
        let style = dots::rgb(series.colour).filled();
        let mut bars = Vec::new();
        for (bin, foot) in feet.iter_mut().enumerate() {
            let top = *foot + count(series, bin);
            if top > *foot {
                let middle = start + width * (bin as f64 + 0.5);
                let half = 0.5 * FILLED * width;
                bars.push(Rectangle::new(
                    [(middle - half, top), (middle + half, *foot)],
                    style,
                ));
            }
            *foot = top;
        }
        plot.draw_series(bars)?;
    }
    Ok(frame::span(area, &plot))
}
