//! Reads PLY, as text and binary, with `ply-rs-bw`.
//!
//! The numbers of elements in a header are checked before anything is read by them: the parser reads as many as a header
//! claims. Text is read a line at a time, because the parser takes neither blank lines nor every number, and its errors do not say
//! which word is wrong.

mod header;
mod text;

use std::io::ErrorKind;

use grasp_synthesis::base::stop::Stop;
use ply_rs_bw::{
    parser::{ParseError, Parser, Reader},
    ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult},
};

use crate::{
    error::{ImportError, Violations},
    format::without_mark,
    limits::MeshLimits,
    raw::{Places, RawMesh, check_counts},
    runs::RawFace,
    stoppable::Stoppable,
};
use header::{Parts, check_header, read_header};
use text::BodyLines;

/// What errors of the parser are about.
const FILE: &str = "the PLY file";

/// Elements that the parser returns at a time.
const ELEMENTS_PER_PIECE: usize = 512;

/// The fewest bytes of a triangle: its number of corners, and their indices.
const MIN_TRIANGLE_BYTES: usize = 4;

/// The names under which files list the vertices of a face.
const INDEX_LISTS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// A vertex, in the file's units.
#[derive(Debug, Default)]
struct Vertex([f64; 3]);

/// A face's vertices; none if one of them is negative.
#[derive(Debug, Default)]
struct Face(Option<Vec<u32>>);

/// An element that is not used.
#[derive(Debug, Default)]
struct Ignored;

/// Reads a file.
pub(crate) fn read(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Vec<ImportError>> {
    let bytes = without_mark(bytes);
    let Parts { header, lines, body } = read_header(bytes).map_err(|error| vec![error])?;
    check_header(&header, bytes.len(), limits).map_err(|error| vec![error])?;
    let mut raw = RawMesh {
        places: Places::Faces,
        ..RawMesh::default()
    };
    let count = |name: &str| header.elements.get(name).map_or(0, |element| element.count);
    raw.coordinates.reserve_exact(3 * count("vertex"));
    // Of larger polygons, there are fewer.
    raw.corners
        .reserve_exact(3 * count("face").min(bytes.len() / MIN_TRIANGLE_BYTES));
    let names = raw.names.add_part("");
    let mut reading = ElementReader {
        raw: &mut raw,
        names,
        vertices: count("vertex"),
        limits,
        faces: 0,
        triangles: 0,
        violations: Violations::default(),
    };
    let behind = if header.encoding == Encoding::Ascii {
        let mut body = BodyLines::of(body, lines, stop);
        let mut wrong = Violations::default();
        for element in header.elements.values() {
            body.read(element, &mut wrong, |row| match element.name.as_str() {
                "vertex" => reading.vertex(row.vertex),
                "face" => reading.face(row.face),
                _ => Ok(()),
            })?;
        }
        wrong.into_result()?;
        (body.left()?, "lines")
    } else {
        let mut body = Reader::new(Stoppable::new(body, stop));
        for element in header.elements.values() {
            match element.name.as_str() {
                "vertex" => in_pieces(&mut body, element, &header, |vertex| reading.vertex(vertex))?,
                "face" => in_pieces(&mut body, element, &header, |face| reading.face(face))?,
                _ => in_pieces(&mut body, element, &header, |Ignored| Ok(()))?,
            }
        }
        (body.get_ref().left(), "bytes")
    };
    reading.violations.into_result()?;
    if let (left @ 1.., what) = behind {
        raw.warnings
            .push(format!("{left} {what} behind the last element were ignored"));
    }
    Ok(raw)
}

/// The axis of a coordinate, by its name.
fn axis(property: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|&axis| axis == property)
}

