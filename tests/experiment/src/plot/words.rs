//! Text: its sizes, and how it is wrapped, shortened and drawn.
//!
//! Without fonts, widths are estimates: those of Helvetica, which Arial, Liberation Sans and most viewers' defaults
//! resemble.

use plotters::{
    element::Text,
    style::{
        Color, FontFamily, FontStyle, RGBColor, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};

use super::svg::{Area, Drawn, PIXEL, px};

/// Height of the figure's title, in pixels.
pub(super) const HEADING: f64 = 16.0;
/// Height of panels' titles, in pixels.
pub(super) const SUBHEADING: f64 = 13.0;
/// Height of axes' and legends' text, in pixels.
pub(super) const BODY: f64 = 12.0;
/// Height of values on bars, in pixels.
pub(super) const SMALL: f64 = 10.0;
/// Distance between baselines, in text heights.
pub(super) const LINE: f64 = 1.3;

/// The text's colour.
pub(super) const INK: RGBColor = RGBColor(40, 40, 40);
/// The colour of remarks.
pub(super) const FAINT: RGBColor = RGBColor(110, 110, 110);

/// Plotters' SVG divides font sizes by this.
const PLOTTERS_FONT_SCALE: f64 = 1.24;
/// Factor on estimated widths for fonts that are wider than Helvetica.
const SAFETY: f64 = 1.06;

/// The estimated width of text of this height, in pixels.
pub(super) fn width(text: &str, height: f64) -> f64 {
    let ems: f64 = text
        .chars()
        .map(|letter| match letter {
            'i' | 'j' | 'l' | '\'' | '|' => 0.22,
            'f' | 't' | 'I' | ' ' | '.' | ',' | ':' | ';' | '!' | '/' => 0.28,
            '(' | ')' | '[' | ']' | '-' | 'r' | '°' | '"' => 0.34,
            'c' | 'k' | 's' | 'v' | 'x' | 'y' | 'z' | 'J' => 0.5,
            'm' | 'M' | 'w' => 0.83,
            '%' | '@' | 'W' | '—' | '…' => 1.0,
            'A'..='Z' => 0.7,
            // Letters, digits, and narrow characters beyond ASCII.
            ' '..='\u{1fff}' | '\u{2000}'..='\u{2bff}' => 0.56,
            _ => 1.0,
        })
        .sum();
    ems * height * SAFETY
}

/// The text in lines no wider than `room` pixels, broken at spaces; wider words are shortened.
pub(super) fn lines(text: &str, height: f64, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(line, height) + width(" ", height) + width(word, height) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(shortened(word, height, room)),
        }
    }
    lines
}

/// The text, cut to fit into `room` pixels with an ellipsis if it is wider.
pub(super) fn shortened(text: &str, height: f64, room: f64) -> String {
    if width(text, height) <= room {
        return text.to_owned();
    }
    let mut kept = text.to_owned();
    while kept.pop().is_some() && width(&kept, height) + width("…", height) > room {}
    kept + "…"
}

/// The largest height up to `height` at which the text is no wider than `room`, all in pixels.
pub(super) fn height_that_fits(text: &str, height: f64, room: f64) -> f64 {
    let wide = width(text, height);
    if wide > room {
        height * room.max(0.0) / wide
    } else {
        height
    }
}

/// Style of text with a height in pixels and an anchor.
pub(super) fn style(height: f64, colour: RGBColor, across: HPos, upright: VPos) -> TextStyle<'static> {
    let size = height * f64::from(PIXEL) * PLOTTERS_FONT_SCALE;
    let mut style =
        TextStyle::from((FontFamily::SansSerif, size, FontStyle::Normal)).pos(Pos::new(across, upright));
    style.color = colour.to_backend_color();
    style
}

/// [`style`] in bold.
pub(super) fn bold(height: f64, across: HPos, upright: VPos) -> TextStyle<'static> {
    let mut style = style(height, INK, across, upright);
    style.font = style.font.style(FontStyle::Bold);
    style
}

/// Draws text at a place in the area, in tenths of a pixel.
pub(super) fn write(area: &Area<'_>, text: &str, at: (i32, i32), style: TextStyle<'static>) -> Drawn {
    area.draw(&Text::new(drawable(text), at, style))
}

/// Draws lines below each other, centred on `x`, the first one's top at `y` (tenths of a pixel).
pub(super) fn write_lines(
    area: &Area<'_>,
    lines: &[String],
    (x, y): (i32, i32),
    height: f64,
    style: &TextStyle<'static>,
) -> Drawn {
    for (index, line) in lines.iter().enumerate() {
        write(
            area,
            line,
            (x, y + px(index as f64 * LINE * height)),
            style.clone(),
        )?;
    }
    Ok(())
}

/// The text with spaces for characters that XML forbids.
pub(super) fn drawable(text: &str) -> String {
    text.chars()
        .map(|letter| {
            let is_forbidden = letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}');
            if is_forbidden { ' ' } else { letter }
        })
        .collect()
}
