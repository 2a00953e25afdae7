//! Reads glTF 2.0 (JSON with its buffers inside, or GLB) with the crate `gltf`: the default scene as a viewer shows it before
//! anything moves, with skins and morph targets at rest.
//!
//! The crate parses and validates the document. Accessors are read by [`accessors`], because the crate's own iterators trust
//! lengths. What has no shape (materials, textures, animations, cameras) is dropped before validation, so that unusual ones
//! do not keep a mesh from being read.

mod accessors;
mod extensions;
mod meshes;
mod scene;

use std::borrow::Cow;

use base64::{Engine as _, prelude::BASE64_STANDARD};
use gltf::{
    Document, Glb,
    buffer::Source,
    json::{
        Root, deserialize,
        mesh::Semantic,
        validation::{self, Checked},
    },
};
use grasp_synthesis::base::stop::Stop;
use serde_json::Value;

use crate::{
    MeshLimits,
    error::{ImportError, Violations, check_count},
    parts::quoted,
    raw::{Places, RawMesh},
    text::without_mark,
};
pub(crate) use accessors::Buffers;
use extensions::{COMPRESSIONS, DRACO, can_be_required, may_be_missed, refusal};
pub(crate) use meshes::{SkinnedMesh, each_weight, in_primitive, inverse_binds, skinned_mesh};
pub(crate) use scene::{Scene, walk};

/// Largest number of extensions that warnings name.
const LISTED_EXTENSIONS: usize = 8;

/// Reads the default scene, or the first one; all nodes if there is none.
pub(crate) fn read(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Violations> {
    let opened = open(bytes, limits, stop)?;
    let mut raw = RawMesh::new(Places::Triangles);
    meshes::read_into(&mut raw, &opened, limits)?;
    let unknown = opened
        .document
        .extensions_used()
        .filter(|extension| may_be_missed(extension));
    for extension in unknown.take(LISTED_EXTENSIONS) {
        raw.warnings.push(format!(
            "the file uses the extension {}, which is not read: what it adds to the shape or changes of it is missing",
            quoted(extension)
        ));
    }
    Ok(raw)
}

/// A validated document with the bytes that it refers to.
#[derive(Debug)]
pub(crate) struct Opened<'a> {
    /// Its text.
    pub(crate) json: Cow<'a, [u8]>,
    /// What has a shape.
    pub(crate) document: Document,
    /// Its buffers.
    pub(crate) buffers: Buffers<'a>,
}

/// Opens and validates a document.
pub(crate) fn open<'a>(
    bytes: &'a [u8],
    limits: MeshLimits,
    stop: Stop<'a>,
) -> Result<Opened<'a>, Violations> {
    let (json, binary) = json_and_binary(bytes)?;
    // Each object of the text takes some hundred bytes in memory, however short it is.
    let objects = json.split(|&byte| byte == b'{').count() - 1;
    check_count("JSON objects", objects as u64, limits.triangles)?;
    let mut root: Root = deserialize::from_slice(&json)
        .map_err(|error| ImportError::at("the glTF document", error.to_string()))?;
    let mut refused = Violations::default();
    for extension in root
        .extensions_required
        .iter()
        .filter(|extension| !can_be_required(extension))
    {
        refused.push(refusal(extension));
    }
    refused.into_result()?;
    strip(&mut root);
    stop.check()?;
    let has_draco = root.extensions_used.iter().any(|used| used == DRACO);
    let document = Document::from_json(root).map_err(|error| match error {
        // Without another form, accessors are empty for the compressed data.
        gltf::Error::Validation(errors) if has_draco && errors.iter().all(is_without_view) => {
            refusal(DRACO).into()
        }
        gltf::Error::Validation(errors) => invalid(errors),
        other => ImportError::at("the glTF document", other.to_string()).into(),
    })?;
    let buffers = decode(&document, binary, limits, stop)?;
    Ok(Opened {
        json,
        document,
        buffers,
    })
}

/// Bytes of a file, or decoded.
type Bytes<'a> = Cow<'a, [u8]>;