/// Reads elements a piece at a time, so that the parser does not keep all of them.
fn in_pieces<E: PropertyAccess>(
    reader: &mut Reader<Stoppable<'_>>,
    element: &ElementDef,
    header: &Header,
    mut add: impl FnMut(E) -> Result<(), ImportError>,
) -> Result<(), Vec<ImportError>> {
    let parser = Parser::<E>::new();
    let mut piece = element.clone();
    let mut left = element.count;
    while left > 0 {
        piece.count = left.min(ELEMENTS_PER_PIECE);
        left -= piece.count;
        let read = parser.read_payload_for_element(reader, &piece, header);
        for element in read.map_err(|error| failed(&error, element))? {
            add(element).map_err(|error| vec![error])?;
        }
    }
    Ok(())
}

/// Why the elements of a kind cannot be read.
fn failed(error: &ParseError, element: &ElementDef) -> Vec<ImportError> {
    vec![if error.kind() == ErrorKind::UnexpectedEof {
        cut_off(element)
    } else {
        ImportError::at(FILE, brief(&error.to_string()))
    }]
}

/// A file ends before its last element of a kind.
fn cut_off(element: &ElementDef) -> ImportError {
    let ElementDef { name, count, .. } = element;
    ImportError::at(
        FILE,
        format!("is cut off: it ends before the last of the {count} elements {name:?} that it claims"),
    )
}

/// Appends vertices and faces of a file to a mesh.
struct ElementReader<'r> {
    raw: &'r mut RawMesh,
    names: usize,
    /// Vertices of the file.
    vertices: usize,
    limits: MeshLimits,
    /// Faces and triangles so far.
    faces: usize,
    triangles: u64,
    violations: Violations,
}

impl ElementReader<'_> {
    /// Appends a vertex.
    #[expect(clippy::unnecessary_wraps, reason = "elements are added alike")]
    fn vertex(&mut self, Vertex(position): Vertex) -> Result<(), ImportError> {
        self.raw.add_vertex(position);
        Ok(())
    }

    /// Appends a face.
    ///
    /// # Errors
    /// There are too many triangles. Anything else that is wrong is among the violations.
    fn face(&mut self, Face(corners): Face) -> Result<(), ImportError> {
        let place = self.faces;
        self.faces += 1;
        let vertices = self.vertices;
        let mut wrong = |what: String| {
            self.violations
                .push(ImportError::at(format!("face {place}"), what));
        };
        let Some(corners) = corners else {
            wrong("a vertex index is negative or no whole number".to_owned());
            return Ok(());
        };
        if let Some(index) = corners.iter().find(|&&index| index as usize >= vertices) {
            wrong(format!(
                "vertex {index} does not exist; there are {vertices}, counted from 0"
            ));
            return Ok(());
        }
        if corners.len() < 3 {
            self.raw.without_area.note(place);
            return Ok(());
        }
        self.triangles += corners.len() as u64 - 2;
        check_counts(0, self.triangles, self.limits)?;
        self.raw.faces.push(RawFace {
            place,
            corners: corners.len(),
            names: self.names,
        });
        self.raw.corners.extend(corners);
        Ok(())
    }
}

/// A parser's message on one line, and cut short: it may repeat a whole line of the file.
fn brief(message: &str) -> String {
    let words: Vec<&str> = message.split_whitespace().collect();
    words.join(" ").chars().take(240).collect()
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(axis) = axis(name) else {
            return PropertyAccessResult::Ignored;
        };
        self.0[axis] = match value {
            Property::Char(value) => value.into(),
            Property::UChar(value) => value.into(),
            Property::Short(value) => value.into(),
            Property::UShort(value) => value.into(),
            Property::Int(value) => value.into(),
            Property::UInt(value) => value.into(),
            Property::Float(value) => value.into(),
            Property::Double(value) => value,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        fn indices<T: TryInto<u32>>(list: Vec<T>) -> Option<Vec<u32>> {
            list.into_iter().map(|index| index.try_into().ok()).collect()
        }
        if !INDEX_LISTS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match value {
            Property::ListChar(list) => indices(list),
            Property::ListUChar(list) => indices(list),
            Property::ListShort(list) => indices(list),
            Property::ListUShort(list) => indices(list),
            Property::ListInt(list) => indices(list),
            Property::ListUInt(list) => Some(list),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Ignored {
    fn new() -> Self {
        Self
    }
}
