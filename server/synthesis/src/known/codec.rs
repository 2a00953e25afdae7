//! The binary format of atlases: a header (magic bytes, format, key, flags and counts), the grips, and the SHA-256 of everything
//! before it. Numbers are big-endian and keep every bit. Derived values are recomputed instead of stored: yaws and bend ratios from
//! the hand's shape, a contact's third coordinate from its triangle, its normal from triangle and hand.

mod algorithm;
mod bytes;
mod key;

use std::sync::Arc;

use glam::{Quat, Vec3};
use sha2::{Digest as _, Sha256};

use bytes::{Codec, Reader, Writer};
use key::{KEY_BYTES, key};

use super::{
    atlas::{Atlas, Grips},
    entry::{DIRECTIONS, Entry, FrictionUses, SLIPS},
    finger_subsets::FingerSubsets,
    growth::{ENTRIES, Grown},
};
use crate::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    model::{
        grasp::Contact,
        hand::{Digit, HandPart, HandPose, Phalanx, rig::Rig},
        object::GraspObject,
        score::Term,
    },
    physical::{
        contacts::contact_normal, grip::Grip, immobility::MAX_CONTACTS, shape::HandShape, solids::HandSolids,
    },
    rating::{scoring::posture_values, taxonomy::classify},
};

pub use algorithm::ALGORITHM;
pub use key::file_name;

/// The magic bytes that every atlas starts with.
const MARK: [u8; 8] = *b"GRASPATL";

/// Version of the format.
const FORMAT: u16 = 5;

/// Length of the checksum in bytes.
const CHECKSUM_BYTES: usize = 32;

/// Smallest size of an encoded grip, in bytes: wrist, shape, digits, penetration and epsilon, terms, finger subsets, and empty
/// scores, friction uses and contacts.
const MIN_ENTRY_BYTES: usize = 28 + 25 + 61 + 8 + 4 * WRITTEN_TERMS.len() + 2 + 2 + 1 + 1;

/// Terms of a grip's score that are stored; the others are derived.
const WRITTEN_TERMS: [Term; 3] = [Term::Closure, Term::Steadiness, Term::SterileDistance];

/// Largest deviation of a quaternion's squared length from 1: a thousand times the rounding error.
const QUATERNION_SLACK: f32 = 1e-3;

/// Number of hand parts that can touch: 15 phalanges and the palm.
const PARTS: u64 = 16;

/// The bit after those of the five closing digits.
const TUCKS_BIT: u32 = 5;

/// Flag next to the five bits of the touching digits: yaws and bend ratios cannot be derived from the shape.
const WRITTEN_OUT: u8 = 1 << 5;

/// Marks a coordinate that is stored in full instead of as a difference in units in the last place.
const EXPLICIT: u8 = 0x80;

// Scores are stored as bit planes of 64 bits.
const _: () = assert!(DIRECTIONS == 64);

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
    let mut header = Header {
        key: key(object, rig),
        complete: u8::from(grown.atlas.is_complete()),
        count: (grown.atlas.entries().len() as u32).to_be_bytes(),
        proposed: grown.proposed,
        early_stamp: grown.early_stamp,
    };
    let mut writer = Writer(Vec::from(MARK));
    writer.0.extend(FORMAT.to_be_bytes());
    header.pass(&mut writer).expect(WRITES);
    writer.0.extend(encoded_entries(grown, object, rig));
    let checksum = Sha256::digest(&writer.0);
    writer.0.extend_from_slice(&checksum);
    writer.0
}

/// Why a [`Writer`] returns no error.
const WRITES: &str = "writing cannot fail";

/// The SHA-256 of all encoded grips in order. Growths that differ in any stored value have different fingerprints.
pub fn fingerprint(grown: &Grown, object: &GraspObject, rig: &Rig) -> [u8; CHECKSUM_BYTES] {
    Sha256::digest(encoded_entries(grown, object, rig)).into()
}

fn encoded_entries(grown: &Grown, object: &GraspObject, rig: &Rig) -> Vec<u8> {
    let mut writer = Writer(Vec::new());
    for (entry, shape) in grown.atlas.entries().iter().zip(&grown.shapes) {
        let mut stored = Stored::of(entry, shape);
        stored.pass(&mut writer, object, rig).expect(WRITES);
    }
    writer.0
}

