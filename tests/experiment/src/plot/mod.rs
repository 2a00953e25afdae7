//! Charts as SVG: [`figure`] lays panels out in a grid and returns one picture that stands by itself.
//!
//! The data says what is shown. Each kind of chart has a file that draws it, and all share the frame with its ticks, the
//! legend, the sizes of words and the spelling of numbers. The same data gives the same bytes.

mod chart;
mod dots;
mod frame;
mod grouped_bars;
mod histogram;
mod layout;
mod legend;
mod numbers;
pub mod palette;
mod scale;
mod scatter;
mod stacked_bars;
mod strips;
mod svg;
mod words;

pub use layout::figure;

/// A colour: red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

/// Dots or counts of one kind.
#[derive(Clone, Debug)]
pub struct Series<T> {
    /// What the legend says.
    pub name: String,
    /// Of its dots or bars.
    pub colour: Colour,
    /// Its values.
    pub values: Vec<T>,
}

/// An axis. Dots beyond its ends are left out, and a note above the chart's corner says how many.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// Its lower end. An axis whose ends are the same is widened, one whose ends are swapped is turned round.
    pub min: f64,
    /// Its upper end.
    pub max: f64,
}

/// One chart. Values that are not finite are left out, and so is whatever they would have drawn.
#[derive(Clone, Debug)]
pub enum Chart {
    /// Dots; series that come later lie on top.
    Scatter {
        /// Along the bottom.
        x: Axis,
        /// Along the side.
        y: Axis,
        /// Dots as (x, y).
        series: Vec<Series<(f64, f64)>>,
    },
    /// Values of each series as dots in a strip of its own, the strips below each other, the dots spread across their
    /// strip so that their density shows. The number of values stands at the end of each strip.
    Strips {
        /// Along the bottom.
        x: Axis,
        /// One strip each, from the top.
        series: Vec<Series<f64>>,
    },
    /// Counts in bins of one width, the series on top of each other.
    Histogram {
        /// What is binned, with the unit.
        label: String,
        /// Lower end of the first bin.
        start: f64,
        /// Width of a bin.
        width: f64,
        /// Counts, bin by bin.
        series: Vec<Series<u64>>,
    },
    /// A horizontal bar for each row, made of a part for each series. A part that is wide enough bears its value; rows
    /// that differ in length bear their sum at the end.
    StackedBars {
        /// What the length of a bar means, with the unit.
        label: String,
        /// The rows' names, from the top.
        rows: Vec<String>,
        /// Parts, row by row; those that are not more than 0 are left out.
        series: Vec<Series<f64>>,
    },
    /// For each group a bar beside the other for each series, on a logarithmic axis; a value that is missing is NaN.
    GroupedBars {
        /// What the height of a bar means, with the unit.
        label: String,
        /// The groups' names.
        groups: Vec<String>,
        /// Heights, group by group; more than 0.
        series: Vec<Series<f64>>,
    },
}

/// A chart with a title above it.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Above the chart.
    pub title: String,
    /// The chart.
    pub chart: Chart,
}
