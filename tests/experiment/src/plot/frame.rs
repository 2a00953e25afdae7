//! The frame that all charts share: axes, ticks, grid, labels.

use plotters::{
    backend::SVGBackend,
    chart::{ChartBuilder, ChartContext, LabelAreaPosition},
    coord::cartesian::Cartesian2d,
    style::{
        Color, RGBColor, ShapeStyle,
        text_anchor::{HPos, VPos},
    },
};

use super::{
    Axis,
    numbers::{self, Tick},
    scale::Scale,
    svg::{Area, Drawn, PIXEL, px},
    words,
};

/// A chart to draw in, in the axes' units.
pub(super) type Plot<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Scale, Scale>>;

/// Length of a tick, in pixels; its text is twice as far from the axis.
const TICK: f64 = 4.0;
/// Width of axes and grid lines, in units of the drawing (tenths of a pixel).
const HAIRLINE: u32 = 10;
/// The axes' colour.
const AXIS: RGBColor = RGBColor(90, 90, 90);
/// The grid's colour.
const GRID: RGBColor = RGBColor(226, 226, 226);
/// Space above the plot for a note and for the upper half of the last tick's text, in pixels.
const TOP: f64 = 13.0;
/// Least space between the texts of two ticks along the bottom, in pixels.
const TICK_GAP: f64 = 14.0;
/// Largest number of ticks along the bottom, however wide it is.
const MAX_TICKS: f64 = 14.0;
/// Least distance between two ticks along the side, in pixels.
const TICK_PITCH: f64 = 28.0;
/// Long axis labels shrink to this height, in pixels, before they are shortened.
const MIN_LABEL_HEIGHT: f64 = 9.5;
/// Largest share of a chart's width for names of rows.
const NAMES_SHARE: f64 = 0.4;

/// Texts of an axis' ticks.
pub(super) enum Marks {
    /// Numbers.
    Numbers,
    /// Whole numbers.
    Counts,
    /// Powers of ten, with the axis' units as exponents.
    Decades,
    /// Names, each in the middle of a unit, from the axis' upper end down; with or without grid lines.
    Names(Vec<String>, bool),
    /// None: the chart writes below the axis itself, in this many pixels.
    Own(f64),
}

/// An axis of the frame.
pub(super) struct Side {
    /// Outside the ticks' texts; may be empty.
    pub label: String,
    /// Its ends, finite and distinct.
    pub ends: (f64, f64),
    /// Its ticks.
    pub marks: Marks,
}

impl Side {
    /// A numeric axis.
    pub(super) fn numbers(axis: &Axis) -> Self {
        Self {
            label: axis.label.clone(),
            ends: numbers::ends(axis.min, axis.max),
            marks: Marks::Numbers,
        }
    }

    /// An axis of row names from the top, with or without grid lines.
    pub(super) fn names(names: Vec<String>, grid: bool) -> Self {
        Self {
            label: String::new(),
            ends: (0.0, names.len().max(1) as f64),
            marks: Marks::Names(names, grid),
        }
    }

    fn label_height(&self) -> f64 {
        if self.label.is_empty() {
            0.0
        } else {
            1.6 * words::BODY
        }
    }

    fn has_grid(&self) -> bool {
        !matches!(self.marks, Marks::Names(_, false) | Marks::Own(_))
    }
}

/// The width and height of an area, in pixels.
pub(super) fn size(area: &Area<'_>) -> (f64, f64) {
    let (width, height) = area.dim_in_pixel();
    (
        f64::from(width) / f64::from(PIXEL),
        f64::from(height) / f64::from(PIXEL),
    )
}

/// Height of the bottom axis below the plot, in pixels.
pub(super) fn bottom(x: &Side) -> f64 {
    let texts = if let Marks::Own(room) = x.marks {
        room
    } else {
        words::BODY
    };
    2.0 * TICK + texts + x.label_height() + 2.0
}

/// The height of the plot that [`draw`] makes in an area of this height, in pixels.
pub(super) fn plot_height(height: f64, x: &Side) -> f64 {
    (height - TOP - bottom(x)).max(1.0)
}

