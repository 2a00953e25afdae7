//! Reads STL, as text and binary, with `stl_io`.
//!
//! Text is first rewritten in the form that the parser expects: lower case, one solid, and normals, which are ignored, that
//! are numbers. The names of its solids are those of the triangles' parts.

use std::{borrow::Cow, io::Cursor, ops::RangeInclusive};

use grasp_synthesis::base::stop::Stop;
use stl_io::{Triangle, create_stl_reader};

use crate::{
    error::ImportError,
    format::without_mark,
    limits::MeshLimits,
    obj::lines::plain_lines,
    raw::{Place, Places, RawMesh, check_counts},
    stoppable::stopped,
};

/// Bytes of a binary file before its triangles, and per triangle.
const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// Lines or triangles read between two checks whether to stop.
const STEPS_PER_CHECK: usize = 1024;

/// Sizes of numbers, other than 0, that a first triangle may have: those of other data, such as text in UTF-16, are mostly beyond.
const USUAL_NUMBERS: RangeInclusive<f32> = 1e-12..=1e9;

/// True if bytes are binary STL: they have the length that follows from the number of triangles, or one of that order and a first
/// triangle of usual numbers. Such a file is cut off, or has bytes behind its triangles.
pub(crate) fn is_binary(bytes: &[u8]) -> bool {
    let Some(claimed) = claimed_triangles(bytes).filter(|&claimed| claimed > 0) else {
        return false;
    };
    let rest = &bytes[HEADER_BYTES..];
    if rest.len() as u64 == claimed * TRIANGLE_BYTES as u64 {
        return true;
    }
    let present = (rest.len() / TRIANGLE_BYTES) as u64;
    let is_near = (present / 2..=present.saturating_mul(100)).contains(&claimed);
    let numbers = rest
        .get(..TRIANGLE_BYTES - 2)
        .map(|numbers| numbers.as_chunks().0);
    is_near
        && numbers.is_some_and(|numbers| {
            let mut numbers = numbers.iter().map(|&number| f32::from_le_bytes(number).abs());
            numbers.all(|number| number == 0.0 || USUAL_NUMBERS.contains(&number))
        })
}

fn claimed_triangles(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u64::from(u32::from_le_bytes(count.try_into().ok()?)))
}

/// Reads a binary file.
pub(crate) fn read_binary(
    bytes: &[u8],
    limits: MeshLimits,
    stop: Stop<'_>,
) -> Result<RawMesh, Vec<ImportError>> {
    let claimed = claimed_triangles(bytes).unwrap_or_default();
    check_counts(0, claimed, limits).map_err(|error| vec![error])?;
    let present = (bytes.len() - HEADER_BYTES) / TRIANGLE_BYTES;
    if (present as u64) < claimed {
        return Err(vec![ImportError::at(
            "the STL file",
            format!("is cut off: it claims {claimed} triangles and has {present}"),
        )]);
    }
    // A header may begin with the word by which the parser knows text.
    let mut blank = Cow::Borrowed(bytes);
    if bytes.starts_with(b"solid") {
        blank.to_mut()[..HEADER_BYTES - 4].fill(0);
    }
    let mut raw = RawMesh {
        places: Places::Triangles,
        ..RawMesh::default()
    };
    let names = raw.names.add_part("");
    raw.coordinates.reserve(9 * present.min(claimed as usize));
    raw.corners.reserve(3 * present.min(claimed as usize));
    read_into(&mut raw, Cursor::new(blank), stop, |triangle| (triangle, names))?;
    let spare = bytes.len() - HEADER_BYTES - raw.faces.triangles() * TRIANGLE_BYTES;
    if spare > 0 {
        raw.warnings
            .push(format!("{spare} bytes behind the last triangle were ignored"));
    }
    Ok(raw)
}

