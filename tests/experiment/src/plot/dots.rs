//! Dots that let their density show.

use std::collections::BTreeSet;

use plotters::{
    element::Circle,
    style::{
        Color, RGBColor,
        text_anchor::{HPos, VPos},
    },
};

use super::{
    Axis, Colour,
    frame::{self, Plot},
    numbers,
    svg::{Area, Drawn, PIXEL, px},
    words,
};

/// A dot's radius, in pixels.
pub(super) const RADIUS: f64 = 1.7;
/// A dot's opacity, from 0 to 1.
const OPACITY: f64 = 0.55;

/// Draws dots of one colour, of those on the same pixel the first only.
pub(super) fn draw(
    plot: &mut Plot<'_, '_>,
    dots: impl IntoIterator<Item = (f64, f64)>,
    colour: Colour,
) -> Drawn {
    let style = rgb(colour).mix(OPACITY).filled();
    let mut taken = BTreeSet::new();
    let first: Vec<_> = dots
        .into_iter()
        .filter(|dot| {
            let (x, y) = plot.plotting_area().map_coordinate(dot);
            taken.insert((x.div_euclid(PIXEL), y.div_euclid(PIXEL)))
        })
        .collect();
    plot.draw_series(first.into_iter().map(|dot| Circle::new(dot, px(RADIUS), style)))?;
    Ok(())
}

/// True if the axis reaches to the value.
pub(super) fn is_on(axis: &Axis, value: f64) -> bool {
    let (low, high) = numbers::ends(axis.min, axis.max);
    (low..=high).contains(&value)
}

/// Says in the upper right corner of the plot how many finite values lie beyond the axes, if any do.
pub(super) fn note_missing(area: &Area<'_>, plot: &Plot<'_, '_>, missing: usize) -> Drawn {
    if missing == 0 {
        return Ok(());
    }
    let (x, y) = (
        plot.plotting_area().get_x_range().end,
        plot.plotting_area().get_y_range().end,
    );
    let (right, top) = frame::place(area, plot, (x, y));
    let text = format!("{} beyond the axes", numbers::spelled(missing as f64, 0));
    let style = words::style(words::SMALL, words::FAINT, HPos::Right, VPos::Top);
    words::write(area, &text, (right - px(3.0), top + px(2.0)), style)
}

/// As plotters has it.
pub(super) fn rgb(colour: Colour) -> RGBColor {
    RGBColor(colour.0, colour.1, colour.2)
}
