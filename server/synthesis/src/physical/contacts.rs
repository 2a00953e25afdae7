//! Contacts between a closed hand and the object: all sides of the digits, and the palm.

use glam::Vec3;

use super::{
    closing::{ClosedDigit, TOUCHING},
    immobility::SoftContact,
    solids::{HandSolids, TrackedPalm, closest},
};
use crate::{
    geometry::{capsule_gap::CapsuleGap, mesh_bvh::MeshBvh},
    model::{
        grasp::Contact,
        hand::{Digit, HandPart, HandPose, Phalanx, rig::Rig},
        object::GraspObject,
    },
};

/// Torsion that a contact bears per newton of normal force, divided by friction, in metres: two thirds of the radius
/// of an evenly pressed disk, here of 5 mm. Larger values accept pinches that the object would twist out of.
pub(crate) const TORSION_LEVER: f32 = 0.0033;

/// Cosine of the largest angle between a contact's normal and the direction to the bone: a touch, not a scrape.
pub(crate) const FACING_COS: f32 = 0.5;

/// Cosine of the angle within which the direction to the bone counts as the triangle's normal. Larger angles flatten blunt edges.
const FACE_NORMAL_COS: f32 = 0.9962;

/// Distance from a touch within which triangles meet there, in metres: its coordinates are rounded.
const MEETING: f32 = 1e-6;

/// Smallest distance between contacts of the palm, in metres: its solids overlap, and several touch at the same skin.
const PALM_SPACING: f32 = 0.015;

/// Largest distance of a palm contact from the palm described by the joints' radii, in metres.
const PALM_SLACK: f32 = 0.0015;

/// Cosine of the largest angle between the direction to the palm's bone and the direction in which one of its solids presses.
const PALM_PRESS_COS: f32 = 0.985;

/// Replaces `contacts` by those of the touching digits and of the palm, thumb first and palm last. `pose` must be the
/// pose of `digits`.
pub(super) fn collect_contacts(
    object: &GraspObject,
    rig: &Rig,
    pose: &HandPose,
    digits: &[ClosedDigit; 5],
    contacts: &mut Vec<Contact>,
) {
    let solids = &HandSolids::of_pose(rig, pose);
    contacts.clear();
    for (digit, closed) in Digit::ALL.into_iter().zip(digits) {
        for (phalanx, link) in Phalanx::ALL.into_iter().zip(&closed.links) {
            if !closed.touches[phalanx.index()] {
                continue;
            }
            let touch = closest(link, &object.surface, 0.0);
            let part = HandPart::Phalanx(digit, phalanx);
            contacts.extend(touch.and_then(|touch| contact(&object.surface, solids, &touch, part)));
        }
    }
    let first_palm_contact = contacts.len();
    let tracked = TrackedPalm::of_rig(rig, pose.frame_from_wrist);
    // The ball of the thumb yields with its metacarpal, and the web is a fold of skin; they bear no load.
    for solid in &solids.palm {
        let Some(touch) = closest(solid, &object.surface, TOUCHING) else {
            continue;
        };
        let is_new = |other: &Contact| other.position.distance(touch.position) >= PALM_SPACING;
        let is_own = || {
            let pressing = (solid.at(touch.along) - touch.position).normalize_or_zero();
            direction_to_bone(solids, HandPart::Palm, touch.position).dot(pressing) >= PALM_PRESS_COS
        };
        let is_tracked = || tracked.distance_to_skin(touch.position) <= PALM_SLACK;
        if contacts[first_palm_contact..].iter().all(is_new) && is_own() && is_tracked() {
            contacts.extend(contact(&object.surface, solids, &touch, HandPart::Palm));
        }
    }
}

