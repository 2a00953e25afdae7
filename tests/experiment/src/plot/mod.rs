//! Charts as SVG: [`figure`] lays panels out in a grid and returns one self-contained picture.
//!
//! Each kind of chart has its own file; all share the frame with its ticks, the legend, text sizes and number formats.
//! The same data gives the same bytes.

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
    /// Name in the legend.
    pub name: String,
    /// Colour of its dots or bars.
    pub colour: Colour,
    /// Its values.
    pub values: Vec<T>,
}

/// An axis. Dots beyond its ends are left out and counted in a note above the chart.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Label, with the unit.
    pub label: String,
    /// Its lower end. Equal ends are widened, swapped ends reversed.
    pub min: f64,
    /// Its upper end.
    pub max: f64,
}

/// One chart. Values that are not finite are left out.
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
    /// Values of each series as dots in their own strip, spread across it to show their density, with the number of
    /// values at the strip's end.
    Strips {
        /// Along the bottom.
        x: Axis,
        /// One strip per series, from the top.
        series: Vec<Series<f64>>,
    },
    /// Counts in bins of equal width, with stacked series.
    Histogram {
        /// Label of the binned values, with the unit.
        label: String,
        /// Lower end of the first bin.
        start: f64,
        /// Width of a bin.
        width: f64,
        /// Counts, bin by bin.
        series: Vec<Series<u64>>,
    },
    /// A horizontal bar per row with a part per series. Wide enough parts show their value; rows of different lengths
    /// show their sum at the end.
    StackedBars {
        /// Label of the bars' lengths, with the unit.
        label: String,
        /// The rows' names, from the top.
        rows: Vec<String>,
        /// Parts by row; only those above 0 are drawn.
        series: Vec<Series<f64>>,
    },
    /// Per group, one bar for each series on a logarithmic axis; missing values are NaN.
    GroupedBars {
        /// Label of the bars' heights, with the unit.
        label: String,
        /// The groups' names.
        groups: Vec<String>,
        /// Heights by group, above 0.
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
