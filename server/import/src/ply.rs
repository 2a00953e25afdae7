//! Reads PLY, as text and binary.
//!
//! The numbers of elements that a header claims are checked against the bytes that there are before anything is read by them.

use glam::DVec3;
use grasp_synthesis::base::stop::Stop;

use crate::{
    MeshLimits,
    error::{ImportError, Violations},
    raw::{Oddity, Places, RawMesh, check_counts},
    text::{cut, number, parsed, plain_lines, shown, split_words, without_mark, words},
};

/// Elements read between two checks whether to stop.
const ELEMENTS_PER_CHECK: usize = 1024;

/// Most properties of a file's elements together. Splats have 62.
const MAX_PROPERTIES: usize = 1024;

/// The names of coordinates.
const AXES: [&str; 3] = ["x", "y", "z"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// The type of a number, and its size in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Scalar {
    fn of(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::Signed(1),
            b"uchar" | b"uint8" => Self::Unsigned(1),
            b"short" | b"int16" => Self::Signed(2),
            b"ushort" | b"uint16" => Self::Unsigned(2),
            b"int" | b"int32" => Self::Signed(4),
            b"uint" | b"uint32" => Self::Unsigned(4),
            b"float" | b"float32" => Self::Float(4),
            b"double" | b"float64" => Self::Float(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        let (Self::Signed(bytes) | Self::Unsigned(bytes) | Self::Float(bytes)) = self;
        bytes
    }

    /// The number that little-endian bytes encode, padded to eight.
    fn number(self, bytes: [u8; 8]) -> f64 {
        let unsigned = u64::from_le_bytes(bytes);
        match self {
            Self::Float(8) => f64::from_bits(unsigned),
            Self::Float(_) => f32::from_bits(unsigned as u32).into(),
            Self::Unsigned(_) => unsigned as f64,
            Self::Signed(size) => {
                let unused = 64 - 8 * size;
                ((unsigned << unused).cast_signed() >> unused) as f64
            }
        }
    }
}

#[derive(Debug)]
struct Property {
    name: String,
    /// The type of a list's length; `None` for a single number.
    length: Option<Scalar>,
    scalar: Scalar,
}

impl Property {
    fn is_of_indices(&self) -> bool {
        matches!(self.name.as_str(), "vertex_indices" | "vertex_index")
    }
}

#[derive(Debug)]
struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

impl Element {
    fn cut_off(&self) -> ImportError {
        let Self { name, count, .. } = self;
        ImportError::at(
            "the PLY file",
            format!("is cut off: it ends before the last of the {count} elements {name:?} that it claims"),
        )
    }
}

#[derive(Debug)]
struct Header<'a> {
    encoding: Encoding,
    elements: Vec<Element>,
    /// Number of lines of the header.
    lines: usize,
    /// The bytes behind it.
    body: &'a [u8],
}

fn wrong_header(what: impl Into<String>) -> ImportError {
    ImportError::at("the PLY header", what)
}