/// Replaces `soft_contacts` by the contacts as soft fingers with friction coefficient `friction`.
pub(crate) fn soften<'a>(
    contacts: impl IntoIterator<Item = &'a Contact>,
    friction: f32,
    soft_contacts: &mut Vec<SoftContact>,
) {
    soft_contacts.clear();
    soft_contacts.extend(contacts.into_iter().map(|contact| SoftContact {
        position: contact.position,
        normal: contact.normal,
        digit: contact.part.digit(),
        friction,
        torsion_radius: friction * TORSION_LEVER,
    }));
}

/// True if two contact normals differ by more than a right angle; nothing can be held otherwise. Rejects most
/// hopeless grips before any force is solved for.
pub(super) fn are_opposed(contacts: &[Contact]) -> bool {
    contacts
        .iter()
        .enumerate()
        .any(|(i, a)| contacts[..i].iter().any(|b| a.normal.dot(b.normal) < 0.0))
}

/// The contact at a touch, if the surface faces the bone there.
fn contact(surface: &MeshBvh, solids: &HandSolids, touch: &CapsuleGap, part: HandPart) -> Option<Contact> {
    let outward = direction_to_bone(solids, part, touch.position);
    let (triangle, facing) = pressed_face(surface, touch, outward);
    (outward.dot(facing) >= FACING_COS).then(|| Contact {
        position: touch.position,
        normal: pressed_normal(outward, facing),
        triangle,
        part,
    })
}

/// The triangle pressed at a touch, of several that meet there the one that faces the bone most, and its normal toward the bone.
fn pressed_face(surface: &MeshBvh, touch: &CapsuleGap, outward: Vec3) -> (u32, Vec3) {
    let found = facing_normal(outward, surface.mesh().normal(touch.triangle as usize));
    let mut pressed = (touch.triangle, found);
    let mut most = outward.dot(found);
    if most <= FACE_NORMAL_COS {
        surface.each_within(touch.position, MEETING, |triangle| {
            let normal = surface.mesh().normal(triangle as usize);
            let cos = outward.dot(normal);
            if cos > most || cos >= most && triangle < pressed.0 {
                (pressed, most) = ((triangle, normal), cos);
            }
        });
    }
    pressed
}

/// The normal at a contact whose part, position and triangle normal are known.
pub(crate) fn contact_normal(solids: &HandSolids, part: HandPart, point: Vec3, of_triangle: Vec3) -> Vec3 {
    let outward = direction_to_bone(solids, part, point);
    pressed_normal(outward, facing_normal(outward, of_triangle))
}

/// The triangle's normal on the side of the bone: a sheet is pressed from both sides.
fn facing_normal(direction_to_bone: Vec3, of_triangle: Vec3) -> Vec3 {
    if direction_to_bone.dot(of_triangle) < 0.0 {
        -of_triangle
    } else {
        of_triangle
    }
}

/// The direction of pressure: the normal inside a triangle, the direction to the bone at an edge or corner.
fn pressed_normal(direction_to_bone: Vec3, of_triangle: Vec3) -> Vec3 {
    if direction_to_bone.dot(of_triangle) > FACE_NORMAL_COS {
        of_triangle
    } else {
        direction_to_bone
    }
}

/// Unit vector from a point of the surface to the bone of the part that touches there.
fn direction_to_bone(solids: &HandSolids, part: HandPart, point: Vec3) -> Vec3 {
    let parts = match part {
        HandPart::Palm => solids.palm.as_slice(),
        HandPart::Phalanx(digit, phalanx) => {
            std::slice::from_ref(&solids.phalanges[digit.index()][phalanx.index()])
        }
    };
    let point = point.as_dvec3();
    let nearest = parts
        .iter()
        .map(|solid| (solid, solid.nearest(point)))
        .min_by(|(_, a), (_, b)| a.1.total_cmp(&b.1));
    nearest.map_or(Vec3::ZERO, |(solid, (along, _))| {
        let bone = solid.start.as_dvec3().lerp(solid.end.as_dvec3(), along);
        (bone - point).normalize_or_zero().as_vec3()
    })
}
