//! Recognises bytes that are no mesh of a known format, to say what they are.

use crate::{
    error::ImportError,
    obj::lines::{Lines, is_statement, words},
};

/// Bytes at the start that are searched for a format's marks.
const SEARCHED_BYTES: usize = 4096;

/// What text without any mark looks like.
const OTHER_TEXT: &str = "some other text: a mesh is required as GLB, glTF, OBJ, PLY or STL";

/// Starts of files by which a format is known, with its name and what to do. The first match counts.
const SIGNATURES: &[(&[u8], &str)] = &[
    (
        b"version https://git-lfs",
        "a Git LFS pointer: send the file that it stands for (git lfs pull)",
    ),
    (b"data:", "a data URL: send the bytes that it encodes"),
    (b"ply\n", "a PLY mesh that is not plain text: save it as UTF-8"),
    (b"ply\r", "a PLY mesh that is not plain text: save it as UTF-8"),
    (b"OFF", "an OFF mesh: export it as GLB, OBJ, PLY or STL"),
    (b"COFF", "an OFF mesh: export it as GLB, OBJ, PLY or STL"),
    (
        b"Kaydara FBX Binary",
        "an FBX scene: export it as GLB, OBJ, PLY or STL",
    ),
    (b"; FBX", "an FBX scene: export it as GLB, OBJ, PLY or STL"),
    (b"PXR-USDC", "a USD scene: export it as GLB, OBJ, PLY or STL"),
    (b"#usda", "a USD scene: export it as GLB, OBJ, PLY or STL"),
    (b"BLENDER", "a Blender file: export it as GLB, OBJ, PLY or STL"),
    (b"//Maya ASCII", "a Maya scene: export it as GLB, OBJ, PLY or STL"),
    (b"FOR4", "a Maya scene: export it as GLB, OBJ, PLY or STL"),
    (b"FOR8", "a Maya scene: export it as GLB, OBJ, PLY or STL"),
    (b"#VRML", "a VRML scene: export it as GLB, OBJ, PLY or STL"),
    (b"xof ", "a DirectX mesh: export it as GLB, OBJ, PLY or STL"),
    (b"ISO-10303-21", "a STEP model: export it as GLB, OBJ, PLY or STL"),
    (b"DRACO", "a Draco mesh: export it as GLB, OBJ, PLY or STL"),
    (b"Ogawa", "an Alembic scene: export it as GLB, OBJ, PLY or STL"),
    (b"VOX ", "a MagicaVoxel model: export it as GLB, OBJ, PLY or STL"),
    (
        b"\xFF\xFE\xFF\x0E",
        "a SketchUp model: export it as GLB, OBJ, PLY or STL",
    ),
    (b"# .PCD", "a point cloud (PCD): make a mesh with faces of it"),
    (
        b"\xD0\xCF\x11\xE0",
        "a compound document (a 3ds Max scene is one): export it as GLB, OBJ, PLY or STL",
    ),
    (
        b"PK\x03\x04",
        "a ZIP archive (USDZ and 3MF files are such): send the mesh inside, or export it as GLB, OBJ, PLY or STL",
    ),
    (b"PK\x05\x06", "an empty ZIP archive: send the mesh"),
    (b"\x1F\x8B", "a gzip archive: unpack it"),
    (b"\x28\xB5\x2F\xFD", "a Zstandard archive: unpack it"),
    (b"BZh", "a bzip2 archive: unpack it"),
    (b"\xFD7zXZ", "an xz archive: unpack it"),
    (b"7z\xBC\xAF", "a 7z archive: send the mesh inside"),
    (b"Rar!", "a RAR archive: send the mesh inside"),
    (b"\x89PNG", "a PNG picture: send the mesh as GLB, OBJ, PLY or STL"),
    (
        b"\xFF\xD8\xFF",
        "a JPEG picture: send the mesh as GLB, OBJ, PLY or STL",
    ),
    (b"GIF8", "a GIF picture: send the mesh as GLB, OBJ, PLY or STL"),
    (
        b"RIFF",
        "a RIFF file, such as a WebP picture: send the mesh as GLB, OBJ, PLY or STL",
    ),
    (b"II*\0", "a TIFF picture: send the mesh as GLB, OBJ, PLY or STL"),
    (b"MM\0*", "a TIFF picture: send the mesh as GLB, OBJ, PLY or STL"),
    (b"DDS ", "a DDS texture: send the mesh as GLB, OBJ, PLY or STL"),
    (b"\xABKTX", "a KTX texture: send the mesh as GLB, OBJ, PLY or STL"),
    (b"%PDF", "a PDF document: send the mesh as GLB, OBJ, PLY or STL"),
    (b"\x7FELF", "a program: send the mesh as GLB, OBJ, PLY or STL"),
    (b"\xFF\xFE\0\0", "UTF-32 text: save it as UTF-8 or UTF-16"),
    (b"\0\0\xFE\xFF", "UTF-32 text: save it as UTF-8 or UTF-16"),
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
        return Some(ImportError::NotAMesh {
            lines,
            statements,
            looks_like: format.unwrap_or_else(|| unmarked(text)),
        });
    }
    (lines == 0).then_some(ImportError::Blank)
}