/// Draws axes, ticks and grid, and returns the plot between them, with `right` free pixels to its right.
pub(super) fn draw<'a, 'b>(area: &'a Area<'b>, x: &Side, y: &Side, right: f64) -> Drawn<Plot<'a, 'b>> {
    let (width, height) = size(area);
    let high = plot_height(height, x);
    let y_ticks = side_ticks(y, high, width);
    let widest = y_ticks
        .iter()
        .map(|tick| words::width(&tick.text, words::BODY))
        .fold(0.0, f64::max);
    let left = widest + 2.0 * TICK + 2.0 + y.label_height();
    let x_ticks = bottom_ticks(x, width - left - right);
    // Half of the last tick's text may extend to the right.
    let half = x_ticks
        .last()
        .map_or(0.0, |tick| words::width(&tick.text, words::BODY) / 2.0);
    let right = right.max(half + 1.0);

    let mut plot = ChartBuilder::on(area)
        .margin_top(px(TOP))
        .margin_right(px(right))
        .set_label_area_size(LabelAreaPosition::Left, px(left))
        .set_label_area_size(LabelAreaPosition::Bottom, px(bottom(x)))
        .build_cartesian_2d(Scale::new(x.ends, x_ticks), Scale::new(y.ends, y_ticks))?;
    let wide = width - left - right;
    let label_height = words::height_that_fits(&x.label, words::BODY, wide)
        .min(words::height_that_fits(&y.label, words::BODY, high))
        .max(MIN_LABEL_HEIGHT);
    let label = |text: &str, room: f64| words::drawable(&words::shortened(text, label_height, room));
    let mut mesh = plot.configure_mesh();
    mesh.bold_line_style(ShapeStyle::from(&GRID).stroke_width(HAIRLINE))
        .light_line_style(GRID.mix(0.0))
        .axis_style(ShapeStyle::from(&AXIS).stroke_width(HAIRLINE))
        .label_style(words::style(words::BODY, words::INK, HPos::Center, VPos::Center))
        .axis_desc_style(words::style(label_height, words::INK, HPos::Center, VPos::Center))
        .set_all_tick_mark_size(px(TICK))
        .x_desc(label(&x.label, wide))
        .y_desc(label(&y.label, high));
    if !x.has_grid() {
        mesh.disable_x_mesh();
    }
    if !y.has_grid() {
        mesh.disable_y_mesh();
    }
    mesh.draw()?;
    Ok(plot)
}

/// Left and right ends of the plot in its area, in pixels.
pub(super) fn span(area: &Area<'_>, plot: &Plot<'_, '_>) -> (f64, f64) {
    let across = plot.plotting_area().get_x_axis_pixel_range();
    let left = area.get_base_pixel().0;
    (
        f64::from(across.start - left) / f64::from(PIXEL),
        f64::from(across.end - left) / f64::from(PIXEL),
    )
}

/// Position of a point of the plot in its area, in tenths of a pixel.
pub(super) fn place(area: &Area<'_>, plot: &Plot<'_, '_>, point: (f64, f64)) -> (i32, i32) {
    let (x, y) = plot.plotting_area().map_coordinate(&point);
    let (left, top) = area.get_base_pixel();
    (x - left, y - top)
}

fn bottom_ticks(x: &Side, wide: f64) -> Vec<Tick> {
    let (low, high) = x.ends;
    let fits = |ticks: &[Tick], step: f64| {
        let widest = ticks
            .iter()
            .map(|tick| words::width(&tick.text, words::BODY))
            .fold(0.0, f64::max);
        step / (high - low) * wide >= (widest + TICK_GAP).max(wide / MAX_TICKS)
    };
    match &x.marks {
        Marks::Numbers => numbers::ticks(low, high, fits),
        Marks::Counts => numbers::ticks(low, high, |ticks, step| step >= 1.0 && fits(ticks, step)),
        Marks::Decades => numbers::decades(low, high, (wide / 80.0) as usize),
        Marks::Names(..) | Marks::Own(_) => Vec::new(),
    }
}

fn side_ticks(y: &Side, high: f64, width: f64) -> Vec<Tick> {
    let (bottom, top) = y.ends;
    let fits = |step: f64| step / (top - bottom) * high >= TICK_PITCH;
    match &y.marks {
        Marks::Numbers => numbers::ticks(bottom, top, |_, step| fits(step)),
        Marks::Counts => numbers::ticks(bottom, top, |_, step| step >= 1.0 && fits(step)),
        Marks::Decades => numbers::decades(bottom, top, (high / 20.0) as usize),
        Marks::Names(names, _) => names
            .iter()
            .enumerate()
            .map(|(row, name)| Tick {
                at: top - row as f64 - 0.5,
                text: words::shortened(name, words::BODY, NAMES_SHARE * width),
            })
            .collect(),
        Marks::Own(_) => Vec::new(),
    }
}