/// Decodes a grown atlas of an object and a hand: in a millisecond for some hundred grips.
///
/// # Errors
/// The bytes are not a current atlas of this object and hand; see [`AtlasError`].
pub fn decode(bytes: &[u8], object: &GraspObject, rig: &Rig) -> Result<Grown, AtlasError> {
    let mut reader = Reader(bytes.strip_prefix(&MARK).ok_or(AtlasError::NotAnAtlas)?);
    let mut found = 0;
    reader.u16(&mut found).map_err(|_| AtlasError::Damaged)?;
    if found != FORMAT {
        return Err(AtlasError::OtherFormat { found });
    }
    let (content, checksum) = bytes
        .split_last_chunk::<CHECKSUM_BYTES>()
        .ok_or(AtlasError::Damaged)?;
    if Sha256::digest(content).as_slice() != checksum {
        return Err(AtlasError::Damaged);
    }
    let mut reader = Reader(content);
    reader.bytes(&mut [0; MARK.len() + size_of::<u16>()])?;
    let mut header = Header::default();
    header.pass(&mut reader)?;
    if header.key != key(object, rig) {
        return Err(AtlasError::Stale);
    }
    reader.ensure(header.complete <= 1, "a flag is neither 0 nor 1")?;
    let count = u32::from_be_bytes(header.count) as usize;
    let is_possible = count <= ENTRIES && count <= reader.0.len() / MIN_ENTRY_BYTES;
    reader.ensure(is_possible, "the grip count exceeds what the size allows")?;
    let mut entries = Vec::with_capacity(count);
    let mut shapes = Vec::with_capacity(count);
    for _ in 0..count {
        let mut stored = Stored::empty();
        stored.pass(&mut reader, object, rig)?;
        let (entry, shape) = stored.entry(object, rig)?;
        entries.push(entry);
        shapes.push(shape);
    }
    reader.ensure(reader.0.is_empty(), "unexpected bytes after the last grip")?;
    Ok(Grown {
        atlas: Arc::new(Atlas::new(Grips::new(rig, entries), header.complete == 1)),
        shapes,
        proposed: header.proposed,
        early_stamp: header.early_stamp,
        original: None,
    })
}

/// The header after the format.
#[derive(Default)]
struct Header {
    key: [u8; KEY_BYTES],
    complete: u8,
    count: [u8; 4],
    proposed: u64,
    early_stamp: u64,
}

impl Header {
    fn pass(&mut self, codec: &mut impl Codec) -> Result<(), AtlasError> {
        codec.bytes(&mut self.key)?;
        codec.u8(&mut self.complete)?;
        codec.bytes(&mut self.count)?;
        codec.u64(&mut self.proposed)?;
        codec.u64(&mut self.early_stamp)
    }
}

struct Stored {
    grip: Grip,
    shape: HandShape,
    terms: [f32; WRITTEN_TERMS.len()],
    scores: [u8; DIRECTIONS],
    friction_uses: [u64; 2],
    finger_subsets: u16,
    contacts: Vec<Contact>,
}

impl Stored {
    fn of(entry: &Entry, shape: &HandShape) -> Self {
        Self {
            grip: entry.grip.clone(),
            shape: *shape,
            terms: WRITTEN_TERMS.map(|term| entry.grip_values[term as usize]),
            scores: entry.scores,
            friction_uses: entry.friction_uses.to_bits(),
            finger_subsets: entry.finger_subsets.to_bits(),
            contacts: entry.contacts.clone(),
        }
    }

    fn empty() -> Self {
        Self {
            grip: Grip {
                pose: HandPose {
                    frame_from_wrist: Pose::IDENTITY,
                    digits: Default::default(),
                },
                bend_ratios: [None; 5],
                penetration: 0.0,
                epsilon: 0.0,
            },
            shape: HandShape {
                thumb_yaw: 0.0,
                spread: 0.0,
                bend_ratios: [0.0; 2],
                closing: [false; 5],
                preshape: [0.0; 2],
                tucks: false,
            },
            terms: Default::default(),
            scores: [SLIPS; DIRECTIONS],
            friction_uses: [0; 2],
            finger_subsets: 0,
            contacts: Vec::new(),
        }
    }

    fn entry(self, object: &GraspObject, rig: &Rig) -> Result<(Entry, HandShape), AtlasError> {
        let Self { grip, contacts, .. } = self;
        let finger_subsets = FingerSubsets::from_bits(self.finger_subsets, grip.holding_digits())
            .ok_or(AtlasError::Malformed("invalid finger subsets"))?;
        let friction_uses = FrictionUses::from_bits(self.friction_uses).ok_or(AtlasError::Malformed(
            "a direction with full friction use is not among those with more than sparing use",
        ))?;
        let classification = classify(rig, &grip.pose, &contacts, &object.local_shape);
        let mut grip_values = posture_values(object, rig, &grip.pose, &contacts, classification);
        for (term, value) in WRITTEN_TERMS.into_iter().zip(self.terms) {
            grip_values[term as usize] = value;
        }
        let entry = Entry {
            grip,
            contacts,
            classification,
            grip_values,
            scores: self.scores,
            friction_uses,
            finger_subsets,
        };
        Ok((entry, self.shape))
    }

