//! Dots over two axes.

use super::{
    Axis, Series, dots,
    frame::{self, Side},
    svg::{Area, Drawn},
};

/// Draws the chart; returns the left and right ends of its plot, in pixels.
pub(super) fn draw(area: &Area<'_>, x: &Axis, y: &Axis, series: &[Series<(f64, f64)>]) -> Drawn<(f64, f64)> {
    let mut plot = frame::draw(area, &Side::numbers(x), &Side::numbers(y), 0.0)?;
    let mut missing = 0;
    for series in series {
        let finite = series
            .values
            .iter()
            .copied()
            .filter(|dot| dot.0.is_finite() && dot.1.is_finite());
        let (seen, unseen): (Vec<_>, Vec<_>) =
            finite.partition(|dot| dots::is_on(x, dot.0) && dots::is_on(y, dot.1));
        missing += unseen.len();
        dots::draw(&mut plot, seen, series.colour)?;
    }
    dots::note_missing(area, &plot, missing)?;
    Ok(frame::span(area, &plot))
}
