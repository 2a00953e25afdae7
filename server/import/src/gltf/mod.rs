//! Reads glTF 2.0 (JSON with its buffers inside, or GLB) with the crate `gltf`: the default scene as a viewer shows it before
//! anything moves, with skins and morph targets at rest.
//!
//! The crate parses and validates the document. Accessors are read by [`Buffers`], because the crate's own iterators trust
//! lengths. Data without shape (materials, textures, animations, cameras) are dropped before validation, so that unusual ones
//! do not keep a mesh from being read.

mod meshes;
mod scene;

use std::{borrow::Cow, cell::Cell};

use base64::{Engine as _, prelude::BASE64_STANDARD};
use gltf::{
    Accessor, Document, Glb,
    accessor::{DataType, sparse::IndexType},
    buffer::{Source, View},
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
pub(crate) use meshes::{SkinnedMesh, each_weight, in_primitive, inverse_binds, skinned_mesh};
use scene::{COMPRESSIONS, DRACO, can_be_required, may_be_missed, refusal};
pub(crate) use scene::{Scene, walk};

/// Most JSON objects of a document: each takes some hundred bytes in memory, however short it is.
const MAX_JSON_OBJECTS: usize = 1 << 16;

/// Largest number of extensions that warnings name.
const LISTED_EXTENSIONS: usize = 8;

/// Reads the default scene, or the first one; all nodes if there is none.
pub(crate) fn read(bytes: &[u8], limits: MeshLimits, stop: Stop<'_>) -> Result<RawMesh, Violations> {
    let opened = open(bytes, limits, stop)?;
    let mut raw = RawMesh::new("the glTF scene", Places::Triangles);
    meshes::read_into(&mut raw, &opened)?;
    let used = opened.document.extensions_used();
    for extension in used.filter(|used| may_be_missed(used)).take(LISTED_EXTENSIONS) {
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
    /// Its content with a shape.
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
    let objects = json.split(|&byte| byte == b'{').count() - 1;
    check_count(
        "the glTF document",
        "JSON objects",
        objects as u64,
        limits.triangles.min(MAX_JSON_OBJECTS),
    )?;
    let mut root: Root = deserialize::from_slice(&json)
        .map_err(|error| ImportError::at("the glTF document", error.to_string()))?;
    let mut refused = Violations::default();
    let required = root.extensions_required.iter();
    required
        .filter(|extension| !can_be_required(extension))
        .for_each(|extension| refused.push(refusal(extension)));
    refused.into_result()?;
    strip(&mut root);
    check_positions(&root)?;
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

/// Checks that the positions of each mesh are there, which the crate takes for granted when it validates them.
fn check_positions(root: &Root) -> Result<(), ImportError> {
    let count = root.accessors.len();
    for (number, mesh) in root.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let positions = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if let Some(positions) = positions.filter(|positions| positions.value() >= count) {
                return Err(ImportError::at(
                    format!("meshes[{number}]"),
                    format!(
                        "has positions in accessor {}; there are {count} accessors",
                        positions.value()
                    ),
                ));
            }
        }
    }
    Ok(())
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

/// Drops everything without a shape.
fn strip(root: &mut Root) {
    root.extensions_required.clear();
    root.animations.clear();
    root.cameras.clear();
    root.images.clear();
    root.samplers.clear();
    root.textures.clear();
    for material in &mut root.materials {
        *material = gltf::json::Material {
            name: material.name.take(),
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
                let what = "is in another file; embed the buffers, or send a GLB";
                return Err(wrong(what.to_owned()));
            }
        };
        let (claimed, found) = (buffer.length(), bytes.len());
        if found < claimed {
            return Err(wrong(format!("claims {claimed} bytes and has {found}")));
        }
        buffers.push(bytes);
    }
    let largest = limits.vertices as u64 + 3 * limits.triangles as u64;
    Ok(Buffers {
        contents: buffers,
        limits,
        left: Cell::new(READS.saturating_mul(largest)),
        stop,
    })
}

/// How often, on average, each vertex and index of the largest mesh may be read: for morph targets, joints and weights.
const READS: u64 = 16;

/// The bytes of a document's buffers.
#[derive(Debug)]
pub(crate) struct Buffers<'a> {
    contents: Vec<Bytes<'a>>,
    pub(crate) limits: MeshLimits,
    /// Elements that may still be read: scenes can ask for the same ones again and again.
    left: Cell<u64>,
    stop: Stop<'a>,
}

