//! The picture: plotters' SVG backend, drawn to in tenths of a pixel, and its output made short.
//!
//! Plotters knows whole units only. A picture drawn in tenths of a pixel and shown at a tenth of its size has dots
//! where they belong and thin lines. Plotters repeats each element's colours; [`compact`] says them once for all
//! elements in a row that share them.

use std::{fmt::Write, io};

use plotters::{
    backend::SVGBackend,
    coord::Shift,
    drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea},
    style::WHITE,
};

/// A part of the picture; its coordinates are tenths of a pixel from its upper left corner.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// What drawing returns.
pub(super) type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<io::Error>>;

/// Units of the drawing in a pixel.
pub(super) const PIXEL: i32 = 10;

/// Typefaces by preference; the estimates of widths are Helvetica's.
const TYPEFACES: &str = "Helvetica, Arial, 'Liberation Sans', sans-serif";

/// Attributes that say where an element lies; the others say what it looks like.
const GEOMETRY: [&str; 13] = [
    "cx", "cy", "dy", "height", "points", "r", "width", "x", "x1", "x2", "y", "y1", "y2",
];

/// Pixels in units of the drawing.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(PIXEL)).round() as i32
}

/// A white picture of so many pixels with what `draw` draws.
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

/// An element without content, as plotters writes it: on a line of its own.
struct Element<'a> {
    tag: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
}

impl<'a> Element<'a> {
    /// From `<tag key="value" …` without what closes it. Plotters escapes quotes in values.
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

    /// Where it lies.
    fn geometry(&self) -> String {
        let mut text = String::new();
        for (key, value) in &self.attributes {
            if GEOMETRY.contains(key) {
                push_attribute(&mut text, key, value.trim_end());
            }
        }
        text
    }

    /// What it looks like, in attributes that a group can hand down: the opacity of a group is another thing than
    /// that of its elements, but the opacity of fills and strokes is not.
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
                    // Plotters scales it there and back, with an error in the last digit.
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
            // Lines and bars are upright: on whole pixels they are sharp and bars leave no seams.
            push_attribute(&mut text, "shape-rendering", "crispEdges");
        }
        text
    }
}

fn push_attribute(text: &mut String, key: &str, value: &str) {
    // Writing to a string cannot fail.
    let _ = write!(text, " {key}=\"{value}\"");
}

/// The elements in a row that look the same.
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

/// What plotters drew, said shorter and shown at a tenth of its size, which is `width` × `height` pixels.
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
            // Ends of elements, and the words between them.
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
