//! Charts as SVG.

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

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it shows, with the unit.
    pub label: String,
    /// Its lower end.
    pub min: f64,
    /// Its upper end.
    pub max: f64,
}

/// One chart.
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
    /// Values of each series as dots in a strip of its own, spread sideways so that their density shows.
    Strips {
        /// Along the side.
        y: Axis,
        /// One strip each.
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
    /// A horizontal bar for each row, made of a part for each series.
    StackedBars {
        /// What the length of a bar means, with the unit.
        label: String,
        /// The rows' names, from the top.
        rows: Vec<String>,
        /// Parts, row by row.
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
