//! Reads STL, as text and binary. The names of a text's solids are those of the triangles' parts; normals are ignored.

use std::ops::RangeInclusive;

use glam::DVec3;
use grasp_synthesis::base::stop::Stop;

use crate::{
    MeshLimits,
    error::{ImportError, Violations},
    raw::{Oddity, Places, RawMesh, check_counts},
    text::{number, plain_lines, shown, split_words, without_mark},
};

/// Bytes of a binary file before its triangles, and per triangle.
const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// First words of the lines of a facet in text.
const FACET: [&[u8]; 7] = [
    b"facet",
    b"outer",
    b"vertex",
    b"vertex",
    b"vertex",
    b"endloop",
    b"endfacet",
];

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
    let is_usual = |&number: &[u8; 4]| {
        let number = f32::from_le_bytes(number).abs();
        number == 0.0 || USUAL_NUMBERS.contains(&number)
    };
    let numbers = rest.get(..TRIANGLE_BYTES - 2);
    is_near && numbers.is_some_and(|numbers| numbers.as_chunks().0.iter().all(is_usual))
}

fn claimed_triangles(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER_BYTES - 4..HEADER_BYTES)?;
    Some(u64::from(u32::from_le_bytes(count.try_into().ok()?)))
}

/// Reads a binary file.
pub(crate) fn read_binary(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Violations> {
    let claimed = claimed_triangles(bytes).unwrap_or_default();
    check_counts(0, claimed, limits)?;
    let claimed = claimed as usize;
    let triangles = bytes[HEADER_BYTES..].chunks_exact(TRIANGLE_BYTES);
    let present = triangles.len();
    if present < claimed {
        let what = format!("is cut off: it claims {claimed} triangles and has {present}");
        return Err(ImportError::at("the STL file", what).into());
    }
    let mut raw = RawMesh::new("the STL mesh", Places::Triangles);
    let names = raw.names.add_part("");
    raw.positions.reserve(3 * claimed);
    raw.corners.reserve(3 * claimed);
    for (place, triangle) in triangles.take(claimed).enumerate() {
        stop.check_every(STEPS_PER_CHECK, place)?;
        // Behind its normal, nine numbers.
        let numbers = triangle[12..48].as_chunks().0.iter();
        let numbers: Vec<f64> = numbers.map(|&number| f32::from_le_bytes(number).into()).collect();
        let corners = numbers.as_chunks().0.iter();
        raw.positions.extend(corners.copied().map(DVec3::from_array));
        let first = 3 * place as u32;
        raw.add_triangle([first, first + 1, first + 2], place, names);
    }
    let spare = bytes.len() - HEADER_BYTES - claimed * TRIANGLE_BYTES;
    if spare > 0 {
        raw.warnings
            .push(format!("{spare} bytes behind the last triangle were ignored"));
    }
    Ok(raw)
}

/// Reads a text file, in any case.
pub(crate) fn read_text(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Violations> {
    let mut raw = RawMesh::new("the STL mesh", Places::Lines);
    let mut names = raw.names.add_part("");
    let (mut step, mut facet_line) = (0, 0);
    let wrong = |facet: usize, what: String| ImportError::at(format!("the STL facet on line {facet}"), what);
    for (line_number, line) in (1..).zip(plain_lines(without_mark(bytes))) {
        stop.check_every(STEPS_PER_CHECK, line_number)?;
        let line = line.trim_ascii();
        let words: Vec<&[u8]> = split_words(line).collect();
        let keyword = words.first().copied().unwrap_or_default().to_ascii_lowercase();
        if keyword == b"solid" {
            let name = String::from_utf8_lossy(line[keyword.len()..].trim_ascii());
            names = raw.names.add_part(&name);
        } else if FACET.contains(&keyword.as_slice()) {
            if step == 0 {
                facet_line = line_number;
            }
            if keyword != FACET[step] {
                let (found, expected) = (shown(line), shown(FACET[step]));
                let what = format!("has {found:?} on line {line_number}; {expected} must be there");
                return Err(wrong(facet_line, what).into());
            }
            if keyword == b"vertex" {
                let &[_, x, y, z] = words.as_slice() else {
                    let found = shown(line);
                    let what = format!("has {found:?} on line {line_number}; a vertex has three numbers");
                    return Err(wrong(facet_line, what).into());
                };
                let mut position = [0.0; 3];
                for (coordinate, word) in position.iter_mut().zip([x, y, z]) {
                    *coordinate =
                        number(line_number, word).map_err(|error| wrong(facet_line, error.to_string()))?;
                }
                raw.positions.push(DVec3::from_array(position));
            }
            step = (step + 1) % FACET.len();
            if step == 0 {
                let first = raw.positions.len() as u32 - 3;
                raw.add_triangle([first, first + 1, first + 2], facet_line, names);
                check_counts(0, raw.triangles as u64, limits)?;
            }
        } else if !matches!(keyword.as_slice(), b"" | b"endsolid") {
            raw.oddities.note(Oddity::UnknownLine, line_number);
        }
    }
    if step > 0 {
        let expected = shown(FACET[step]);
        return Err(wrong(facet_line, format!("is cut off before {expected}")).into());
    }
    Ok(raw)
}
