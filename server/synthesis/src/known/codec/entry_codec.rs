//! A grip as bytes, with the shape that it was closed from.

use glam::{Quat, Vec3};

use super::{
    AtlasError,
    numbers::{Reader, Writer},
};
use crate::{
    base::pose::Pose,
    geometry::mesh::TriangleMesh,
    known::{
        entry::{Entry, SLIPS},
        finger_subsets::FingerSubsets,
        friction_uses::FrictionUses,
        gravity::DIRECTIONS,
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

/// Bytes of a grip at least: the wrist, the shape, the digits, how deep and how safe, terms, sets of fingers, and scores, uses of
/// friction and contacts of which there are none. It bounds what a count can ask for.
pub(super) const LEAST_ENTRY_BYTES: usize = 28 + 25 + 61 + 8 + 4 * WRITTEN_TERMS.len() + 2 + 2 + 1 + 1;

/// Terms of a grip's score that are written out; the others follow.
const WRITTEN_TERMS: [Term; 3] = [Term::Closure, Term::Steadiness, Term::SterileDistance];

/// By how much the square of a quaternion's length may differ from 1: what rounding leaves is a thousandth of it.
const QUATERNION_SLACK: f32 = 1e-3;

/// Parts of the hand that can touch, numbered: 15 links and the palm.
const PARTS: u64 = 16;

/// In the flags of a hand's angles, after a bit for each digit that touches: yaws and bend ratios are written out, because
/// they do not follow from the shape.
const WRITTEN_OUT: u8 = 1 << 5;

/// A difference in the last places of a coordinate that says that the coordinate follows.
const FAR_OFF: u8 = 0x80;

// Scores are written as bit planes of 64 bits.
const _: () = assert!(DIRECTIONS == 64);

pub(super) fn write_entry(
    writer: &mut Writer,
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
    writer.floats(&position.to_array());
    writer.floats(&orientation.to_array());
    write_shape(writer, shape);
    write_digits(writer, pose, bend_ratios, shape, rig);
    writer.floats(&[*penetration, *epsilon]);
    writer.floats(&WRITTEN_TERMS.map(|term| entry.grip_values[term as usize]));
    write_scores(writer, &entry.scores);
    write_friction_uses(writer, entry.friction_uses);
    writer.u16(entry.finger_subsets.to_bits());
    writer.u8(entry.contacts.len() as u8);
    for contact in &entry.contacts {
        write_contact(writer, contact, object.surface.mesh());
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
        return Err(AtlasError::Malformed("a quaternion is not a rotation"));
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
    let finger_subsets = FingerSubsets::from_bits(sets, grip.holding_digits()).ok_or(
        AtlasError::Malformed("sets of fingers are not of those that hold"),
    )?;
    let classification = classify(rig, &pose, &contacts);
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

/// The bit after those of the five digits that close.
const TUCKS_BIT: u32 = 5;

fn write_shape(writer: &mut Writer, shape: &HandShape) {
    let bits = (0..5).map(|digit| u8::from(shape.closing[digit]) << digit);
    writer.u8(bits.sum::<u8>() | u8::from(shape.tucks) << TUCKS_BIT);
    writer.floats(&[shape.thumb_yaw, shape.spread]);
    writer.floats(&shape.bend_ratios);
    writer.floats(&shape.preshape);
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

/// A digit's yaw and bend ratio as they follow from the hand's shape.
fn of_shape(shape: &HandShape, rig: &Rig, digit: usize) -> (f32, f32) {
    let flexing = shape.flexing(rig, Digit::ALL[digit]);
    (flexing.base_yaw, flexing.bend_ratio)
}

fn write_digits(
    writer: &mut Writer,
    pose: &HandPose,
    bend_ratios: &[Option<f32>; 5],
    shape: &HandShape,
    rig: &Rig,
) {
    let follows = (0..5).all(|digit| {
        let (yaw, ratio) = of_shape(shape, rig, digit);
        pose.digits[digit].base_yaw.to_bits() == yaw.to_bits()
            && bend_ratios[digit].is_none_or(|own| own.to_bits() == ratio.to_bits())
    });
    let touching: u8 = (0..5)
        .map(|digit| u8::from(bend_ratios[digit].is_some()) << digit)
        .sum();
    writer.u8(touching | if follows { 0 } else { WRITTEN_OUT });
    for (angles, ratio) in pose.digits.iter().zip(bend_ratios) {
        if !follows {
            writer.floats(&[angles.base_yaw, ratio.unwrap_or_default()]);
        }
        writer.floats(&[angles.base_pitch, angles.second_pitch, angles.third_pitch]);
    }
}

type Digits = ([DigitAngles; 5], [Option<f32>; 5]);

fn read_digits(reader: &mut Reader<'_>, shape: &HandShape, rig: &Rig) -> Result<Digits, AtlasError> {
    let flags = reader.u8()?;
    let mut digits = [DigitAngles::default(); 5];
    let mut bend_ratios = [None; 5];
    for digit in 0..5 {
        let (base_yaw, ratio) = if flags & WRITTEN_OUT == 0 {
            of_shape(shape, rig, digit)
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

/// A grip's scores differ by its comfort alone: less than six bits. So the least one is written, and of what the others
/// have more one bit plane after the other; 0 is what slips.
fn write_scores(writer: &mut Writer, scores: &[u8; DIRECTIONS]) {
    let holding = scores.iter().filter(|score| **score != SLIPS);
    let least = holding.min().copied().unwrap_or(1);
    let above = scores.map(|score| if score == SLIPS { 0 } else { score - least + 1 });
    let most = above.iter().max().copied().unwrap_or(0);
    let planes = u8::BITS - most.leading_zeros();
    writer.u8(least);
    writer.u8(planes as u8);
    for plane in 0..planes {
        let bits = above.iter().enumerate();
        writer.u64(bits.fold(0, |bits, (place, score)| {
            bits | u64::from(score >> plane & 1) << place
        }));
    }
}

fn read_scores(reader: &mut Reader<'_>) -> Result<[u8; DIRECTIONS], AtlasError> {
    let least = reader.u8()?;
    let planes = reader.u8()?;
    if least == SLIPS || planes > 8 {
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
        *score = (least - 1)
            .checked_add(above)
            .ok_or(AtlasError::Malformed("scores are out of range"))?;
    }
    Ok(scores)
}

/// Many grips need more than a little friction nowhere, and few need all of it: bits of which none is set are left out.
fn write_friction_uses(writer: &mut Writer, uses: FrictionUses) {
    let planes = uses.to_bits();
    let count = planes
        .iter()
        .rposition(|bits| *bits != 0)
        .map_or(0, |last| last + 1);
    writer.u8(count as u8);
    for &bits in &planes[..count] {
        writer.u64(bits);
    }
}

fn read_friction_uses(reader: &mut Reader<'_>) -> Result<FrictionUses, AtlasError> {
    let mut planes = [0; 2];
    let count = usize::from(reader.u8()?);
    let written = planes.get_mut(..count);
    for bits in written.ok_or(AtlasError::Malformed("uses of friction are out of range"))? {
        *bits = reader.u64()?;
    }
    FrictionUses::from_bits(planes).ok_or(AtlasError::Malformed("a grip uses all friction and some of it"))
}

fn write_contact(writer: &mut Writer, contact: &Contact, mesh: &TriangleMesh) {
    let part = match contact.part {
        HandPart::Phalanx(digit, phalanx) => 3 * digit.index() + phalanx.index(),
        HandPart::Palm => 15,
    };
    writer.short(u64::from(contact.triangle) * PARTS + part as u64);
    let (axis, [first, second]) = axes(mesh, contact.triangle);
    let position = contact.position;
    writer.floats(&[position[first], position[second]]);
    let expected = on_plane(mesh, contact.triangle, position);
    let last_places = i64::from(ordered(position[axis])) - i64::from(ordered(expected));
    match i8::try_from(last_places) {
        Ok(difference) if difference != i8::MIN => writer.u8(difference.cast_unsigned()),
        _ => {
            writer.u8(FAR_OFF);
            writer.floats(&[position[axis]]);
        }
    }
}

fn read_contact(
    reader: &mut Reader<'_>,
    mesh: &TriangleMesh,
    solids: &HandSolids,
) -> Result<Contact, AtlasError> {
    let place = reader.short()?;
    let triangle = u32::try_from(place / PARTS)
        .ok()
        .filter(|&triangle| (triangle as usize) < mesh.triangles().len())
        .ok_or(AtlasError::Malformed("a contact is on no triangle"))?;
    let part = match (place % PARTS) as usize {
        15 => HandPart::Palm,
        link => HandPart::Phalanx(Digit::ALL[link / 3], Phalanx::ALL[link % 3]),
    };
    let (axis, [first, second]) = axes(mesh, triangle);
    let mut position = Vec3::ZERO;
    [position[first], position[second]] = reader.floats()?;
    let difference = reader.u8()?;
    position[axis] = if difference == FAR_OFF {
        reader.float()?
    } else {
        let expected = ordered(on_plane(mesh, triangle, position));
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
fn axes(mesh: &TriangleMesh, triangle: u32) -> (usize, [usize; 2]) {
    let axis = mesh.normal(triangle as usize).abs().max_position();
    (axis, [(axis + 1) % 3, (axis + 2) % 3])
}

/// The coordinate along that axis of the point of the triangle's plane that has the two other coordinates.
fn on_plane(mesh: &TriangleMesh, triangle: u32, position: Vec3) -> f32 {
    let (axis, [first, second]) = axes(mesh, triangle);
    let [a, b, c] = mesh.corners(triangle as usize).map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    let way = position.as_dvec3() - a;
    let along = (normal[first] * way[first] + normal[second] * way[second]) / normal[axis];
    (a[axis] - along) as f32
}

/// A number that grows by one from a float to the next larger one.
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