    /// Passes all values. Dependent values are derived again.
    fn pass<C: Codec>(&mut self, codec: &mut C, object: &GraspObject, rig: &Rig) -> Result<(), AtlasError> {
        let wrist = &mut self.grip.pose.frame_from_wrist;
        codec.floats(wrist.position.as_mut())?;
        let mut orientation = wrist.orientation.to_array();
        codec.floats(&mut orientation)?;
        wrist.orientation = Quat::from_array(orientation);
        let is_unit = (wrist.orientation.length_squared() - 1.0).abs() <= QUATERNION_SLACK;
        codec.ensure(is_unit, "a quaternion is not a unit quaternion")?;
        pass_shape(codec, &mut self.shape)?;
        self.pass_digits(codec, rig)?;
        codec.floats([&mut self.grip.penetration, &mut self.grip.epsilon])?;
        codec.floats(&mut self.terms)?;
        pass_scores(codec, &mut self.scores)?;
        pass_friction_uses(codec, &mut self.friction_uses)?;
        codec.u16(&mut self.finger_subsets)?;
        let mut count = self.contacts.len() as u8;
        codec.u8(&mut count)?;
        codec.ensure(usize::from(count) <= MAX_CONTACTS, "a grip has too many contacts")?;
        let unread = Contact {
            position: Vec3::ZERO,
            normal: Vec3::ZERO,
            triangle: 0,
            part: HandPart::Palm,
        };
        self.contacts.resize(usize::from(count), unread);
        let solids = HandSolids::of_pose(rig, &self.grip.pose);
        for contact in &mut self.contacts {
            pass_contact(codec, contact, object.surface.mesh(), &solids)?;
        }
        Ok(())
    }

    /// Yaws and bend ratios are those of the shape, unless a flag says that they are written out.
    fn pass_digits<C: Codec>(&mut self, codec: &mut C, rig: &Rig) -> Result<(), AtlasError> {
        let Grip {
            pose, bend_ratios, ..
        } = &mut self.grip;
        let flexing = Digit::ALL.map(|digit| self.shape.flexing(rig, digit));
        let is_derived = (0..5).all(|digit| {
            let of_shape = &flexing[digit];
            pose.digits[digit].base_yaw.to_bits() == of_shape.base_yaw.to_bits()
                && bend_ratios[digit].is_none_or(|own| own.to_bits() == of_shape.bend_ratio.to_bits())
        });
        let mut flags = bits_of(bend_ratios.map(|ratio| ratio.is_some()));
        flags |= if is_derived { 0 } else { WRITTEN_OUT };
        codec.u8(&mut flags)?;
        for (digit, of_shape) in flexing.into_iter().enumerate() {
            let angles = &mut pose.digits[digit];
            let mut ratio = bend_ratios[digit].unwrap_or_default();
            if flags & WRITTEN_OUT == 0 {
                (angles.base_yaw, ratio) = (of_shape.base_yaw, of_shape.bend_ratio);
            } else {
                codec.floats([&mut angles.base_yaw, &mut ratio])?;
            }
            codec.floats([
                &mut angles.base_pitch,
                &mut angles.second_pitch,
                &mut angles.third_pitch,
            ])?;
            bend_ratios[digit] = (flags >> digit & 1 == 1).then_some(ratio);
        }
        Ok(())
    }
}

fn bits_of(digits: [bool; 5]) -> u8 {
    (0..5).map(|digit| u8::from(digits[digit]) << digit).sum()
}

fn pass_shape(codec: &mut impl Codec, shape: &mut HandShape) -> Result<(), AtlasError> {
    let mut bits = bits_of(shape.closing) | u8::from(shape.tucks) << TUCKS_BIT;
    codec.u8(&mut bits)?;
    shape.closing = std::array::from_fn(|digit| bits >> digit & 1 == 1);
    shape.tucks = bits >> TUCKS_BIT & 1 == 1;
    codec.floats([&mut shape.thumb_yaw, &mut shape.spread])?;
    codec.floats(&mut shape.bend_ratios)?;
    codec.floats(&mut shape.preshape)
}

