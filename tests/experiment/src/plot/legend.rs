//! The legend below a plot: the meaning of its colours.

use plotters::{
    element::Rectangle,
    style::{
        Color,
        text_anchor::{HPos, VPos},
    },
};

use super::{
    Colour, dots,
    frame::size,
    svg::{Area, Drawn, px},
    words,
};

/// A colour's meaning.
pub(super) type Entry<'a> = (&'a str, Colour);

/// Side of a colour's square, in pixels.
const SQUARE: f64 = 10.0;
/// Between a square and its text, in pixels.
const GAP: f64 = 5.0;
/// Between two entries, in pixels.
const BETWEEN: f64 = 16.0;
/// From one line to the next, in pixels.
const PITCH: f64 = 18.0;
/// Above the first line, in pixels.
const ABOVE: f64 = 6.0;

/// Its height at a width, in pixels.
pub(super) fn height(entries: &[Entry<'_>], room: f64) -> f64 {
    if entries.is_empty() {
        0.0
    } else {
        ABOVE + lines(entries, room).len() as f64 * PITCH
    }
}

/// Draws it at the top of the area, each line centred on `centre` (pixels).
pub(super) fn draw(area: &Area<'_>, entries: &[Entry<'_>], centre: f64) -> Drawn {
    let (room, _) = size(area);
    for (line, entries) in lines(entries, room).into_iter().enumerate() {
        let long = length(entries, room);
        let mut left = (centre - long / 2.0).clamp(0.0, (room - long).max(0.0));
        let middle = ABOVE + (line as f64 + 0.5) * PITCH;
        for (name, colour) in entries {
            let corners = [
                (px(left), px(middle - SQUARE / 2.0)),
                (px(left + SQUARE), px(middle + SQUARE / 2.0)),
            ];
            area.draw(&Rectangle::new(corners, dots::rgb(*colour).filled()))?;
            let style = words::style(words::BODY, words::INK, HPos::Left, VPos::Center);
            words::write(
                area,
                &fitted(name, room),
                (px(left + SQUARE + GAP), px(middle)),
                style,
            )?;
            left += wide(name, room) + BETWEEN;
        }
    }
    Ok(())
}

/// The entries in as few lines as fit, of about the same length.
fn lines<'e, 'n>(entries: &'e [Entry<'n>], room: f64) -> Vec<&'e [Entry<'n>]> {
    let fewest = filled(entries, room, room).len();
    // The shortest line length that needs no more lines; a line is as long as some run of entries.
    let mut lengths: Vec<f64> = (0..entries.len())
        .flat_map(|first| (first + 1..=entries.len()).map(move |end| length(&entries[first..end], room)))
        .filter(|length| *length <= room)
        .collect();
    lengths.sort_by(f64::total_cmp);
    let even = lengths
        .into_iter()
        .map(|longest| filled(entries, longest, room))
        .find(|lines| lines.len() == fewest);
    even.unwrap_or_else(|| filled(entries, room, room))
}

/// The entries in lines of up to `longest` pixels, but at least one entry each.
fn filled<'e, 'n>(entries: &'e [Entry<'n>], longest: f64, room: f64) -> Vec<&'e [Entry<'n>]> {
    let mut lines = Vec::new();
    let mut rest = entries;
    while !rest.is_empty() {
        let fitting = (1..=rest.len())
            .take_while(|count| length(&rest[..*count], room) <= longest)
            .count();
        let (line, tail) = rest.split_at(fitting.max(1));
        lines.push(line);
        rest = tail;
    }
    lines
}

fn length(entries: &[Entry<'_>], room: f64) -> f64 {
    let names: f64 = entries.iter().map(|(name, _)| wide(name, room)).sum();
    names + entries.len().saturating_sub(1) as f64 * BETWEEN
}

fn wide(name: &str, room: f64) -> f64 {
    SQUARE + GAP + words::width(&fitted(name, room), words::BODY)
}

fn fitted(name: &str, room: f64) -> String {
    words::shortened(name, words::BODY, room - SQUARE - GAP)
}