/// Reads a text file.
pub(crate) fn read_text(
    bytes: &[u8],
    limits: MeshLimits,
    stop: Stop<'_>,
) -> Result<RawMesh, Vec<ImportError>> {
    let mut raw = RawMesh {
        places: Places::Lines,
        ..RawMesh::default()
    };
    let plain = PlainText::of(without_mark(bytes), &mut raw, limits, stop)?;
    let facets = &plain.facets;
    read_into(&mut raw, Cursor::new(plain.text), stop, |facet| {
        facets.get(facet).copied().unwrap_or((plain.lines, 0))
    })?;
    // The parser has accepted every line, but reads in single precision.
    for (coordinate, exact) in raw.coordinates.iter_mut().zip(plain.coordinates) {
        *coordinate = exact;
    }
    Ok(raw)
}

/// Appends all triangles; `about` gives the place and the set of names of each by its number.
fn read_into(
    raw: &mut RawMesh,
    mut file: Cursor<impl AsRef<[u8]>>,
    stop: Stop<'_>,
    about: impl Fn(usize) -> (usize, usize),
) -> Result<(), Vec<ImportError>> {
    let places = raw.places;
    let failed = |place: usize, error: &std::io::Error| {
        let place = format!("the STL facet {}", Place(places, place));
        vec![ImportError::at(place, error.to_string())]
    };
    let triangles = create_stl_reader(&mut file).map_err(|error| failed(0, &error))?;
    for (number, triangle) in triangles.enumerate() {
        stop.check_every(STEPS_PER_CHECK, number).map_err(stopped)?;
        let (place, names) = about(number);
        let Triangle { vertices, .. } = triangle.map_err(|error| failed(place, &error))?;
        let first = (raw.coordinates.len() / 3) as u32;
        for vertex in vertices {
            raw.add_vertex(vertex.0.map(f64::from));
        }
        raw.add_triangle([first, first + 1, first + 2], place, names);
    }
    Ok(())
}

/// Text in the form that the parser expects.
#[derive(Debug, Default)]
struct PlainText {
    text: Vec<u8>,
    /// x, y and z of the facets' vertices; not a number where the text is none.
    coordinates: Vec<f64>,
    /// The line of each facet, and its set of names.
    facets: Vec<(usize, usize)>,
    /// Number of lines.
    lines: usize,
}

impl PlainText {
    fn of(
        text: &[u8],
        raw: &mut RawMesh,
        limits: MeshLimits,
        stop: Stop<'_>,
    ) -> Result<Self, Vec<ImportError>> {
        let mut plain = Self {
            text: b"solid all\n".to_vec(),
            ..Self::default()
        };
        let mut names = raw.names.add_part("");
        for (index, line) in plain_lines(text).enumerate() {
            stop.check_every(STEPS_PER_CHECK, index).map_err(stopped)?;
            let number = index + 1;
            plain.lines = number;
            let line = line.trim_ascii();
            let lower = line.to_ascii_lowercase();
            let mut words = lower
                .split(u8::is_ascii_whitespace)
                .filter(|word| !word.is_empty());
            let keyword = words.next().unwrap_or_default();
            match keyword {
                b"" | b"endsolid" => {}
                b"solid" => {
                    let name = String::from_utf8_lossy(line[keyword.len()..].trim_ascii()).into_owned();
                    names = raw.names.add_part(&name);
                }
                b"facet" => {
                    plain.facets.push((number, names));
                    check_counts(0, plain.facets.len() as u64, limits).map_err(|error| vec![error])?;
                    plain.text.extend(b"facet normal 0 0 0\n");
                }
                b"outer" | b"vertex" | b"endloop" | b"endfacet" => {
                    plain.text.extend(String::from_utf8_lossy(&lower).bytes());
                    plain.text.push(b'\n');
                    if keyword == b"vertex" {
                        plain.coordinates.extend(words.take(3).map(coordinate));
                    }
                }
                _ => raw.unknown.note(number),
            }
        }
        plain.text.extend(b"endsolid all\n");
        Ok(plain)
    }
}

/// The number that a word stands for, or not a number.
fn coordinate(word: &[u8]) -> f64 {
    let text = str::from_utf8(word).ok();
    text.and_then(|text| text.parse().ok()).unwrap_or(f64::NAN)
}
