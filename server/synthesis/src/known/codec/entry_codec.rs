//! The binary format of one grip and the shape that its hand was closed from.

use glam::{Quat, Vec3};

use super::{AtlasError, Reader, write_floats, write_varint};
use crate::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    known::{
        entry::{DIRECTIONS, Entry, FrictionUses, SLIPS},
        finger_subsets::FingerSubsets,
    },
    model::{
        grasp::Contact,
        hand::{Digit, DigitAngles, HandPart, HandPose, Phalanx, rig::Rig},
        object::GraspObject,
        score::Term,
    },
    physical::{
        contacts::contact_normal, grip::Grip, immobility::MAX_CONTACTS, shape::HandShape, solids::HandSolids,
    },
    rating::{scoring::posture_values, taxonomy::classify},
};

/// Smallest size of an encoded grip, in bytes: wrist, shape, digits, penetration and epsilon, terms, finger subsets, and empty
/// scores, friction uses and contacts.
pub(super) const MIN_ENTRY_BYTES: usize = 28 + 25 + 61 + 8 + 4 * WRITTEN_TERMS.len() + 2 + 2 + 1 + 1;

/// Terms of a grip's score that are stored; the others are derived.
const WRITTEN_TERMS: [Term; 3] = [Term::Closure, Term::Steadiness, Term::SterileDistance];

/// Largest deviation of a quaternion's squared length from 1: a thousand times what rounding causes.
const QUATERNION_SLACK: f32 = 1e-3;

/// Number of hand parts that can touch: 15 phalanges and the palm.
const PARTS: u64 = 16;

/// Flag next to the five bits of the touching digits: yaws and bend ratios are stored, because they cannot be derived from the
/// shape.
const WRITTEN_OUT: u8 = 1 << 5;

/// Marks a coordinate that is stored in full instead of as a difference in units in the last place.
const EXPLICIT: u8 = 0x80;

// Scores are stored as bit planes of 64 bits.
const _: () = assert!(DIRECTIONS == 64);

pub(super) fn write_entry(
    bytes: &mut Vec<u8>,
    entry: &Entry,
    shape: &HandShape,
    object: &GraspObject,
    rig: &Rig,
) {
    let Grip {
        pose,
        bend_ratios,
        penetration,
        epsilon,
    } = &entry.grip;
    let Pose {
        position,
        orientation,
    } = pose.frame_from_wrist;
    write_floats(bytes, &position.to_array());
    write_floats(bytes, &orientation.to_array());
    write_shape(bytes, shape);
    write_digits(bytes, pose, bend_ratios, shape, rig);
    write_floats(bytes, &[*penetration, *epsilon]);
    write_floats(bytes, &WRITTEN_TERMS.map(|term| entry.grip_values[term as usize]));
    write_scores(bytes, &entry.scores);
    write_friction_uses(bytes, entry.friction_uses);
    bytes.extend(entry.finger_subsets.to_bits().to_be_bytes());
    bytes.push(entry.contacts.len() as u8);
    for contact in &entry.contacts {
        write_contact(bytes, contact, object.surface.mesh());
    }
}

pub(super) fn read_entry(
    reader: &mut Reader<'_>,
    object: &GraspObject,
    rig: &Rig,
) -> Result<(Entry, HandShape), AtlasError> {
    let position = Vec3::from(reader.floats()?);
    let orientation = Quat::from_array(reader.floats()?);
    if (orientation.length_squared() - 1.0).abs() > QUATERNION_SLACK {
        return Err(AtlasError::Malformed("a quaternion is not a unit quaternion"));
    }
    let shape = read_shape(reader)?;
    let (digits, bend_ratios) = read_digits(reader, &shape, rig)?;
    let pose = HandPose {
        frame_from_wrist: Pose {
            position,
            orientation,
        },
        digits,
    };
    let [penetration, epsilon] = reader.floats()?;
    let written: [f32; WRITTEN_TERMS.len()] = reader.floats()?;
    let scores = read_scores(reader)?;
    let friction_uses = read_friction_uses(reader)?;
    let sets = reader.u16()?;
    let count = usize::from(reader.u8()?);
    if count > MAX_CONTACTS {
        return Err(AtlasError::Malformed("a grip has too many contacts"));
    }
    let mesh = object.surface.mesh();
    let solids = HandSolids::of_pose(rig, &pose);
    let contacts = (0..count)
        .map(|_| read_contact(reader, mesh, &solids))
        .collect::<Result<Vec<_>, _>>()?;
    let grip = Grip {
        pose,
        bend_ratios,
        penetration,
        epsilon,
    };
    let finger_subsets = FingerSubsets::from_bits(sets, grip.holding_digits())
        .ok_or(AtlasError::Malformed("invalid finger subsets"))?;
    let classification = classify(rig, &pose, &contacts, &object.local_shape);
    let mut grip_values = posture_values(object, rig, &pose, &contacts, classification);
    for (term, value) in WRITTEN_TERMS.into_iter().zip(written) {
        grip_values[term as usize] = value;
    }
    let entry = Entry {
        grip,
        contacts,
        classification,
        grip_values,
        scores,
        friction_uses,
        finger_subsets,
    };
    Ok((entry, shape))
}

