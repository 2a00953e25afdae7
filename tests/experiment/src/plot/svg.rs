//! The picture: plotters' SVG backend, in tenths of a pixel, with compacted output.
//!
//! Plotters only supports whole units. Drawing in tenths of a pixel, shown at a tenth of the size, places dots exactly
//! and allows thin lines. Plotters repeats each element's colours; [`compact`] writes them once for consecutive
//! elements that share them.

use std::{fmt::Write, io};

use plotters::{
    backend::SVGBackend,
    coord::Shift,
    drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea},
    style::WHITE,
};

/// A part of the picture; its coordinates are tenths of a pixel from its upper left corner.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Result of drawing.
pub(super) type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<io::Error>>;

/// Units of the drawing in a pixel.
pub(super) const PIXEL: i32 = 10;

/// Typefaces by preference; estimated widths are Helvetica's.
const TYPEFACES: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

/// Attributes of an element's geometry; the others are its looks.
const GEOMETRY: [&str; 13] = [
    "cx", "cy", "dy", "height", "points", "r", "width", "x", "x1", "x2", "y", "y1", "y2",
];

/// Pixels in units of the drawing.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(PIXEL)).round() as i32
}

/// A white picture of a size in pixels, drawn on by `draw`.
pub(super) fn picture((width, height): (u32, u32), draw: impl FnOnce(&Area<'_>) -> Drawn) -> Drawn<String> {
    let mut drawing = String::new();
    {
        let unit = PIXEL.unsigned_abs();
        let area = SVGBackend::with_string(&mut drawing, (width * unit, height * unit)).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
    }
    Ok(compact(&drawing, (width, height)))
}

/// An element without content, on its own line, as plotters writes it.
struct Element<'a> {
    tag: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
}

impl<'a> Element<'a> {
    /// From `<tag key="value" …` without the closing part. Plotters escapes quotes in values.
    fn parse(opening: &'a str) -> Option<Self> {
        let inner = opening.strip_prefix('<')?;
        let (tag, mut rest) = inner.split_once(' ').unwrap_or((inner, ""));
        let mut attributes = Vec::new();
        while let Some((key, value)) = rest.split_once("=\"") {
            let (value, tail) = value.split_once('"')?;
            attributes.push((key.trim_start(), value));
            rest = tail;
        }
        Some(Self { tag, attributes })
    }

    fn get(&self, key: &str) -> Option<&'a str> {
        self.attributes
            .iter()
            .find(|(name, _)| *name == key)
            .map(|(_, value)| *value)
    }

    /// Its geometry.
    fn geometry(&self) -> String {
        let mut text = String::new();
        for (key, value) in &self.attributes {
            if GEOMETRY.contains(key) {
                push_attribute(&mut text, key, value.trim_end());
            }
        }
        text
    }

    /// Its looks, in attributes that it can inherit from a group. A group's opacity differs from its elements' opacity,
    /// but the opacity of fills and strokes is inherited.
    fn looks(&self) -> String {
        let mut text = String::new();
        let filled = self.get("fill").is_some_and(|fill| fill != "none");
        let stroked = self.get("stroke").is_some_and(|stroke| stroke != "none");
        for (key, value) in &self.attributes {
            match (*key, *value) {
                ("opacity", "1") | ("stroke", "none") | ("text-anchor", "start") | ("font-family", _) => {}
                ("stroke-width", _) if !stroked => {}
                ("opacity", alpha) => {
                    push_attribute(
                        &mut text,
                        if filled { "fill-opacity" } else { "stroke-opacity" },
                        alpha,
                    );
                }
                ("font-size", size) => {
                    // Plotters scales the size back and forth, with an error in the last digit.
                    let size = size
                        .parse::<f64>()
                        .map_or_else(|_| size.to_owned(), |size| format!("{}", size.round()));
                    push_attribute(&mut text, "font-size", &size);
                }
                (key, value) if !GEOMETRY.contains(&key) => push_attribute(&mut text, key, value),
                _ => {}
            }
        }
        if matches!(self.tag, "rect" | "line" | "polyline") {
            // Lines and bars are upright: on whole pixels they are sharp, without seams between bars.
            push_attribute(&mut text, "shape-rendering", "crispEdges");
        }
        text
    }
}

fn push_attribute(text: &mut String, key: &str, value: &str) {
    // Writing to a string cannot fail.
    let _ = write!(text, " {key}=\"{value}\"");
}

/// Consecutive elements with the same looks.
#[derive(Default)]
struct Run {
    looks: String,
    elements: Vec<String>,
}

impl Run {
    fn flush(&mut self, out: &mut String) {
        match self.elements.as_slice() {
            [] => {}
            [one] => out.push_str(&one.replacen("/>", &format!("{}/>", self.looks), 1)),
            many => {
                let _ = writeln!(out, "<g{}>", self.looks);
                out.extend(many.iter().map(String::as_str));
                out.push_str("</g>\n");
            }
        }
        self.elements.clear();
    }
}

/// Compacts plotters' drawing and shows it at a tenth of its size, as `width` × `height` pixels.
fn compact(drawing: &str, (width, height): (u32, u32)) -> String {
    let mut out = String::with_capacity(drawing.len() / 2);
    let mut run = Run::default();
    for line in drawing.lines() {
        let closed = line.strip_suffix("/>").and_then(Element::parse);
        if let Some(element) = closed {
            let looks = element.looks();
            if looks != run.looks {
                run.flush(&mut out);
                run.looks = looks;
            }
            run.elements
                .push(format!("<{}{}/>\n", element.tag, element.geometry()));
            continue;
        }
        run.flush(&mut out);
        match line.strip_suffix('>').and_then(Element::parse) {
            Some(element) if element.tag == "svg" => {
                let _ = writeln!(
                    out,
                    "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"{}\" \
                     font-family=\"{TYPEFACES}\">",
                    element.get("viewBox").unwrap_or_default(),
                );
            }
            Some(element) if element.tag == "text" => {
                let _ = write!(out, "<text{}{}>", element.geometry(), element.looks());
            }
            // Closing tags, and text between tags.
            _ if line.starts_with("</") => {
                out.push_str(line);
                out.push('\n');
            }
            _ => out.push_str(line),
        }
    }
    run.flush(&mut out);
    out
}
