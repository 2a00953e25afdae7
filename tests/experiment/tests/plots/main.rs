//! The charts as a reader sees them: where dots and bars lie, what the words say.

mod bars;
mod dots;
mod figures;
mod palettes;
mod picture;
mod soundness;

use grasp_experiment::plot::{Axis, Chart, Colour, Panel, Series, figure};
use picture::Picture;

fn axis(label: &str, min: f64, max: f64) -> Axis {
    Axis {
        label: label.to_owned(),
        min,
        max,
    }
}

fn series<T>(name: &str, colour: Colour, values: Vec<T>) -> Series<T> {
    Series {
        name: name.to_owned(),
        colour,
        values,
    }
}

fn strings(texts: &[&str]) -> Vec<String> {
    texts.iter().map(ToString::to_string).collect()
}

fn panel(title: &str, chart: Chart) -> Panel {
    Panel {
        title: title.to_owned(),
        chart,
    }
}

/// A picture of one chart without titles.
fn picture_of(chart: Chart) -> Picture {
    Picture::read(&figure("", &[panel("", chart)], 1))
}

/// Fractions from 0 to 1 in no order: the fractional parts of the golden ratio's multiples and of others.
fn scattered(count: usize, seed: f64) -> Vec<f64> {
    (1..=count)
        .map(|index| (index as f64 * 0.618_033_988_75 * seed).fract())
        .collect()
}

const RED: Colour = Colour(200, 0, 0);
const GREEN: Colour = Colour(0, 200, 0);
const BLUE: Colour = Colour(0, 0, 200);

/// What rounding to the picture's units may move a dot or an edge by.
const ROUNDING: f64 = 1.5;

/// The line through two points, as a function.
fn line((x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> impl Fn(f64) -> f64 {
    move |x| y0 + (x - x0) * (y1 - y0) / (x1 - x0)
}

fn assert_near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= ROUNDING,
        "{found} instead of {expected}"
    );
}
