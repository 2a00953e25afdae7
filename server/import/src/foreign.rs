//! Recognises bytes that are no mesh of a known format, to say what they are.

use crate::{
    error::ImportError,
    obj::lines::{Lines, is_statement, words},
};

/// Starts of files by which a format is known, in lower case, with its name and a remedy. The first match counts.
const SIGNATURES: &[(&[u8], &str)] = &[
    (
        b"version https://git-lfs",
        "a Git LFS pointer: send the file that it stands for (git lfs pull)",
    ),
    (b"ply", "a PLY mesh that is not plain text: save it as UTF-8"),
    (
        b"solid",
        "a text STL mesh that is not plain text: save it as UTF-8",
    ),
    (b"off", "an OFF mesh: export it as GLB, OBJ, PLY or STL"),
    (
        b"kaydara fbx binary",
        "an FBX scene: export it as GLB, OBJ, PLY or STL",
    ),
    (b"; fbx", "an FBX scene: export it as GLB, OBJ, PLY or STL"),
    (b"pxr-usdc", "a USD scene: export it as GLB, OBJ, PLY or STL"),
    (b"#usda", "a USD scene: export it as GLB, OBJ, PLY or STL"),
    (b"blender", "a Blender file: export it as GLB, OBJ, PLY or STL"),
    (b"iso-10303-21", "a STEP model: export it as GLB, OBJ, PLY or STL"),
    (
        b"pk\x03\x04",
        "a ZIP archive (USDZ and 3MF files are such): send the mesh inside",
    ),
    (b"\x1F\x8B", "a gzip archive: unpack it"),
    (b"\x89png", "a PNG picture: send the mesh as GLB, OBJ, PLY or STL"),
    (
        b"\xFF\xD8\xFF",
        "a JPEG picture: send the mesh as GLB, OBJ, PLY or STL",
    ),
    (b"\xFF\xFE\0\0", "UTF-32 text: save it as UTF-8 or UTF-16"),
    (b"\0\0\xFE\xFF", "UTF-32 text: save it as UTF-8 or UTF-16"),
    (b"<!doctype html", "an HTML page: send the file that it is about"),
    (b"<html", "an HTML page: send the file that it is about"),
    (
        b"<",
        "XML (COLLADA and X3D files are such): send the mesh as GLB, OBJ, PLY or STL",
    ),
    (b"{", "JSON that is no glTF scene: send the mesh itself"),
    (b"[", "JSON that is no glTF scene: send the mesh itself"),
    (
        b"newmtl",
        "a material library (MTL): send the OBJ file that refers to it",
    ),
];

/// Why bytes were rejected as OBJ text, if the reason is that they are something else; `text` is what they decode to.
pub(crate) fn foreign(bytes: &[u8], text: &[u8]) -> Option<ImportError> {
    if bytes.is_empty() {
        return Some(ImportError::Blank);
    }
    let (mut lines, mut statements) = (0, 0);
    for (_, line) in Lines::of(text) {
        if let Some(word) = words(&line).next() {
            lines += 1;
            statements += usize::from(is_statement(word));
        }
    }
    let format = format_of(bytes).or_else(|| format_of(text));
    let is_foreign = if format.is_some() {
        2 * statements < lines || lines == 0
    } else {
        10 * statements < lines
    };
    if is_foreign {
        let is_control = |byte: &u8| *byte < 0x20 && !byte.is_ascii_whitespace();
        let looks_like = format.unwrap_or(if text.iter().any(is_control) {
            "binary data: a mesh is required as GLB, glTF, OBJ, PLY or STL"
        } else {
            "some other text: a mesh is required as GLB, glTF, OBJ, PLY or STL"
        });
        return Some(ImportError::NotAMesh {
            lines,
            statements,
            looks_like,
        });
    }
    (lines == 0).then_some(ImportError::Blank)
}

/// The format by its first bytes, if they are known.
fn format_of(bytes: &[u8]) -> Option<&'static str> {
    let bytes = bytes.trim_ascii_start();
    let is_at_start = |start: &[u8]| {
        bytes
            .get(..start.len())
            .is_some_and(|own| own.eq_ignore_ascii_case(start))
    };
    SIGNATURES
        .iter()
        .find(|(start, _)| is_at_start(start))
        .map(|&(_, format)| format)
}
