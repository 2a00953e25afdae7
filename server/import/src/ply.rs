//! Reads PLY, as text and binary, with `ply-rs-bw`.
//!
//! The numbers of elements in a header are checked before anything is read by them: the parser reads as many as a header
//! claims.

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
    raw::{Places, RawFace, RawMesh, check_counts},
    stoppable::Stoppable,
};

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
    let failed = |error: ParseError| vec![ImportError::at("the PLY file", brief(&error.to_string()))];
    let mut reader = Reader::new(Stoppable::new(without_mark(bytes), stop));
    let header = Parser::<Ignored>::new()
        .read_header(&mut reader)
        .map_err(failed)?;
    check_header(&header, bytes.len(), limits).map_err(|error| vec![error])?;
    let mut raw = RawMesh {
        places: Places::Faces,
        ..RawMesh::default()
    };
    let mut faces = Vec::new();
    for element in header.elements.values() {
        match element.name.as_str() {
            "vertex" => {
                let vertices = Parser::<Vertex>::new();
                for Vertex(position) in vertices
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(failed)?
                {
                    raw.add_vertex(position);
                }
            }
            "face" => {
                faces = Parser::<Face>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(failed)?;
            }
            _ => {
                Parser::<Ignored>::new()
                    .read_payload_for_element(&mut reader, element, &header)
                    .map_err(failed)?;
            }
        }
    }
    add_faces(&mut raw, faces, limits)?;
    Ok(raw)
}

/// Appends all faces.
fn add_faces(raw: &mut RawMesh, faces: Vec<Face>, limits: MeshLimits) -> Result<(), Vec<ImportError>> {
    let names = raw.names.add_named([]);
    let vertices = raw.coordinates.len() / 3;
    let mut triangles = 0;
    let mut violations = Violations::default();
    for (place, face) in faces.into_iter().enumerate() {
        let mut wrong = |what: String| violations.push(ImportError::at(format!("face {place}"), what));
        let Some(corners) = face.0 else {
            wrong("a vertex index is negative or no whole number".to_owned());
            continue;
        };
        if let Some(index) = corners.iter().find(|&&index| index as usize >= vertices) {
            wrong(format!(
                "vertex {index} does not exist; there are {vertices}, counted from 0"
            ));
            continue;
        }
        if corners.len() < 3 {
            raw.without_area.note(place);
            continue;
        }
        triangles += corners.len() as u64 - 2;
        check_counts(0, triangles, limits).map_err(|error| vec![error])?;
        raw.faces.push(RawFace {
            place,
            corners: corners.len(),
            names,
        });
        raw.corners.extend(corners);
    }
    violations.into_result()
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