/// The bit after those of the five closing digits.
const TUCKS_BIT: u32 = 5;

fn write_shape(bytes: &mut Vec<u8>, shape: &HandShape) {
    let bits = (0..5).map(|digit| u8::from(shape.closing[digit]) << digit);
    bytes.push(bits.sum::<u8>() | u8::from(shape.tucks) << TUCKS_BIT);
    write_floats(bytes, &[shape.thumb_yaw, shape.spread]);
    write_floats(bytes, &shape.bend_ratios);
    write_floats(bytes, &shape.preshape);
}

fn read_shape(reader: &mut Reader<'_>) -> Result<HandShape, AtlasError> {
    let bits = reader.u8()?;
    let [thumb_yaw, spread] = reader.floats()?;
    Ok(HandShape {
        thumb_yaw,
        spread,
        bend_ratios: reader.floats()?,
        closing: std::array::from_fn(|digit| bits >> digit & 1 == 1),
        preshape: reader.floats()?,
        tucks: bits >> TUCKS_BIT & 1 == 1,
    })
}

/// A digit's yaw and bend ratio, derived from the hand's shape.
fn yaw_and_ratio_of_shape(shape: &HandShape, rig: &Rig, digit: usize) -> (f32, f32) {
    let flexing = shape.flexing(rig, Digit::ALL[digit]);
    (flexing.base_yaw, flexing.bend_ratio)
}

fn write_digits(
    bytes: &mut Vec<u8>,
    pose: &HandPose,
    bend_ratios: &[Option<f32>; 5],
    shape: &HandShape,
    rig: &Rig,
) {
    let is_derived = (0..5).all(|digit| {
        let (yaw, ratio) = yaw_and_ratio_of_shape(shape, rig, digit);
        pose.digits[digit].base_yaw.to_bits() == yaw.to_bits()
            && bend_ratios[digit].is_none_or(|own| own.to_bits() == ratio.to_bits())
    });
    let touching: u8 = (0..5)
        .map(|digit| u8::from(bend_ratios[digit].is_some()) << digit)
        .sum();
    bytes.push(touching | if is_derived { 0 } else { WRITTEN_OUT });
    for (angles, ratio) in pose.digits.iter().zip(bend_ratios) {
        if !is_derived {
            write_floats(bytes, &[angles.base_yaw, ratio.unwrap_or_default()]);
        }
        write_floats(
            bytes,
            &[angles.base_pitch, angles.second_pitch, angles.third_pitch],
        );
    }
}

type Digits = ([DigitAngles; 5], [Option<f32>; 5]);

fn read_digits(reader: &mut Reader<'_>, shape: &HandShape, rig: &Rig) -> Result<Digits, AtlasError> {
    let flags = reader.u8()?;
    let mut digits = [DigitAngles::default(); 5];
    let mut bend_ratios = [None; 5];
    for digit in 0..5 {
        let (base_yaw, ratio) = if flags & WRITTEN_OUT == 0 {
            yaw_and_ratio_of_shape(shape, rig, digit)
        } else {
            (reader.float()?, reader.float()?)
        };
        let [base_pitch, second_pitch, third_pitch] = reader.floats()?;
        digits[digit] = DigitAngles {
            base_yaw,
            base_pitch,
            second_pitch,
            third_pitch,
        };
        bend_ratios[digit] = (flags >> digit & 1 == 1).then_some(ratio);
    }
    Ok((digits, bend_ratios))
}

/// A grip's scores differ only in comfort, which needs less than six bits.
fn write_scores(bytes: &mut Vec<u8>, scores: &[u8; DIRECTIONS]) {
    let holding = scores.iter().filter(|score| **score != SLIPS);
    let lowest = holding.min().copied().unwrap_or(1);
    let above = scores.map(|score| if score == SLIPS { 0 } else { score - lowest + 1 });
    let highest = above.iter().max().copied().unwrap_or(0);
    let planes = u8::BITS - highest.leading_zeros();
    bytes.push(lowest);
    bytes.push(planes as u8);
    for plane in 0..planes {
        let bits = above.iter().enumerate();
        let bits = bits.fold(0, |bits, (place, score)| {
            bits | u64::from(score >> plane & 1) << place
        });
        bytes.extend(bits.to_be_bytes());
    }
}

