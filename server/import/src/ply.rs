//! Reads PLY, as text and binary, with `ply-rs-bw`.
//!
//! The numbers of elements in a header are checked before anything is read by them: the parser reads as many as a header
//! claims.

use std::io::ErrorKind;

use grasp_synthesis::base::stop::Stop;
use ply_rs_bw::{
    parser::{ParseError, Parser, Reader},
    ply::{
        ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
        ScalarType,
    },
};

use crate::{
    error::{ImportError, Violations},
    format::without_mark,
    limits::MeshLimits,
    raw::{Places, RawMesh, check_counts},
    runs::RawFace,
    stoppable::Stoppable,
};

/// What errors of the parser are about.
const FILE: &str = "the PLY file";

/// Elements that the parser returns at a time.
const ELEMENTS_PER_PIECE: usize = 512;

/// The fewest bytes of a triangle: its number of corners, and their indices.
const LEAST_TRIANGLE_BYTES: usize = 4;

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
    let mut reader = Reader::new(Stoppable::new(without_mark(bytes), stop));
    let header = Parser::<Ignored>::new()
        .read_header(&mut reader)
        .map_err(|error| vec![ImportError::at(FILE, brief(&error.to_string()))])?;
    check_header(&header, bytes.len(), limits).map_err(|error| vec![error])?;
    let mut raw = RawMesh {
        places: Places::Faces,
        ..RawMesh::default()
    };
    let count = |name: &str| header.elements.get(name).map_or(0, |element| element.count);
    raw.coordinates.reserve_exact(3 * count("vertex"));
    // Of larger polygons, there are fewer.
    raw.corners
        .reserve_exact(3 * count("face").min(bytes.len() / LEAST_TRIANGLE_BYTES));
    let names = raw.names.add_named([]);
    let mut reading = FaceReader {
        raw: &mut raw,
        names,
        vertices: count("vertex"),
        limits,
        faces: 0,
        triangles: 0,
        violations: Violations::default(),
    };
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => in_pieces(&mut reader, element, &header, |Vertex(position)| {
                reading.raw.add_vertex(position);
                Ok(())
            })?,
            "face" => in_pieces(&mut reader, element, &header, |face| reading.add(face))?,
            _ => in_pieces(&mut reader, element, &header, |Ignored| Ok(()))?,
        }
    }
    reading.violations.into_result()?;
    Ok(raw)
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
    let ElementDef { name, count, .. } = element;
    let what = if error.kind() == ErrorKind::UnexpectedEof {
        format!("is cut off: it ends before the last of the {count} elements {name:?} that it claims")
    } else {
        brief(&error.to_string())
    };
    vec![ImportError::at(FILE, what)]
}

/// Appends the faces of a file to a mesh.
struct FaceReader<'r> {
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

impl FaceReader<'_> {
    /// Appends a face.
    ///
    /// # Errors
    /// There are too many triangles. Anything else that is wrong is among the violations.
    fn add(&mut self, Face(corners): Face) -> Result<(), ImportError> {
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

/// Checks what a header claims against the bytes that there are.
fn check_header(header: &Header, bytes: usize, limits: MeshLimits) -> Result<(), ImportError> {
    let wrong = |what: String| Err(ImportError::at("the PLY header", what));
    let count = |name: &str| {
        header
            .elements
            .get(name)
            .map_or(0, |element| element.count as u64)
    };
    if count("face") == 0 {
        return wrong(if count("tristrips") > 0 {
            "has triangle strips; export the mesh with faces".to_owned()
        } else {
            format!(
                "has {} vertices and no faces: a point cloud; make a mesh with faces of it",
                count("vertex")
            )
        });
    }
    for element in header.elements.values() {
        let least = least_bytes(element, header.encoding);
        if least == 0 {
            return wrong(format!("element {:?} has no properties", element.name));
        }
        if (element.count as u64).saturating_mul(least) > bytes as u64 {
            return wrong(format!(
                "claims {} elements {:?}, more than the {bytes} bytes of the file can hold",
                element.count, element.name
            ));
        }
    }
    let property = |element: &str, name: &str| {
        let element = header.elements.get(element)?;
        element.properties.get(name).map(|property| &property.data_type)
    };
    let is_number = |name: &&str| matches!(property("vertex", name), Some(PropertyType::Scalar(_)));
    let is_list = |name: &&str| matches!(property("face", name), Some(PropertyType::List(..)));
    if !["x", "y", "z"].iter().all(is_number) {
        return wrong("has no vertices with x, y and z".to_owned());
    }
    if !INDEX_LISTS.iter().any(is_list) {
        return wrong("has faces without a list vertex_indices or vertex_index".to_owned());
    }
    check_counts(count("vertex"), count("face"), limits)
}

/// The fewest bytes that an element takes.
fn least_bytes(element: &ElementDef, encoding: Encoding) -> u64 {
    if encoding == Encoding::Ascii {
        // A digit and what separates it for each property.
        return 2 * element.properties.len() as u64;
    }
    let size = |scalar: &ScalarType| match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    let properties = element
        .properties
        .values()
        .map(|property| match &property.data_type {
            PropertyType::Scalar(scalar) => size(scalar),
            PropertyType::List(count, _) => size(count),
        });
    properties.sum()
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
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
