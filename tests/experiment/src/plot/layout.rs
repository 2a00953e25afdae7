//! Panels in a grid.

use plotters::style::text_anchor::{HPos, VPos};

use super::{
    Panel, chart, legend,
    svg::{self, Area, Drawn, px},
    words,
};

/// Width of a picture, in pixels.
const WIDTH: f64 = 900.0;
/// Around everything, in pixels.
const MARGIN: f64 = 14.0;
/// Between panels of a row, in pixels.
const GUTTER: f64 = 24.0;
/// Between rows of panels, in pixels.
const BETWEEN_ROWS: f64 = 16.0;
/// Below the figure's title, in pixels.
const BELOW_HEADING: f64 = 7.0;

/// Width of bold text relative to regular text.
const BOLD: f64 = 1.08;
/// Largest number of panels per row: more would be too narrow for their words.
const MAX_COLUMNS: usize = 4;

/// Position and layout of a panel, in pixels.
struct Cell<'a> {
    panel: &'a Panel,
    left: f64,
    top: f64,
    title: Vec<String>,
    title_height: f64,
    chart_height: f64,
}

/// One picture, 900 pixels wide, of panels in a grid of 1 to 4 columns, row by row; other numbers are clamped.
///
/// If all panels have the same legend, they share one at the bottom. The picture is self-contained SVG; the same panels
/// give the same bytes.
pub fn figure(title: &str, panels: &[Panel], columns: usize) -> String {
    let columns = columns.clamp(1, panels.len().clamp(1, MAX_COLUMNS));
    let room = WIDTH - 2.0 * MARGIN;
    let wide = (room - (columns - 1) as f64 * GUTTER) / columns as f64;
    let heading = words::lines(title, words::HEADING, room / BOLD);
    let first = panels
        .first()
        .map(|panel| chart::legend(&panel.chart))
        .unwrap_or_default();
    let shared = panels.len() > 1 && panels.iter().all(|panel| chart::legend(&panel.chart) == first);

    let mut cells = Vec::new();
    let mut top = MARGIN;
    if !heading.is_empty() {
        top += title_height(&heading, words::HEADING) + BELOW_HEADING;
    }
    for row in panels.chunks(columns) {
        let titles: Vec<_> = row
            .iter()
            .map(|panel| words::lines(&panel.title, words::SUBHEADING, wide / BOLD))
            .collect();
        // Titles and charts of a row have equal heights, so that the axes line up.
        let title_heights = titles.iter().map(|title| title_height(title, words::SUBHEADING));
        let title_height = title_heights.fold(0.0, f64::max);
        let chart_height = row
            .iter()
            .map(|panel| chart::height(&panel.chart, wide))
            .fold(0.0, f64::max);
        let legends = row
            .iter()
            .map(|panel| legend::height(&chart::legend(&panel.chart), wide));
        let legend_height = if shared { 0.0 } else { legends.fold(0.0, f64::max) };
        for (column, (panel, title)) in row.iter().zip(titles).enumerate() {
            let left = MARGIN + column as f64 * (wide + GUTTER);
            cells.push(Cell {
                panel,
                left,
                top,
                title,
                title_height,
                chart_height,
            });
        }
        top += title_height + chart_height + legend_height + BETWEEN_ROWS;
    }
    if !panels.is_empty() {
        top -= BETWEEN_ROWS;
    }
    let shared_height = if shared { legend::height(&first, room) } else { 0.0 };
    let height = top + shared_height + MARGIN;

    let draw = |area: &Area<'_>| {
        let middle = (px(WIDTH / 2.0), px(MARGIN));
        let style = words::bold(words::HEADING, HPos::Center, VPos::Top);
        words::write_lines(area, &heading, middle, words::HEADING, &style)?;
        for cell in &cells {
            draw_cell(area, cell, wide, shared)?;
        }
        if shared {
            legend::draw(
                &part(area, (MARGIN, top), (room, shared_height)),
                &first,
                room / 2.0,
            )?;
        }
        Ok(())
    };
    svg::picture((WIDTH as u32, height.ceil() as u32), draw).expect("a string takes all that is drawn")
}

fn title_height(lines: &[String], height: f64) -> f64 {
    lines.len() as f64 * words::LINE * height
}

fn draw_cell(area: &Area<'_>, cell: &Cell<'_>, wide: f64, shared_legend: bool) -> Drawn {
    let below_title = cell.top + cell.title_height;
    let chart_area = part(area, (cell.left, below_title), (wide, cell.chart_height));
    let (left, right) = chart::draw(&chart_area, &cell.panel.chart)?;
    let middle = left.midpoint(right);

    // A title with fewer lines than its neighbour's is aligned to the bottom, and centred on the plot as far as it
    // stays inside the panel.
    let unused = cell.title_height - title_height(&cell.title, words::SUBHEADING);
    let long = cell
        .title
        .iter()
        .map(|line| BOLD * words::width(line, words::SUBHEADING))
        .fold(0.0, f64::max);
    let centre = middle.min(wide - long / 2.0).max(long / 2.0);
    let style = words::bold(words::SUBHEADING, HPos::Center, VPos::Top);
    let at = (px(cell.left + centre), px(cell.top + unused));
    words::write_lines(area, &cell.title, at, words::SUBHEADING, &style)?;
    if !shared_legend {
        let entries = chart::legend(&cell.panel.chart);
        let at = (cell.left, below_title + cell.chart_height);
        legend::draw(
            &part(area, at, (wide, legend::height(&entries, wide))),
            &entries,
            middle,
        )?;
    }
    Ok(())
}

fn part<'a>(area: &Area<'a>, (left, top): (f64, f64), (width, height): (f64, f64)) -> Area<'a> {
    area.clone().shrink((px(left), px(top)), (px(width), px(height)))
}
