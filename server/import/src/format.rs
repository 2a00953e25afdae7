//! Recognises the format of a mesh by its content, or that of bytes that are no mesh.

use crate::{
    error::ImportError,
    stl,
    text::{is_statement, lines, split_words, without_mark, words},
};

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
        let mut first_words = start
            .split(|&byte| matches!(byte, b'\n' | b'\r'))
            .filter_map(|line| split_words(line).next())
            .map(<[u8]>::to_ascii_lowercase);
        let mut word = || first_words.next().unwrap_or_default();
        match (word().as_slice(), word().as_slice()) {
            (b"ply", b"format" | b"comment" | b"obj_info") => Self::Ply,
            (b"solid", b"facet" | b"endsolid") => Self::StlText,
            _ if start.starts_with(b"{") && text.windows(7).any(|part| part == b"\"asset\"") => Self::Gltf,
            _ => Self::Obj,
        }
    }
}

/// Starts of files that cannot be read, in lower case, and their formats. The first match counts.
const FOREIGN: [(&[u8], &str); 22] = [
    (b"version https://git-lfs", "a Git LFS pointer (see git lfs pull)"),
    (b"ply", "a PLY mesh that is not UTF-8"),
    (b"solid", "a text STL mesh that is not UTF-8"),
    (b"off", "an OFF mesh"),
    (b"kaydara fbx binary", "an FBX scene"),
    (b"; fbx", "an FBX scene"),
    (b"pxr-usdc", "a USD scene"),
    (b"#usda", "a USD scene"),
    (b"blender", "a Blender file"),
    (b"iso-10303-21", "a STEP model"),
    (b"pk\x03\x04", "a ZIP archive (USDZ and 3MF files are such)"),
    (b"\x1F\x8B", "a gzip archive"),
    (b"\x89png", "a PNG picture"),
    (b"\xFF\xD8\xFF", "a JPEG picture"),
    (b"\xFF\xFE\0\0", "UTF-32 text, not UTF-8 or UTF-16"),
    (b"\0\0\xFE\xFF", "UTF-32 text, not UTF-8 or UTF-16"),
    (b"<!doctype html", "an HTML page"),
    (b"<html", "an HTML page"),
    (b"<", "XML (COLLADA and X3D files are such)"),
    (b"{", "JSON that is no glTF scene"),
    (b"[", "JSON that is no glTF scene"),
    (b"newmtl", "a material library (MTL) of an OBJ file"),
];

/// Why bytes were rejected as OBJ text, if the reason is that they are something else; `text` is what they decode to.
pub(crate) fn foreign(bytes: &[u8], text: &[u8]) -> Option<ImportError> {
    let (mut count, mut statements) = (0, 0);
    for (_, line) in lines(text) {
        if let Some(word) = words(&line).next() {
            count += 1;
            statements += usize::from(is_statement(word));
        }
    }
    let known = |bytes: &[u8]| {
        let bytes = bytes.trim_ascii_start();
        FOREIGN.iter().find(|(mark, _)| {
            let start = bytes.get(..mark.len());
            start.is_some_and(|start| start.eq_ignore_ascii_case(mark))
        })
    };
    let format = known(bytes).or_else(|| known(text));
    let is_foreign = match format {
        Some(_) => 2 * statements < count || count == 0,
        None => 10 * statements < count,
    };
    if is_foreign {
        let is_control = |byte: &u8| *byte < 0x20 && !byte.is_ascii_whitespace();
        let looks_like = match format {
            Some((_, name)) => name,
            None if text.iter().any(is_control) => "binary data",
            None => "some other text",
        };
        let begin = if statements == 0 {
            format!("none of the {count} lines begins with a word of OBJ (v, f, ...)")
        } else {
            format!("words of OBJ (v, f, ...) begin only {statements} of the {count} lines")
        };
        return Some(ImportError::Whole(format!(
            "{begin}; this looks like {looks_like}: a mesh is required as GLB, glTF, OBJ, PLY or STL"
        )));
    }
    let what = "the file is empty or has only blank lines and comments; a mesh is required as GLB, glTF, OBJ, PLY or STL";
    (count == 0).then(|| ImportError::Whole(what.to_owned()))
}
