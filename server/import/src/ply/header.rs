//! The header of a PLY file.

use ply_rs_bw::{
    parser::{Parser, Reader},
    ply::{ElementDef, Encoding, Header, PropertyType, ScalarType},
};

use super::{INDEX_LISTS, Ignored};
use crate::{
    error::ImportError,
    limits::MeshLimits,
    obj::lines::{cut, shown},
    raw::check_counts,
};

/// The line that ends a header.
const END: &[u8] = b"end_header";

/// A file in two.
#[derive(Debug)]
pub(super) struct Parts<'a> {
    pub(super) header: Header,
    /// Number of lines of the header.
    pub(super) lines: usize,
    /// What follows it.
    pub(super) body: &'a [u8],
}

/// Reads the header. Its lines may end as those of any text: the parser takes line feeds only.
pub(super) fn read_header(bytes: &[u8]) -> Result<Parts<'_>, ImportError> {
    let mut text = Vec::new();
    let mut lines = 0;
    let mut has_returns = false;
    let mut rest = Some(bytes);
    let body = loop {
        let Some(before) = rest else {
            return Err(ImportError::at(
                "the PLY header",
                "does not end: there is no line end_header",
            ));
        };
        let (line, after) = cut(before);
        let end = before.len() - after.map_or(0, <[u8]>::len);
        if lines == 0 {
            has_returns = before[line.len()..end] == *b"\r";
        }
        lines += 1;
        let words = line.trim_ascii();
        text.extend_from_slice(if words.is_empty() { b"comment" } else { words });
        text.push(b'\n');
        if words == END {
            // Behind a carriage return alone, a line feed is the first byte of the body.
            break &before[if has_returns { end.min(line.len() + 1) } else { end }..];
        }
        rest = after;
    };
    let header = Parser::<Ignored>::new()
        .read_header(&mut Reader::new(text.as_slice()))
        .map_err(|error| not_understood(error.line(), &text))?;
    Ok(Parts { header, lines, body })
}

/// An error in a line of a header, or in the whole.
fn not_understood(line: Option<usize>, text: &[u8]) -> ImportError {
    let found =
        line.and_then(|line| Some((line, text.split(|&byte| byte == b'\n').nth(line.checked_sub(1)?)?)));
    match found {
        Some((line, words)) => ImportError::at(
            format!("line {line}"),
            format!("{:?} is not understood in the header of a PLY file", shown(words)),
        ),
        None => ImportError::at(
            "the PLY header",
            "has no line format, or one of an unknown version",
        ),
    }
}

/// Checks what a header claims against the bytes that there are.
pub(super) fn check_header(header: &Header, bytes: usize, limits: MeshLimits) -> Result<(), ImportError> {
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
    for list in INDEX_LISTS {
        if let Some(PropertyType::List(counts, indices)) = property("face", list)
            && ![counts, indices].into_iter().all(is_whole)
        {
            return wrong(format!(
                "has a list {list} of fractions (float or double); numbers of corners and vertices must be whole (uchar, int and \
                 the like)"
            ));
        }
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

fn is_whole(kind: &ScalarType) -> bool {
    !matches!(kind, ScalarType::Float | ScalarType::Double)
}
