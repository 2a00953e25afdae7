//! The binary format of atlases.
//!
//! A header (magic bytes, format, key, flags and counts), the grips, and the SHA-256 of everything before it.
//! Numbers are big-endian and keep every bit, so decoding restores exactly the atlas that was encoded.
//! Derived values are recomputed instead of stored: yaws and bend ratios from the hand's shape, a contact's
//! third coordinate from its triangle, its normal from triangle and hand.

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
use crate::model::{hand::rig::Rig, object::GraspObject};
use entry_codec::{MIN_ENTRY_BYTES, read_entry, write_entry};
use numbers::{Reader, Writer};

/// The magic bytes that every atlas starts with.
const MARK: [u8; 8] = *b"GRASPATL";

/// Version of the format.
const FORMAT: u16 = 5;

/// Length of the checksum in bytes.
const CHECKSUM_BYTES: usize = 32;

/// Why bytes cannot be decoded as the atlas of an object and a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AtlasError {
    /// The magic bytes are missing.
    #[error("not an atlas")]
    NotAnAtlas,
    /// The format is not the current one.
    #[error("unsupported format {found}; this program reads format {FORMAT}")]
    OtherFormat {
        /// The format in the header.
        found: u16,
    },
    /// The checksum does not match.
    #[error("damaged: the checksum does not match")]
    Damaged,
    /// The key belongs to another object, hand or algorithm.
    #[error("made for another object or hand, or by another version of the algorithm")]
    Stale,
    /// The checksum matches, but a value is invalid.
    #[error("malformed: {0}")]
    Malformed(&'static str),
}

/// Encodes a grown atlas: about 250 bytes per grip.
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

/// The SHA-256 of all encoded grips in order. Growths that differ in any stored value have different
/// fingerprints.
pub fn fingerprint(grown: &Grown, object: &GraspObject, rig: &Rig) -> [u8; CHECKSUM_BYTES] {
    let mut writer = Writer::default();
    for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
        write_entry(&mut writer, entry, shape, object, rig);
    }
    Sha256::digest(writer.into_bytes()).into()
}

/// Decodes a grown atlas of an object and a hand: in a millisecond for some hundred grips.
///
/// # Errors
/// The bytes are not a current atlas of this object and hand; see [`AtlasError`].
pub fn decode(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<Grown, AtlasError> {
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
    if count > ENTRIES || count > reader.remaining() / MIN_ENTRY_BYTES {
        return Err(AtlasError::Malformed(
            "the grip count exceeds what the size allows",
        ));
    }
    let mut entries = Vec::with_capacity(count);
    let mut shapes = Vec::with_capacity(count);
    for _ in 0..count {
        let (entry, shape) = read_entry(&mut reader, object, rig)?;
        entries.push(entry);
        shapes.push(shape);
    }
    if reader.remaining() > 0 {
        return Err(AtlasError::Malformed("unexpected bytes after the last grip"));
    }
    Ok(Grown {
        atlas: Arc::new(Atlas::new(Grips::new(rig, entries), complete)),
        shapes,
        proposed,
        early_stamp,
        original: None,
    })
}