/// The format by its marks, if it has any.
fn format_of(bytes: &[u8]) -> Option<&'static str> {
    if let Some((_, format)) = SIGNATURES.iter().find(|(start, _)| bytes.starts_with(start)) {
        return Some(format);
    }
    // A 3D Studio file starts with its own length.
    if bytes.starts_with(b"MM") && bytes.get(2..6) == Some(&(bytes.len() as u32).to_le_bytes()) {
        return Some("a 3D Studio mesh (3DS): export it as GLB, OBJ, PLY or STL");
    }
    let start = bytes[..bytes.len().min(SEARCHED_BYTES)]
        .trim_ascii_start()
        .to_ascii_lowercase();
    let has = |mark: &str| start.windows(mark.len()).any(|part| part == mark.as_bytes());
    if start.starts_with(b"solid") && (has("facet") || has("endsolid")) {
        Some("a text STL mesh that is not plain text: save it as UTF-8")
    } else if start.starts_with(b"{") || start.starts_with(b"[") {
        Some(if has("\"asset\"") && has("\"version\"") {
            "a glTF scene that is not plain text: save it as UTF-8"
        } else {
            "JSON that is no glTF scene: send the mesh itself"
        })
    } else if start.starts_with(b"<") {
        Some(if has("<!doctype html") || has("<html") || has("<head") {
            "an HTML page: send the file that it is about"
        } else if has("<collada") {
            "a COLLADA scene: export it as GLB, OBJ, PLY or STL"
        } else if has("<x3d") {
            "an X3D scene: export it as GLB, OBJ, PLY or STL"
        } else {
            "XML: send the mesh as GLB, OBJ, PLY or STL"
        })
    } else {
        None
    }
}

/// What bytes without a mark look like.
fn unmarked(text: &[u8]) -> &'static str {
    let is_control = |byte: &u8| *byte < 0x20 && !byte.is_ascii_whitespace();
    if text.contains(&0) || 20 * text.iter().filter(|byte| is_control(byte)).count() > text.len() {
        return "binary data: a mesh is required as GLB, glTF, OBJ, PLY or STL";
    }
    let mut first_words = Lines::of(text).filter_map(|(_, line)| Some(words(&line).next()?.to_vec()));
    if first_words.any(|word| word == b"newmtl") {
        return "a material library (MTL): send the OBJ file that refers to it";
    }
    let is_base64 = |byte: &u8| byte.is_ascii_alphanumeric() || b"+/=".contains(byte);
    let text = text.trim_ascii();
    if text.len() >= 64
        && text
            .iter()
            .all(|byte| is_base64(byte) || byte.is_ascii_whitespace())
    {
        let longest = text.split(u8::is_ascii_whitespace).map(<[u8]>::len).max();
        if longest.is_some_and(|longest| longest >= 60) {
            return "base64: decode it first";
        }
    }
    OTHER_TEXT
}