impl<'a> Header<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, ImportError> {
        let (mut encoding, mut elements) = (None, Vec::<Element>::new());
        let (mut lines, mut properties, mut has_returns) = (0, 0, false);
        let mut rest = Some(bytes);
        loop {
            let before = rest.ok_or_else(|| wrong_header("does not end: there is no line end_header"))?;
            let (line, after) = cut(before);
            let end = before.len() - after.map_or(0, <[u8]>::len);
            if lines == 0 {
                has_returns = before[line.len()..end] == *b"\r";
            }
            lines += 1;
            let is_understood = match split_words(line).collect::<Vec<_>>()[..] {
                [b"ply"] => lines == 1,
                [b"format", name, b"1.0"] => {
                    encoding = match name {
                        b"ascii" => Some(Encoding::Text),
                        b"binary_little_endian" => Some(Encoding::LittleEndian),
                        b"binary_big_endian" => Some(Encoding::BigEndian),
                        _ => None,
                    };
                    encoding.is_some()
                }
                // Without a known format, the end of the header says so.
                [] | [b"comment" | b"format" | b"obj_info", ..] => true,
                [b"element", name, count] => {
                    let name = String::from_utf8_lossy(name).into_owned();
                    let is_new = elements.iter().all(|element| element.name != name);
                    let count = parsed(count);
                    elements.extend(count.map(|count| Element {
                        name,
                        count,
                        properties: Vec::new(),
                    }));
                    is_new && count.is_some()
                }
                [b"property", ..] if properties == MAX_PROPERTIES => {
                    return Err(wrong_header(format!("has more than {MAX_PROPERTIES} properties")));
                }
                [b"property", ref kind @ .., name] => {
                    properties += 1;
                    let (length, scalar) = match *kind {
                        [scalar] => (Some(None), scalar),
                        [b"list", length, scalar] => (Scalar::of(length).map(Some), scalar),
                        _ => (None, &b""[..]),
                    };
                    match (length, Scalar::of(scalar), elements.last_mut()) {
                        (Some(length), Some(scalar), Some(element)) => {
                            let name = String::from_utf8_lossy(name).into_owned();
                            element.properties.push(Property { name, length, scalar });
                            true
                        }
                        _ => false,
                    }
                }
                [b"end_header"] => {
                    // Behind a carriage return alone, a line feed is the first byte of the body.
                    let body = &before[if has_returns { end.min(line.len() + 1) } else { end }..];
                    let encoding = encoding
                        .ok_or_else(|| wrong_header("has no line format, or one of an unknown version"))?;
                    return Ok(Self {
                        encoding,
                        elements,
                        lines,
                        body,
                    });
                }
                _ => false,
            };
            if !is_understood {
                let line = shown(line.trim_ascii());
                let what = format!("{line:?} is not understood in the header of a PLY file");
                return Err(ImportError::on_line(lines, what));
            }
            rest = after;
        }
    }

    fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|element| element.name == name)
    }

    fn count(&self, name: &str) -> usize {
        self.element(name).map_or(0, |element| element.count)
    }

    /// Checks the header's claims against the length of the file.
    fn check(&self, bytes: usize, limits: MeshLimits) -> Result<(), ImportError> {
        let vertices = self.count("vertex");
        if self.count("face") == 0 {
            return Err(wrong_header(if self.count("tristrips") > 0 {
                "has triangle strips; export the mesh with faces".to_owned()
            } else {
                format!("has {vertices} vertices and no faces: a point cloud; make a mesh with faces of it")
            }));
        }
        for element in &self.elements {
            let Element { name, count, .. } = element;
            // In text, a digit and a separator for each property.
            let sizes = element.properties.iter().map(|property| match self.encoding {
                Encoding::Text => 2,
                _ => property.length.unwrap_or(property.scalar).bytes(),
            });
            let least: usize = sizes.sum();
            if least == 0 {
                return Err(wrong_header(format!("element {name:?} has no properties")));
            }
            if count.saturating_mul(least) > bytes {
                return Err(wrong_header(format!(
                    "claims {count} elements {name:?}, more than the {bytes} bytes of the file can hold"
                )));
            }
        }
        let properties = |element: &str| self.element(element).into_iter().flat_map(|own| &own.properties);
        let is_number = |axis: &&str| {
            properties("vertex").any(|property| property.name == **axis && property.length.is_none())
        };
        if !AXES.iter().all(is_number) {
            return Err(wrong_header("has no vertices with x, y and z"));
        }
        let mut lists = properties("face")
            .filter(|list| list.length.is_some() && list.is_of_indices())
            .peekable();
        if lists.peek().is_none() {
            let what = "has faces without a list vertex_indices or vertex_index";
            return Err(wrong_header(what));
        }
        let is_float = |scalar: &Scalar| matches!(scalar, Scalar::Float(_));
        if let Some(list) = lists.find(|list| list.length.iter().chain([&list.scalar]).any(is_float)) {
            return Err(wrong_header(format!(
                "has a list {} of fractions (float or double); numbers of corners and vertices must be whole (uchar, int and the \
                 like)",
                list.name
            )));
        }
        check_counts(vertices as u64, self.count("face") as u64, limits)
    }
}

/// The properties read of an element.
#[derive(Debug, Default)]
struct Row {
    position: [f64; 3],
    /// A face's vertices; `None` if one of them is negative or no whole number.
    corners: Option<Vec<u32>>,
}