/// The JSON of a scene, and the binary chunk of a GLB.
fn json_and_binary(bytes: &[u8]) -> Result<(Bytes<'_>, Option<Bytes<'_>>), ImportError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(without_mark(bytes)), None));
    }
    let wrong = |what: String| ImportError::at("the GLB container", what);
    let found = bytes.len();
    // The crate takes for granted that the length covers the header.
    match bytes[4..].as_chunks().0 {
        [[2, 0, 0, 0], length, ..] => {
            let length = u32::from_le_bytes(*length) as usize;
            if length < 20 || length > found {
                let what = format!("claims {length} bytes and has {found}: it is cut off or damaged");
                return Err(wrong(what));
            }
        }
        [[2, 0, 0, 0]] | [] => return Err(wrong("is cut off".to_owned())),
        [version, ..] => {
            let version = u32::from_le_bytes(*version);
            return Err(wrong(format!("has version {version}; it must be 2")));
        }
    }
    let glb = Glb::from_slice(bytes).map_err(|error| wrong(error.to_string()))?;
    Ok((glb.json, glb.bin))
}

/// Drops what has no shape.
fn strip(root: &mut Root) {
    root.extensions_required.clear();
    root.animations.clear();
    root.cameras.clear();
    root.images.clear();
    root.samplers.clear();
    root.textures.clear();
    for material in &mut root.materials {
        let name = material.name.take();
        *material = gltf::json::Material {
            name,
            ..Default::default()
        };
    }
    for node in &mut root.nodes {
        node.camera = None;
    }
    // The crate wants bounds of positions, which exporters leave out and nothing here uses.
    for primitive in root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
        if let Some(accessor) = positions.and_then(|accessor| root.accessors.get_mut(accessor.value())) {
            accessor.min = Some(Value::from(vec![0.0; 3]));
            accessor.max = accessor.min.clone();
        }
    }
}

/// Whether what is wrong with a document is an accessor without data.
fn is_without_view((path, error): &(gltf::json::Path, validation::Error)) -> bool {
    matches!(error, validation::Error::Missing) && path.to_string().ends_with(".bufferView")
}

fn invalid(errors: Vec<(gltf::json::Path, validation::Error)>) -> Violations {
    let mut violations = Violations::default();
    for (path, error) in errors {
        let what = match error {
            validation::Error::IndexOutOfBounds => "refers to something that does not exist",
            validation::Error::Invalid => "has a value that is not allowed",
            validation::Error::Missing => "is missing",
            validation::Error::Unsupported => "is not supported",
            validation::Error::Oversize => "is too large",
        };
        violations.add(path.to_string(), what);
    }
    violations
}

/// The bytes of all buffers.
fn decode<'a>(
    document: &Document,
    mut binary: Option<Bytes<'a>>,
    limits: MeshLimits,
    stop: Stop<'a>,
) -> Result<Buffers<'a>, ImportError> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let wrong = |what: String| ImportError::at(format!("buffers[{}]", buffer.index()), what);
        let bytes = match buffer.source() {
            Source::Bin => binary.take().ok_or_else(|| {
                // Buffers are empty for those that are compressed.
                let is_used =
                    |known: &str| known != DRACO && document.extensions_used().any(|used| used == known);
                match COMPRESSIONS.iter().find(|known| is_used(known)) {
                    Some(compression) => refusal(compression),
                    None => wrong("has no bytes: the GLB has no binary chunk".to_owned()),
                }
            })?,
            Source::Uri(uri) if uri.starts_with("data:") => {
                let (_, encoded) = uri
                    .split_once(";base64,")
                    .ok_or_else(|| wrong("is a data URL without ;base64,".to_owned()))?;
                let decoded = BASE64_STANDARD.decode(encoded.trim_end());
                Cow::Owned(decoded.map_err(|error| wrong(error.to_string()))?)
            }
            Source::Uri(_) => {
                return Err(wrong(
                    "is in another file; embed the buffers, or send a GLB".to_owned(),
                ));
            }
        };
        let (claimed, found) = (buffer.length(), bytes.len());
        if found < claimed {
            return Err(wrong(format!("claims {claimed} bytes and has {found}")));
        }
        buffers.push(bytes);
    }
    Ok(Buffers::new(buffers, limits, stop))
}
