//! Recognises the format of a mesh by its content.

use crate::{error::ImportError, stl};

/// Bytes at the start that are searched for a format's marks.
const SEARCHED_BYTES: usize = 4096;

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// Wavefront OBJ, and what is none of the others: its reader says what that is.
    Obj,
    StlText,
    StlBinary,
    Ply,
    /// glTF as JSON, or as GLB.
    Gltf,
}

impl Format {
    /// The format that bytes claim to have.
    pub(crate) fn of(bytes: &[u8]) -> Self {
        if bytes.starts_with(b"glTF") {
            return Self::Gltf;
        }
        if stl::is_binary(bytes) {
            return Self::StlBinary;
        }
        let text = without_mark(bytes);
        let start = text[..text.len().min(SEARCHED_BYTES)].trim_ascii_start();
        let mut lines = start
            .split(|&byte| matches!(byte, b'\n' | b'\r'))
            .map(<[u8]>::trim_ascii)
            .filter(|line| !line.is_empty());
        let mut words = move || lines.next().map(first_word).unwrap_or_default();
        let (first, second) = (words(), words());
        match first.as_slice() {
            b"ply" if matches!(second.as_slice(), b"format" | b"comment" | b"obj_info") => Self::Ply,
            b"solid" if matches!(second.as_slice(), b"facet" | b"endsolid") => Self::StlText,
            _ if start.starts_with(b"{") && contains(text, b"\"asset\"") => Self::Gltf,
            _ => Self::Obj,
        }
    }

    /// Errors that say of which format an empty mesh is, since its file may be of another one than its sender believes, and what
    /// the reader noted.
    pub(crate) fn named(self, errors: Vec<ImportError>, notes: &[String]) -> Vec<ImportError> {
        let place = match self {
            Self::Obj => return errors,
            Self::StlText | Self::StlBinary => "the STL mesh",
            Self::Ply => "the PLY mesh",
            Self::Gltf => "the glTF scene",
        };
        let named = |error| match error {
            ImportError::Empty { dropped, .. } => {
                let dropped = (dropped > 0).then(|| format!("{dropped} faces without area were ignored"));
                let notes = dropped.into_iter().chain(notes.iter().cloned());
                let all: Vec<String> = std::iter::once("has no triangles".to_owned())
                    .chain(notes)
                    .collect();
                ImportError::at(place, all.join("; "))
            }
            other => other,
        };
        errors.into_iter().map(named).collect()
    }
}

/// Text without the mark of UTF-8 that some editors put in front of it.
pub(crate) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// The first word of a line, in lower case.
fn first_word(line: &[u8]) -> Vec<u8> {
    let word = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    word.to_ascii_lowercase()
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}
