//! The binary format of atlases.
//!
//! A header (magic bytes, format, key, flags and counts), the grips, and the SHA-256 of everything before it. Numbers are
//! big-endian and keep every bit, so decoding restores exactly the atlas that was encoded. Derived values are recomputed instead
//! of stored: yaws and bend ratios from the hand's shape, a contact's third coordinate from its triangle, its normal from
//! triangle and hand.

mod algorithm;
mod entry_codec;

use std::{fmt::Write as _, sync::Arc};

use entry_codec::{MIN_ENTRY_BYTES, read_entry, write_entry};
use sha2::{Digest as _, Sha256};

use super::{
    atlas::{Atlas, Grips},
    growth::{ENTRIES, Grown},
};
use crate::model::{hand::rig::Rig, object::GraspObject, plain_object::PlainObject, strategy::Validity};

pub use algorithm::ALGORITHM;

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
    let mut bytes = Vec::from(MARK);
    bytes.extend(FORMAT.to_be_bytes());
    bytes.extend(key(object, rig));
    bytes.push(u8::from(grown.atlas.is_complete()));
    bytes.extend((grown.atlas.entries().len() as u32).to_be_bytes());
    bytes.extend(grown.proposed.to_be_bytes());
    bytes.extend(grown.early_stamp.to_be_bytes());
    bytes.extend(encoded_entries(grown, object, rig));
    let checksum = Sha256::digest(&bytes);
    bytes.extend_from_slice(&checksum);
    bytes
}

/// The SHA-256 of all encoded grips in order. Growths that differ in any stored value have different fingerprints.
pub fn fingerprint(grown: &Grown, object: &GraspObject, rig: &Rig) -> [u8; CHECKSUM_BYTES] {
    Sha256::digest(encoded_entries(grown, object, rig)).into()
}

fn encoded_entries(grown: &Grown, object: &GraspObject, rig: &Rig) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
        write_entry(&mut bytes, entry, shape, object, rig);
    }
    bytes
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

/// Appends numbers.
fn write_floats(bytes: &mut Vec<u8>, numbers: &[f32]) {
    bytes.extend(numbers.iter().flat_map(|number| number.to_be_bytes()));
}

/// Appends a variable-length number: seven bits per byte, lowest first.
fn write_varint(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Reads numbers from the front.
#[derive(Debug)]
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// The number of bytes left.
    pub(super) fn remaining(&self) -> usize {
        self.0.len()
    }

    pub(super) fn skip(&mut self, count: usize) -> Result<(), AtlasError> {
        self.0 = self
            .0
            .get(count..)
            .ok_or(AtlasError::Malformed("unexpected end"))?;
        Ok(())
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], AtlasError> {
        let (array, rest) = self
            .0
            .split_first_chunk()
            .ok_or(AtlasError::Malformed("unexpected end"))?;
        self.0 = rest;
        Ok(*array)
    }

    pub(super) fn u8(&mut self) -> Result<u8, AtlasError> {
        self.array().map(u8::from_be_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, AtlasError> {
        self.array().map(u16::from_be_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, AtlasError> {
        self.array().map(u32::from_be_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, AtlasError> {
        self.array().map(u64::from_be_bytes)
    }

    /// A finite number.
    pub(super) fn float(&mut self) -> Result<f32, AtlasError> {
        let number = f32::from_bits(self.u32()?);
        if number.is_finite() {
            Ok(number)
        } else {
            Err(AtlasError::Malformed("a number is not finite"))
        }
    }

    pub(super) fn floats<const N: usize>(&mut self) -> Result<[f32; N], AtlasError> {
        let mut floats = [0.0; N];
        for float in &mut floats {
            *float = self.float()?;
        }
        Ok(floats)
    }

    pub(super) fn varint(&mut self) -> Result<u64, AtlasError> {
        let mut number = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.u8()?;
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(AtlasError::Malformed("a number has too many bytes"))
    }
}

/// Length of a key in bytes.
pub const KEY_BYTES: usize = 32;

/// Bytes of the key used in a file name: 128 bits do not collide by chance.
const FILE_NAME_BYTES: usize = 16;

/// The SHA-256 of everything that the grips of an object and a hand depend on.
pub fn key(object: &PlainObject, rig: &Rig) -> [u8; KEY_BYTES] {
    let mut hash = Hash(Sha256::new());
    hash.0.update(ALGORITHM.to_le_bytes());
    hash.object(object);
    hash.0.update(rig.content());
    hash.0.finalize().into()
}

/// The file name of the atlas of an object and a hand: hexadecimal digits of the key and ".atlas".
pub fn file_name(object: &PlainObject, rig: &Rig) -> String {
    let mut name = String::with_capacity(2 * FILE_NAME_BYTES + 6);
    for byte in &key(object, rig)[..FILE_NAME_BYTES] {
        // Writing to a string cannot fail.
        let _ = write!(name, "{byte:02x}");
    }
    name + ".atlas"
}

/// Hashes numbers, little-endian.
struct Hash(Sha256);

impl Hash {
    fn count(&mut self, count: u32) {
        self.0.update(count.to_le_bytes());
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = f32>) {
        for number in numbers {
            self.0.update(number.to_le_bytes());
        }
    }

    fn object(&mut self, object: &PlainObject) {
        let mesh = &object.mesh;
        self.count(mesh.positions().len() as u32);
        self.count(mesh.triangles().len() as u32);
        for position in mesh.positions() {
            self.numbers(position.to_array());
        }
        for (triangle, corners) in mesh.triangles().iter().enumerate() {
            for &corner in corners {
                self.count(corner);
            }
            self.0.update([u8::from(object.is_forbidden(triangle as u32))]);
        }
        self.numbers([object.mass, object.friction_under(Validity::Physical)]);
        self.numbers(object.centre_of_mass.to_array());
        // Others guide the choice of grips only.
        if object.regions().require_contacts() {
            self.numbers(object.regions().numbers());
        }
    }
}
