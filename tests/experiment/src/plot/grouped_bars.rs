//! Groups of bars on a logarithmic axis.

use plotters::{
    element::Rectangle,
    style::{
        Color, FontTransform, TextStyle,
        text_anchor::{HPos, VPos},
    },
};

use super::{
    Series, dots,
    frame::{self, Marks, Side},
    numbers,
    svg::{Area, Drawn, px},
    words,
};

/// Share of a group's width that its bars fill.
const FILLED: f64 = 0.82;
/// Free space between a bar and its value, in pixels.
const PADDING: f64 = 3.0;
/// The axis starts at a power of ten at least this many decades below the lowest bar's top.
const LEAST: f64 = 0.15;
/// Approximate width of the side axis, in pixels: enough for 1,000,000 and a label.
const SIDE: f64 = 90.0;

/// How values are written over their bars.
#[derive(Clone, Copy, PartialEq)]
enum Values {
    Level,
    Upright,
    None,
}

/// Draws the chart; returns the left and right ends of its plot, in pixels.
pub(super) fn draw(
    area: &Area<'_>,
    label: &str,
    groups: &[String],
    series: &[Series<f64>],
) -> Drawn<(f64, f64)> {
    let (width, height) = frame::size(area);
    let slot = (width - SIDE) / groups.len().max(1) as f64;
    let bar = slot * FILLED / series.len().max(1) as f64;
    let tops = || {
        series
            .iter()
            .flat_map(|series| series.values.iter().take(groups.len()))
            .copied()
            .filter_map(exponent)
    };
    let widest = tops()
        .map(|top| words::width(&numbers::significant(10_f64.powf(top)), words::SMALL))
        .fold(0.0, f64::max);
    let values = if widest + 2.0 <= bar {
        Values::Level
    } else if words::SMALL <= bar {
        Values::Upright
    } else {
        Values::None
    };

    let (names, name_height) = names(groups, slot - 4.0);
    let rows = names.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let room = (rows as f64 - 1.0) * words::LINE * name_height + words::BODY;
    let x = Side {
        label: String::new(),
        ends: (0.0, groups.len().max(1) as f64),
        marks: Marks::Own(room),
    };
    let head = match values {
        Values::Level => words::SMALL + 2.0 * PADDING,
        Values::Upright => widest + 2.0 * PADDING,
        Values::None => 0.0,
    };
    let ends = decades(tops(), head / frame::plot_height(height, &x));
    let y = Side {
        label: label.to_owned(),
        ends,
        marks: Marks::Decades,
    };
    let mut plot = frame::draw(area, &x, &y, 0.0)?;

    let broad = FILLED / series.len().max(1) as f64;
    let mut written = Vec::new();
    for (place, series) in series.iter().enumerate() {
        let style = dots::rgb(series.colour).filled();
        let mut bars = Vec::new();
        for (group, value) in series.values.iter().take(groups.len()).enumerate() {
            let Some(top) = exponent(*value) else { continue };
            let left = group as f64 + (1.0 - FILLED) / 2.0 + place as f64 * broad;
            bars.push(Rectangle::new([(left, top), (left + broad, ends.0)], style));
            written.push(((left + broad / 2.0, top), numbers::significant(*value)));
        }
        plot.draw_series(bars)?;
    }
    for (top, text) in written {
        let (x, y) = frame::place(area, &plot, top);
        match values {
            Values::Level => words::write(
                area,
                &text,
                (x, y - px(PADDING)),
                value_style(HPos::Center, VPos::Bottom),
            )?,
            Values::Upright => {
                let style = value_style(HPos::Left, VPos::Center).transform(FontTransform::Rotate270);
                words::write(area, &text, (x, y - px(PADDING)), style)?;
            }
            Values::None => {}
        }
    }
    let style = words::style(name_height, words::INK, HPos::Center, VPos::Top);
    for (group, lines) in names.iter().enumerate() {
        let (x, y) = frame::place(area, &plot, (group as f64 + 0.5, ends.0));
        words::write_lines(area, lines, (x, y + px(6.0)), name_height, &style)?;
    }
    Ok(frame::span(area, &plot))
}

/// The groups' names in lines no wider than `room` pixels, and the height of their text, reduced where a word would
/// otherwise be cut.
fn names(groups: &[String], room: f64) -> (Vec<Vec<String>>, f64) {
    let words = groups.iter().flat_map(|name| name.split_whitespace());
    let height = words
        .map(|word| words::height_that_fits(word, words::BODY, room))
        .fold(words::BODY, f64::min);
    let height = height.max(words::SMALL);
    (
        groups
            .iter()
            .map(|name| words::lines(name, height, room))
            .collect(),
        height,
    )
}

fn value_style(across: HPos, upright: VPos) -> TextStyle<'static> {
    words::style(words::SMALL, words::INK, across, upright)
}

/// The logarithm of a bar's height, if there is a bar.
fn exponent(value: f64) -> Option<f64> {
    (value.is_finite() && value > 0.0).then(|| value.log10())
}

/// The axis' ends as powers of ten, with the share `head` at the top free of bars.
fn decades(tops: impl Iterator<Item = f64>, head: f64) -> (f64, f64) {
    let (low, high) = tops.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), top| {
        (low.min(top), high.max(top))
    });
    if low > high {
        return (0.0, 1.0);
    }
    let low = (low - LEAST).floor();
    (low, low + (high - low).max(1.0) / (1.0 - head.clamp(0.0, 0.8)))
}