fn read_scores(reader: &mut Reader<'_>) -> Result<[u8; DIRECTIONS], AtlasError> {
    let lowest = reader.u8()?;
    let planes = reader.u8()?;
    if lowest == SLIPS || planes > 8 {
        return Err(AtlasError::Malformed("scores are out of range"));
    }
    let mut above = [0_u8; DIRECTIONS];
    for plane in 0..planes {
        let bits = reader.u64()?;
        for (place, score) in above.iter_mut().enumerate() {
            *score |= ((bits >> place & 1) as u8) << plane;
        }
    }
    let mut scores = [SLIPS; DIRECTIONS];
    for (score, above) in scores.iter_mut().zip(above).filter(|(_, above)| *above > 0) {
        *score = (lowest - 1)
            .checked_add(above)
            .ok_or(AtlasError::Malformed("scores are out of range"))?;
    }
    Ok(scores)
}

/// Many grips need little friction in every direction, and few need all of it: trailing empty planes are omitted.
fn write_friction_uses(bytes: &mut Vec<u8>, uses: FrictionUses) {
    let planes = uses.to_bits();
    let count = planes
        .iter()
        .rposition(|bits| *bits != 0)
        .map_or(0, |last| last + 1);
    bytes.push(count as u8);
    for &bits in &planes[..count] {
        bytes.extend(bits.to_be_bytes());
    }
}

fn read_friction_uses(reader: &mut Reader<'_>) -> Result<FrictionUses, AtlasError> {
    let mut planes = [0; 2];
    let count = usize::from(reader.u8()?);
    let written = planes.get_mut(..count);
    for bits in written.ok_or(AtlasError::Malformed(
        "the number of friction-use planes is out of range",
    ))? {
        *bits = reader.u64()?;
    }
    FrictionUses::from_bits(planes).ok_or(AtlasError::Malformed(
        "a direction with full friction use is not among those with more than sparing use",
    ))
}

fn write_contact(bytes: &mut Vec<u8>, contact: &Contact, mesh: &TriangleMesh) {
    let part = match contact.part {
        HandPart::Phalanx(digit, phalanx) => 3 * digit.index() + phalanx.index(),
        HandPart::Palm => 15,
    };
    write_varint(bytes, u64::from(contact.triangle) * PARTS + part as u64);
    let (axis, [first, second]) = projection_axes(mesh, contact.triangle);
    let position = contact.position;
    write_floats(bytes, &[position[first], position[second]]);
    let expected = coordinate_on_plane(mesh, contact.triangle, position);
    let ulps = i64::from(ordered(position[axis])) - i64::from(ordered(expected));
    match i8::try_from(ulps) {
        Ok(difference) if difference != i8::MIN => bytes.push(difference.cast_unsigned()),
        _ => {
            bytes.push(EXPLICIT);
            write_floats(bytes, &[position[axis]]);
        }
    }
}

fn read_contact(
    reader: &mut Reader<'_>,
    mesh: &TriangleMesh,
    solids: &HandSolids,
) -> Result<Contact, AtlasError> {
    let code = reader.varint()?;
    let triangle = u32::try_from(code / PARTS)
        .ok()
        .filter(|&triangle| (triangle as usize) < mesh.triangles().len())
        .ok_or(AtlasError::Malformed("a contact refers to a missing triangle"))?;
    let part = match (code % PARTS) as usize {
        15 => HandPart::Palm,
        link => HandPart::Phalanx(Digit::ALL[link / 3], Phalanx::ALL[link % 3]),
    };
    let (axis, [first, second]) = projection_axes(mesh, triangle);
    let mut position = Vec3::ZERO;
    [position[first], position[second]] = reader.floats()?;
    let difference = reader.u8()?;
    position[axis] = if difference == EXPLICIT {
        reader.float()?
    } else {
        let expected = ordered(coordinate_on_plane(mesh, triangle, position));
        from_ordered(expected.wrapping_add_signed(i32::from(difference.cast_signed())))
    };
    if !position.is_finite() {
        return Err(AtlasError::Malformed("a contact is not finite"));
    }
    Ok(Contact {
        position,
        normal: contact_normal(solids, part, position, mesh.normal(triangle as usize)),
        triangle,
        part,
    })
}

/// The axis that a triangle faces most, and the two others.
fn projection_axes(mesh: &TriangleMesh, triangle: u32) -> (usize, [usize; 2]) {
    let axis = mesh.normal(triangle as usize).abs().max_position();
    (axis, [(axis + 1) % 3, (axis + 2) % 3])
}

/// The coordinate along that axis of the point in the triangle's plane with the given other two coordinates.
fn coordinate_on_plane(mesh: &TriangleMesh, triangle: u32, position: Vec3) -> f32 {
    let (axis, [first, second]) = projection_axes(mesh, triangle);
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
