//! The values of each series in their own strip.

use std::collections::BTreeMap;

use plotters::style::text_anchor::{HPos, VPos};

use super::{
    Axis, Series, dots,
    frame::{self, Plot, Side},
    numbers,
    svg::{Area, Drawn, PIXEL, px},
    words,
};

/// Share of a strip's height that dots may fill.
const FILLED: f64 = 0.8;
/// Height of a strip, in pixels.
pub(super) const STRIP: f64 = 27.0;

/// Draws the chart; returns the left and right ends of its plot, in pixels.
pub(super) fn draw(area: &Area<'_>, x: &Axis, series: &[Series<f64>]) -> Drawn<(f64, f64)> {
    let counts: Vec<_> = series
        .iter()
        .map(|series| {
            let count = series.values.iter().filter(|value| value.is_finite()).count();
            format!("n = {}", numbers::spelled(count as f64, 0))
        })
        .collect();
    let widest = counts
        .iter()
        .map(|count| words::width(count, words::SMALL))
        .fold(0.0, f64::max);
    let names = series.iter().map(|series| series.name.clone()).collect();
    let mut plot = frame::draw(area, &Side::numbers(x), &Side::names(names, true), widest + 8.0)?;

    let mut missing = 0;
    for (row, series) in series.iter().enumerate() {
        let finite = series.values.iter().copied().filter(|value| value.is_finite());
        let (seen, unseen): (Vec<_>, Vec<_>) = finite.partition(|value| dots::is_on(x, *value));
        missing += unseen.len();
        let middle = plot.plotting_area().get_y_range().end - row as f64 - 0.5;
        let spread = spread(&plot, &seen, middle);
        dots::draw(&mut plot, spread, series.colour)?;
    }
    let right = plot.plotting_area().get_x_range().end;
    for (row, count) in counts.iter().enumerate() {
        let middle = plot.plotting_area().get_y_range().end - row as f64 - 0.5;
        let (x, y) = frame::place(area, &plot, (right, middle));
        let style = words::style(words::SMALL, words::FAINT, HPos::Left, VPos::Center);
        words::write(area, count, (x + px(6.0), y), style)?;
    }
    dots::note_missing(area, &plot, missing)?;
    Ok(frame::span(area, &plot))
}

/// Values with their places across the strip. Values within a dot's width of each other are spread alternately above
/// and below the middle, at a distance at which the densest part fills the strip, so the strip is wider where values
/// are denser.
fn spread(plot: &Plot<'_, '_>, values: &[f64], middle: f64) -> Vec<(f64, f64)> {
    let bin = |value: f64| {
        let (along, _) = plot.plotting_area().map_coordinate(&(value, middle));
        along.div_euclid(px(2.0 * dots::RADIUS))
    };
    let mut counts: BTreeMap<i32, usize> = BTreeMap::new();
    for value in values {
        *counts.entry(bin(*value)).or_default() += 1;
    }
    let densest = counts.values().max().copied().unwrap_or(0);
    let strip = plot.plotting_area().get_y_axis_pixel_range();
    let rows = plot.plotting_area().get_y_range().end;
    let pixels = f64::from((strip.end - strip.start).abs()) / f64::from(PIXEL) / rows;
    // In rows a dot's width apart, or less where the strip is too narrow.
    let apart =
        (2.0 * dots::RADIUS / pixels).min((FILLED - 2.0 * dots::RADIUS / pixels) / densest.max(2) as f64);

    let mut placed: BTreeMap<i32, usize> = BTreeMap::new();
    values
        .iter()
        .map(|value| {
            let rank = placed.entry(bin(*value)).or_default();
            *rank += 1;
            let steps = (*rank / 2) as f64;
            let side = if rank.is_multiple_of(2) { 1.0 } else { -1.0 };
            (*value, middle + side * steps * apart)
        })
        .collect()
}
