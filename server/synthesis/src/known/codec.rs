//! Atlases as bytes.
//!
//! A header (a mark, the format, the key, flags and counts), the grips, and the SHA-256 of all before. Numbers are
//! big-endian, and every one is kept bit by bit, so that an atlas that was read is the one that was written. What
//! follows from other numbers is not written but computed: yaws and bend ratios from the hand's shape, a contact's
//! third coordinate from its triangle, the normal from that and the hand.

mod entry_codec;
mod numbers;

use std::sync::Arc;

use sha2::{Digest as _, Sha256};

use super::{
    atlas::Atlas,
    grips::Grips,
    growth::{ENTRIES, Grown},
    key::{KEY_BYTES, key},
};
use crate::{
    model::{hand::rig::Rig, object::GraspObject},
    physical::shape::HandShape,
};
use entry_codec::{LEAST_ENTRY_BYTES, read_entry, write_entry};
use numbers::{Reader, Writer};

/// What the bytes of every atlas start with.
const MARK: [u8; 8] = *b"GRASPATL";

/// Counts the formats.
const FORMAT: u16 = 5;

/// Bytes of the checksum.
const CHECKSUM_BYTES: usize = 32;

/// Why bytes are not the atlas of an object and a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AtlasError {
    /// They do not start like an atlas.
    #[error("it is not an atlas")]
    NotAnAtlas,
    /// They are in another format.
    #[error("it has format {found}; this program reads format {FORMAT}")]
    OtherFormat {
        /// The format that they say.
        found: u16,
    },
    /// The checksum differs: they were changed or cut.
    #[error("it is damaged: its checksum differs")]
    Damaged,
    /// They belong to another object or hand, or were made by another algorithm.
    #[error("it was made for another object or hand, or by another version")]
    Stale,
    /// The checksum is right, but they do not make sense.
    #[error("it makes no sense: {0}")]
    Malformed(&'static str),
}

/// The bytes of what has grown for an object and a hand: some 250 a grip.
pub fn encode(grown: &Grown, object: &GraspObject, rig: &Rig) -> Vec<u8> {
    let entries = grown.atlas.entries();
    let mut writer = Writer::default();
    writer.bytes(&MARK);
    writer.u16(FORMAT);
    writer.bytes(&key(object, rig));
    writer.u8(u8::from(grown.atlas.is_complete()));
    writer.u32(entries.len() as u32);
    writer.u64(grown.proposed);
    writer.u64(grown.early_stamp);
    for (entry, shape) in entries.iter().zip(&grown.shapes) {
        write_entry(&mut writer, entry, shape, object, rig);
    }
    let mut bytes = writer.into_bytes();
    let checksum = Sha256::digest(&bytes);
    bytes.extend_from_slice(&checksum);
    bytes
}

/// The SHA-256 of everything that is kept of the grips, in their order: growth that differs in anything has another.
pub fn fingerprint(grown: &Grown, object: &GraspObject, rig: &Rig) -> [u8; CHECKSUM_BYTES] {
    let mut writer = Writer::default();
    for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
        write_entry(&mut writer, entry, shape, object, rig);
    }
    Sha256::digest(writer.into_bytes()).into()
}

/// What has grown for an object and a hand.
///
/// # Errors
/// The bytes are anything else; see [`AtlasError`].
pub fn decode(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<Grown, AtlasError> {
    let Content {
        grips,
        shapes,
        complete,
        proposed,
        early_stamp,
    } = read(bytes, object, rig)?;
    Ok(Grown {
        atlas: Arc::new(Atlas::new(object, rig, grips, complete)),
        shapes,
        proposed,
        early_stamp,
    })
}

/// The grips alone of what has grown for an object and a hand: without the lists of an atlas, which take most of the time.
///
/// # Errors
/// The bytes are anything else; see [`AtlasError`].
pub fn decode_grips(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<Grips, AtlasError> {
    Ok(read(bytes, object, rig)?.grips)
}

/// What the bytes say.
struct Content {
    grips: Grips,
    shapes: Vec<HandShape>,
    complete: bool,
    proposed: u64,
    early_stamp: u64,
}

fn read(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<Content, AtlasError> {
    let mut reader = Reader::new(bytes);
    if reader.array() != Ok(MARK) {
        return Err(AtlasError::NotAnAtlas);
    }
    let found = reader.u16().map_err(|_| AtlasError::Damaged)?;
    if found != FORMAT {
        return Err(AtlasError::OtherFormat { found });
    }
    let (content, checksum) = bytes
        .split_last_chunk::<CHECKSUM_BYTES>()
        .ok_or(AtlasError::Damaged)?;
    if Sha256::digest(content).as_slice() != checksum {
        return Err(AtlasError::Damaged);
    }
    let mut reader = Reader::new(content);
    reader.skip(MARK.len() + size_of_val(&FORMAT))?;
    if reader.array::<KEY_BYTES>()? != key(object, rig) {
        return Err(AtlasError::Stale);
    }
    let complete = match reader.u8()? {
        0 => false,
        1 => true,
        _ => return Err(AtlasError::Malformed("a flag is neither 0 nor 1")),
    };
    let count = reader.u32()? as usize;
    let proposed = reader.u64()?;
    let early_stamp = reader.u64()?;
    if count > ENTRIES || count > reader.left() / LEAST_ENTRY_BYTES {
        return Err(AtlasError::Malformed("it cannot have as many grips as it says"));
    }
    let mut entries = Vec::with_capacity(count);
    let mut shapes = Vec::with_capacity(count);
    for _ in 0..count {
        let (entry, shape) = read_entry(&mut reader, object, rig)?;
        entries.push(entry);
        shapes.push(shape);
    }
    if reader.left() > 0 {
        return Err(AtlasError::Malformed("something follows the last grip"));
    }
    Ok(Content {
        grips: Grips::new(rig, entries),
        shapes,
        complete,
        proposed,
        early_stamp,
    })
}