impl<'a> Buffers<'a> {
    /// Counts elements that are about to be read, and ends reading if it should.
    pub(crate) fn spend(&self, elements: u64) -> Result<(), ImportError> {
        self.stop.check()?;
        let left = self.left.get().checked_sub(elements.saturating_add(1));
        let what = "repeats its meshes, joints or morph targets too often to be read";
        self.left
            .set(left.ok_or_else(|| ImportError::at("the scene", what))?);
        Ok(())
    }

    /// The first `count` elements of an accessor of `N` components, each converted from numbers; integers that stand for fractions
    /// become those. Memory grows with `count`, not with what the accessor claims.
    pub(crate) fn read<const N: usize, T: Clone>(
        &self,
        accessor: &Accessor<'_>,
        count: usize,
        convert: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>, ImportError> {
        let wrong = |what: String| ImportError::at(format!("accessors[{}]", accessor.index()), what);
        let components = accessor.dimensions().multiplicity();
        if components != N {
            return Err(wrong(format!("has {components} components; {N} are needed")));
        }
        if accessor.count() < count {
            let found = accessor.count();
            return Err(wrong(format!("has {found} elements; {count} are needed")));
        }
        self.spend(count as u64)?;
        let kind = accessor.data_type();
        let size = kind.size() * N;
        let scale = scale_of(accessor);
        let read = |element: &[u8], kind| {
            let element = components_of(element, kind);
            // The smallest signed integer stands for −1 as well.
            convert(scale.map_or(element, |scale| element.map(|number| (number / scale).max(-1.0))))
        };
        let mut numbers: Vec<T> = match accessor.view() {
            Some(view) => {
                let stride = view.stride().unwrap_or(size);
                self.elements(&view, accessor.offset(), stride, size, count)
                    .ok_or_else(|| wrong(beyond(count)))?
                    .map(|element| read(element, kind))
                    .collect()
            }
            None => vec![convert([0.0; N]); count],
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let changed = sparse.count();
            self.spend(changed as u64)?;
            let index_kind = match indices.index_type() {
                IndexType::U8 => DataType::U8,
                IndexType::U16 => DataType::U16,
                IndexType::U32 => DataType::U32,
            };
            let width = index_kind.size();
            let places = self.elements(&indices.view(), indices.offset(), width, width, changed);
            let replaced = self.elements(&values.view(), values.offset(), size, size, changed);
            let (Some(places), Some(replaced)) = (places, replaced) else {
                return Err(wrong(beyond(changed)));
            };
            for (place, element) in places.zip(replaced) {
                let [place] = components_of::<1>(place, index_kind).map(|place| place as usize);
                if place >= accessor.count() {
                    return Err(wrong(format!("replaces element {place}, which does not exist")));
                }
                if let Some(number) = numbers.get_mut(place) {
                    *number = read(element, kind);
                }
            }
        }
        Ok(numbers)
    }

    /// The bytes of `count` elements, if all are within their view and its buffer.
    fn elements(
        &self,
        view: &View<'_>,
        offset: usize,
        stride: usize,
        size: usize,
        count: usize,
    ) -> Option<impl Iterator<Item = &[u8]> + use<'_, 'a>> {
        let buffer = self.contents.get(view.buffer().index())?;
        let end = view.offset().checked_add(view.length())?;
        let bytes = buffer.get(view.offset()..end)?;
        let last = count.checked_sub(1)?.checked_mul(stride)?.checked_add(offset)?;
        if last.checked_add(size)? > bytes.len() || stride < size {
            return None;
        }
        Some((0..count).map(move |element| &bytes[offset + element * stride..][..size]))
    }
}

/// Divisor of the integers of an accessor; `None` if they are not normalized.
fn scale_of(accessor: &Accessor<'_>) -> Option<f64> {
    let scale = match accessor.data_type() {
        DataType::I8 => 127.0,
        DataType::U8 => 255.0,
        DataType::I16 => 32767.0,
        DataType::U16 => 65535.0,
        DataType::U32 | DataType::F32 => return None,
    };
    accessor.normalized().then_some(scale)
}

fn beyond(count: usize) -> String {
    format!("has {count} elements, which reach beyond its buffer")
}

/// The little-endian numbers of one element.
fn components_of<const N: usize>(element: &[u8], kind: DataType) -> [f64; N] {
    let width = kind.size();
    std::array::from_fn(|component| {
        let bytes = &element[component * width..][..width];
        match (kind, bytes) {
            (DataType::I8, &[a]) => f64::from(i8::from_le_bytes([a])),
            (DataType::U8, &[a]) => f64::from(a),
            (DataType::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
            (DataType::U16, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
            (DataType::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
            (DataType::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => f64::NAN,
        }
    })
}