/// A grip's scores differ only in comfort, which needs less than six bits.
fn pass_scores(codec: &mut impl Codec, scores: &mut [u8; DIRECTIONS]) -> Result<(), AtlasError> {
    let holding = scores.iter().filter(|score| **score != SLIPS);
    let mut lowest = holding.min().copied().unwrap_or(1);
    let mut above = scores.map(|score| if score == SLIPS { 0 } else { score - lowest + 1 });
    let highest = above.iter().max().copied().unwrap_or(0);
    let mut planes = (u8::BITS - highest.leading_zeros()) as u8;
    codec.u8(&mut lowest)?;
    codec.u8(&mut planes)?;
    codec.ensure(lowest != SLIPS && planes <= 8, "scores are out of range")?;
    for plane in 0..planes {
        let bits = (0..).zip(&above);
        let mut bits = bits.fold(0, |bits, (place, score)| {
            bits | u64::from(score >> plane & 1) << place
        });
        codec.u64(&mut bits)?;
        for (place, score) in above.iter_mut().enumerate() {
            *score |= ((bits >> place & 1) as u8) << plane;
        }
    }
    for (score, above) in scores.iter_mut().zip(above).filter(|(_, above)| *above > 0) {
        *score = (lowest - 1)
            .checked_add(above)
            .ok_or(AtlasError::Malformed("scores are out of range"))?;
    }
    Ok(())
}

/// Many grips need little friction in every direction, and few need all of it: trailing empty planes are omitted.
fn pass_friction_uses(codec: &mut impl Codec, planes: &mut [u64; 2]) -> Result<(), AtlasError> {
    let last = planes.iter().rposition(|bits| *bits != 0);
    let mut count = last.map_or(0, |last| last as u8 + 1);
    codec.u8(&mut count)?;
    let is_in_range = usize::from(count) <= planes.len();
    codec.ensure(is_in_range, "the number of friction-use planes is out of range")?;
    for bits in &mut planes[..usize::from(count)] {
        codec.u64(bits)?;
    }
    Ok(())
}

/// The coordinate along the axis that the triangle faces most is mostly some units in the last place off its plane.
fn pass_contact(
    codec: &mut impl Codec,
    contact: &mut Contact,
    mesh: &TriangleMesh,
    solids: &HandSolids,
) -> Result<(), AtlasError> {
    let part = match contact.part {
        HandPart::Phalanx(digit, phalanx) => 3 * digit.index() + phalanx.index(),
        HandPart::Palm => 15,
    };
    let mut code = u64::from(contact.triangle) * PARTS + part as u64;
    codec.varint(&mut code)?;
    contact.triangle = u32::try_from(code / PARTS)
        .ok()
        .filter(|&triangle| (triangle as usize) < mesh.triangles().len())
        .ok_or(AtlasError::Malformed("a contact refers to a missing triangle"))?;
    contact.part = match (code % PARTS) as usize {
        15 => HandPart::Palm,
        link => HandPart::Phalanx(Digit::ALL[link / 3], Phalanx::ALL[link % 3]),
    };
    let normal = mesh.normal(contact.triangle as usize);
    let axis = normal.abs().max_position();
    let others = [(axis + 1) % 3, (axis + 2) % 3];
    let position = &mut contact.position;
    for other in others {
        codec.floats([&mut position[other]])?;
    }
    let on_plane = ordered(coordinate_on_plane(mesh, contact.triangle, axis, *position));
    let ulps = i64::from(ordered(position[axis])) - i64::from(on_plane);
    let mut difference = i8::try_from(ulps).map_or(EXPLICIT, i8::cast_unsigned);
    codec.u8(&mut difference)?;
    if difference == EXPLICIT {
        codec.floats([&mut position[axis]])?;
    } else {
        position[axis] = from_ordered(on_plane.wrapping_add_signed(i32::from(difference.cast_signed())));
    }
    codec.ensure(position.is_finite(), "a contact is not finite")?;
    contact.normal = contact_normal(solids, contact.part, *position, normal);
    Ok(())
}

/// The coordinate along an axis of the point in the triangle's plane with the other two coordinates of `position`.
fn coordinate_on_plane(mesh: &TriangleMesh, triangle: u32, axis: usize, position: Vec3) -> f32 {
    let [first, second] = [(axis + 1) % 3, (axis + 2) % 3];
    let [a, b, c] = mesh.corners(triangle as usize).map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    let offset = position.as_dvec3() - a;
    let along = (normal[first] * offset[first] + normal[second] * offset[second]) / normal[axis];
    (a[axis] - along) as f32
}

/// Maps floats to integers in ascending order: neighbouring floats differ by one.
fn ordered(number: f32) -> u32 {
    let bits = number.to_bits();
    if number.is_sign_negative() {
        !bits
    } else {
        bits | 1 << 31
    }
}

fn from_ordered(number: u32) -> f32 {
    f32::from_bits(if number >> 31 == 1 {
        number & !(1 << 31)
    } else {
        !number
    })
}
