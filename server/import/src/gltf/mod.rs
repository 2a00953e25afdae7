//! Reads glTF 2.0 (JSON with its buffers inside, or GLB) with the crate `gltf`: the default scene as a viewer shows it before
//! anything moves, with skins and morph targets at rest.
//!
//! The crate parses and validates the document. Accessors are read by [`accessors`], because the crate's own iterators trust
//! lengths. What has no shape (materials, textures, animations, cameras) is dropped before validation, so that unusual ones
//! do not keep a mesh from being read.

mod accessors;
mod drawn;
mod extensions;
mod instances;
mod nodes;
mod primitives;
mod skinning;

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
    error::ImportError,
    format::without_mark,
    limits::MeshLimits,
    parts::quoted,
    raw::{Places, RawMesh},
    stoppable::stopped,
};
pub(crate) use accessors::Buffers;
use extensions::{COMPRESSIONS, DRACO, can_be_required, may_be_missed, refusal};
pub(crate) use nodes::{Scene, walk};
pub(crate) use primitives::in_primitive;
pub(crate) use skinning::{SkinnedMesh, skinned_mesh};

/// Largest number of validation errors that are listed.
const LISTED_ERRORS: usize = 16;

/// Largest number of extensions that warnings name.
const LISTED_EXTENSIONS: usize = 8;

/// Reads the default scene, or the first one; all nodes if there is none.
pub(crate) fn read(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Vec<ImportError>> {
    let opened = open(bytes, limits, stop)?;
    let mut raw = RawMesh {
        places: Places::Triangles,
        ..RawMesh::default()
    };
    primitives::read_into(&mut raw, &opened, limits).map_err(|error| vec![error])?;
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
) -> Result<Opened<'a>, Vec<ImportError>> {
    let Parts { json, binary } = parts(bytes).map_err(|error| vec![error])?;
    // Each object of the text takes some hundred bytes in memory, however short it is.
    let objects = json.split(|&byte| byte == b'{').count() - 1;
    if objects > limits.triangles {
        return Err(vec![ImportError::TooMany {
            what: "JSON objects",
            found: objects as u64,
            limit: limits.triangles,
        }]);
    }
    let mut root: Root = deserialize::from_slice(&json)
        .map_err(|error| vec![ImportError::at("the glTF document", error.to_string())])?;
    let refused: Vec<ImportError> = root
        .extensions_required
        .iter()
        .filter(|extension| !can_be_required(extension))
        .take(LISTED_ERRORS)
        .map(|extension| refusal(extension))
        .collect();
    if !refused.is_empty() {
        return Err(refused);
    }
    strip(&mut root);
    stop.check().map_err(stopped)?;
    let has_draco = root.extensions_used.iter().any(|used| used == DRACO);
    let document = Document::from_json(root).map_err(|error| match &error {
        // Without another form, accessors stand empty for the compressed data.
        gltf::Error::Validation(errors) if has_draco && errors.iter().all(is_without_view) => {
            vec![refusal(DRACO)]
        }
        other => invalid(other),
    })?;
    let buffers = decode(&document, binary, limits, stop).map_err(|error| vec![error])?;
    Ok(Opened {
        json,
        document,
        buffers,
    })
}

/// The JSON of a scene, and the binary chunk of a GLB.
struct Parts<'a> {
    json: Cow<'a, [u8]>,
    binary: Option<Cow<'a, [u8]>>,
}

fn parts(bytes: &[u8]) -> Result<Parts<'_>, ImportError> {
    if !bytes.starts_with(b"glTF") {
        return Ok(Parts {
            json: Cow::Borrowed(without_mark(bytes)),
            binary: None,
        });
    }
    let wrong = |what: String| ImportError::at("the GLB container", what);
    let number = |at: usize| {
        let four = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes(four.try_into().ok()?))
    };
    // The crate takes for granted that the length covers the header.
    match (number(4), number(8)) {
        (Some(2), Some(length)) if length >= 20 && length as usize <= bytes.len() => {}
        (Some(2), Some(length)) => {
            let found = bytes.len();
            return Err(wrong(format!(
                "claims {length} bytes and has {found}: it is cut off or damaged"
            )));
        }
        (Some(version), _) => return Err(wrong(format!("has version {version}; it must be 2"))),
        (None, _) => return Err(wrong("is cut off".to_owned())),
    }
    let glb = Glb::from_slice(bytes).map_err(|error| wrong(error.to_string()))?;
    Ok(Parts {
        json: glb.json,
        binary: glb.bin,
    })
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

fn invalid(error: &gltf::Error) -> Vec<ImportError> {
    match error {
        gltf::Error::Validation(errors) => errors
            .iter()
            .take(LISTED_ERRORS)
            .map(|(path, error)| {
                let what = match error {
                    validation::Error::IndexOutOfBounds => "refers to something that does not exist",
                    validation::Error::Invalid => "has a value that is not allowed",
                    validation::Error::Missing => "is missing",
                    validation::Error::Unsupported => "is not supported",
                    validation::Error::Oversize => "is too large",
                };
                ImportError::at(path.to_string(), what)
            })
            .collect(),
        other => vec![ImportError::at("the glTF document", other.to_string())],
    }
}

/// The bytes of all buffers.
fn decode<'a>(
    document: &Document,
    binary: Option<Cow<'a, [u8]>>,
    limits: MeshLimits,
    stop: Stop<'a>,
) -> Result<Buffers<'a>, ImportError> {
    let mut binary = binary;
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let place = format!("buffers[{}]", buffer.index());
        let bytes = match buffer.source() {
            Source::Bin => binary.take().ok_or_else(|| {
                let compression = COMPRESSIONS.iter().filter(|&&known| known != DRACO);
                let mut used =
                    compression.filter(|known| document.extensions_used().any(|used| used == **known));
                // Buffers stand empty for those that are compressed.
                used.next().map_or_else(
                    || ImportError::at(place.clone(), "has no bytes: the GLB has no binary chunk"),
                    |compression| refusal(compression),
                )
            })?,
            Source::Uri(uri) if uri.starts_with("data:") => {
                let (_, encoded) = uri
                    .split_once(";base64,")
                    .ok_or_else(|| ImportError::at(place.clone(), "is a data URL without ;base64,"))?;
                let decoded = BASE64_STANDARD.decode(encoded.trim_end());
                Cow::Owned(decoded.map_err(|error| ImportError::at(place.clone(), error.to_string()))?)
            }
            Source::Uri(_) => {
                return Err(ImportError::at(
                    place,
                    "is in another file; embed the buffers, or send a GLB",
                ));
            }
        };
        if bytes.len() < buffer.length() {
            let (claimed, found) = (buffer.length(), bytes.len());
            return Err(ImportError::at(
                place,
                format!("claims {claimed} bytes and has {found}"),
            ));
        }
        buffers.push(bytes);
    }
    Ok(Buffers::new(buffers, limits, stop))
}