impl Row {
    /// Reads the properties of an element; `next` has the next number of a type, which is `f64::NAN` where it need not count.
    fn read(
        element: &Element,
        mut next: impl FnMut(&Property, Scalar, bool) -> Result<f64, ImportError>,
    ) -> Result<Self, ImportError> {
        let mut row = Self::default();
        for property in &element.properties {
            let axis = AXES.iter().position(|&axis| axis == property.name);
            let Some(length) = property.length else {
                let number = next(property, property.scalar, axis.is_some())?;
                if let Some(axis) = axis {
                    row.position[axis] = number;
                }
                continue;
            };
            let length = next(property, length, true)?;
            if length < 0.0 || length.fract() != 0.0 {
                let what = format!("has a list {:?} of {length} numbers", property.name);
                return Err(ImportError::at("the PLY file", what));
            }
            let is_used = property.is_of_indices();
            let mut corners = Some(Vec::new());
            for _ in 0..length as u64 {
                let index = next(property, property.scalar, false)?;
                let is_index = index.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&index);
                corners = corners.filter(|_| is_index);
                if let Some(corners) = corners.as_mut().filter(|_| is_used) {
                    corners.push(index as u32);
                }
            }
            if is_used {
                row.corners = corners;
            }
        }
        Ok(row)
    }
}

/// Reads a file.
pub(crate) fn read(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Violations> {
    let bytes = without_mark(bytes);
    let header = Header::read(bytes)?;
    header.check(bytes.len(), limits)?;
    let mut raw = RawMesh::new("the PLY mesh", Places::Faces);
    let vertices = header.count("vertex");
    raw.positions.reserve_exact(vertices);
    let names = raw.names.add_part("");
    let (mut wrong_lines, mut wrong_faces) = (Violations::default(), Violations::default());
    let mut body = header.body;
    let mut lines = (header.lines + 1..)
        .zip(plain_lines(header.body))
        .filter(|(_, line)| words(line).next().is_some_and(|word| word != b"comment"));
    for element in &header.elements {
        for place in 0..element.count {
            stop.check_every(ELEMENTS_PER_CHECK, place)?;
            let row = if header.encoding == Encoding::Text {
                let (line, text) = lines.next().ok_or_else(|| element.cut_off())?;
                let mut words = words(text);
                let row = Row::read(element, |property, _, counts| {
                    let Some(word) = words.next() else {
                        let (name, of) = (&property.name, &element.name);
                        let what = format!("ends before {name:?} of element {of:?} is complete");
                        return Err(ImportError::on_line(line, what));
                    };
                    number(line, word).or_else(|error| if counts { Err(error) } else { Ok(f64::NAN) })
                });
                match row {
                    Ok(row) => row,
                    Err(error) => {
                        wrong_lines.push(error);
                        continue;
                    }
                }
            } else {
                Row::read(element, |_, scalar, _| {
                    let (number, rest) = body
                        .split_at_checked(scalar.bytes())
                        .ok_or_else(|| element.cut_off())?;
                    body = rest;
                    let mut bytes = [0; 8];
                    let own = &mut bytes[..number.len()];
                    own.copy_from_slice(number);
                    if header.encoding == Encoding::BigEndian {
                        own.reverse();
                    }
                    Ok(scalar.number(bytes))
                })?
            };
            if element.name == "vertex" {
                raw.positions.push(DVec3::from_array(row.position));
            } else if element.name == "face" {
                match face(row, vertices) {
                    Err(what) => wrong_faces.add(format!("face {place}"), what),
                    Ok(corners) if corners.len() < 3 => raw.oddities.note(Oddity::FewCorners, place),
                    Ok(corners) => {
                        raw.add_face(corners.len(), place, names);
                        raw.corners.extend(corners);
                        check_counts(0, raw.triangles as u64, limits)?;
                    }
                }
            }
        }
    }
    wrong_lines.into_result().and(wrong_faces.into_result())?;
    let (left, what) = match header.encoding {
        Encoding::Text => (lines.count(), "lines"),
        _ => (body.len(), "bytes"),
    };
    if left > 0 {
        let warning = format!("{left} {what} behind the last element were ignored");
        raw.warnings.push(warning);
    }
    Ok(raw)
}

/// The corners of a face, of which each must be a vertex.
fn face(row: Row, vertices: usize) -> Result<Vec<u32>, String> {
    let corners = row
        .corners
        .ok_or("a vertex index is negative or no whole number")?;
    match corners.iter().find(|&&index| index as usize >= vertices) {
        Some(index) => Err(format!(
            "vertex {index} does not exist; there are {vertices}, counted from 0"
        )),
        None => Ok(corners),
    }
}
