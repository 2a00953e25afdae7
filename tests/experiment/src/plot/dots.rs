//! Dots that show their density.

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
pub(super) const RADIUS: f64 = 1.8;
/// Opacities of a series' dots, from 0 to 1, if they are few and if they are many: few hardly overlap and would look
/// pale.
const OPACITIES: (f64, f64) = (0.8, 0.5);
/// Least number of dots that counts as many.
const MANY: usize = 250;

/// Draws dots of one colour, only the first on each pixel.
pub(super) fn draw(
    plot: &mut Plot<'_, '_>,
    dots: impl IntoIterator<Item = (f64, f64)>,
    colour: Colour,
) -> Drawn {
    let mut taken = BTreeSet::new();
    let first: Vec<_> = dots
        .into_iter()
        .filter(|dot| {
            let (x, y) = plot.plotting_area().map_coordinate(dot);
            taken.insert((x.div_euclid(PIXEL), y.div_euclid(PIXEL)))
        })
        .collect();
    let opacity = if first.len() < MANY {
        OPACITIES.0
    } else {
        OPACITIES.1
    };
    let style = rgb(colour).mix(opacity).filled();
    plot.draw_series(first.into_iter().map(|dot| Circle::new(dot, px(RADIUS), style)))?;
    Ok(())
}

/// Whether the axis covers the value.
pub(super) fn is_on(axis: &Axis, value: f64) -> bool {
    let (low, high) = numbers::ends(axis.min, axis.max);
    (low..=high).contains(&value)
}

/// Notes the number of finite values beyond the axes, if any, above the plot's upper right corner.
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
    let style = words::style(words::SMALL, words::FAINT, HPos::Right, VPos::Bottom);
    words::write(area, &text, (right, top), style)
}

/// The colour for plotters.
pub(super) fn rgb(colour: Colour) -> RGBColor {
    RGBColor(colour.0, colour.1, colour.2)
}
