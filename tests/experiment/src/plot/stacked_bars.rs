//! Stacked horizontal bars.

use plotters::{
    element::Rectangle,
    style::{
        Color, WHITE,
        text_anchor::{HPos, VPos},
    },
};

use super::{
    Axis, Colour, Series, dots,
    frame::{self, Plot, Side},
    numbers,
    svg::{Area, Drawn, px},
    words,
};

/// Share of a row's height that its bar fills.
const FILLED: f64 = 0.72;
/// Height of a row, in pixels.
pub(super) const ROW: f64 = 30.0;
/// Free space around a value inside its part, in pixels.
const PADDING: f64 = 3.0;
/// Darker parts (relative luminance, WCAG 2) get white text. Black and white have equal contrast at 0.18 by that
/// formula, but saturated greens and reds just above it are easier to read with white.
const DARK: f64 = 0.275;

/// Draws the chart; returns the left and right ends of its plot, in pixels.
pub(super) fn draw(
    area: &Area<'_>,
    label: &str,
    rows: &[String],
    series: &[Series<f64>],
) -> Drawn<(f64, f64)> {
    let sums: Vec<f64> = (0..rows.len())
        .map(|row| series.iter().map(|series| part(series, row)).sum())
        .collect();
    let longest = sums.iter().copied().fold(0.0, f64::max);
    let longest = if longest > 0.0 { longest } else { 1.0 };
    // Equal sums carry no information, and with a single series the parts are the sums.
    let differ = sums.iter().any(|sum| (sum - longest).abs() > 1e-9 * longest);
    let decimals = numbers::common_decimals(
        series
            .iter()
            .flat_map(|series| (0..rows.len()).map(|row| part(series, row))),
        longest,
    );
    let ends: Vec<_> = sums
        .iter()
        .map(|sum| {
            if differ || series.len() == 1 {
                numbers::spelled(*sum, decimals)
            } else {
                String::new()
            }
        })
        .collect();

    let x = Axis {
        label: label.to_owned(),
        min: 0.0,
        max: longest,
    };
    let room = ends
        .iter()
        .map(|end| words::width(end, words::SMALL))
        .fold(0.0, f64::max)
        + 6.0;
    let mut plot = frame::draw(area, &Side::numbers(&x), &Side::names(rows.to_vec(), false), room)?;
    let mut from = vec![0.0; rows.len()];
    let mut values = Vec::new();
    for series in series {
        let style = dots::rgb(series.colour).filled();
        let mut bars = Vec::new();
        for (row, from) in from.iter_mut().enumerate() {
            let value = part(series, row);
            if value > 0.0 {
                let middle = middle(&plot, row);
                let corners = [
                    (*from, middle + FILLED / 2.0),
                    (*from + value, middle - FILLED / 2.0),
                ];
                bars.push(Rectangle::new(corners, style));
                values.push((row, *from, value, series.colour));
                *from += value;
            }
        }
        plot.draw_series(bars)?;
    }
    if series.len() > 1 {
        for (row, from, value, colour) in values {
            write_inside(
                area,
                &plot,
                row,
                (from, value),
                (&numbers::spelled(value, decimals), colour),
            )?;
        }
    }
    for (row, end) in ends.iter().enumerate() {
        let (x, y) = frame::place(area, &plot, (sums[row], middle(&plot, row)));
        let style = words::style(words::SMALL, words::INK, HPos::Left, VPos::Center);
        words::write(area, end, (x + px(4.0), y), style)?;
    }
    Ok(frame::span(area, &plot))
}

/// The value inside its part, if that is wide enough.
fn write_inside(
    area: &Area<'_>,
    plot: &Plot<'_, '_>,
    row: usize,
    (from, value): (f64, f64),
    (text, colour): (&str, Colour),
) -> Drawn {
    let (left, y) = frame::place(area, plot, (from, middle(plot, row)));
    let (right, _) = frame::place(area, plot, (from + value, 0.0));
    if px(words::width(text, words::SMALL) + 2.0 * PADDING) > right - left {
        return Ok(());
    }
    let ink = if luminance(colour) < DARK {
        WHITE
    } else {
        words::INK
    };
    let style = words::style(words::SMALL, ink, HPos::Center, VPos::Center);
    words::write(area, text, (left.midpoint(right), y), style)
}

fn part(series: &Series<f64>, row: usize) -> f64 {
    series
        .values
        .get(row)
        .copied()
        .filter(|value| numbers::is_drawable(*value) && *value > 0.0)
        .unwrap_or(0.0)
}

fn middle(plot: &Plot<'_, '_>, row: usize) -> f64 {
    plot.plotting_area().get_y_range().end - row as f64 - 0.5
}

/// Relative luminance from 0 to 1 (WCAG 2, with a gamma of 2.2 for sRGB's curve).
fn luminance(colour: Colour) -> f64 {
    let linear = |channel: u8| (f64::from(channel) / 255.0).powf(2.2);
    0.2126 * linear(colour.0) + 0.7152 * linear(colour.1) + 0.0722 * linear(colour.2)
}
