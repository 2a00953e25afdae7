//! Where a closed hand meets the object: digits from all sides, and the palm.

use glam::Vec3;

use super::{
    closing::{ClosedDigit, TOUCHING},
    immobility::SoftContact,
    solids::{HandSolids, TaperedCapsule, Touch, closest},
};
use crate::{
    grasp::Contact,
    hand::{Digit, HandPart, Phalanx},
    object::GraspObject,
};

/// Metres by which friction is multiplied to give the torsion that a fingertip bears per newton of normal force: two
/// thirds of the radius of a disk that is pressed evenly, of 5 mm here. A larger one lets two fingers hold what would
/// twist out of them.
pub(crate) const TORSION_LEVER: f32 = 0.0033;

/// Cosine of the angle up to which a contact's normal may differ from the direction to the bone: a touch, not a scrape.
const FACING_COS: f32 = 0.5;

/// Contacts of the palm are at least this far apart in metres: the solids that it is made of overlap, and several of them
/// touch with the same piece of skin. Fewer make the palm pivot, more cost time in the immobility checks.
const PALM_SPACING: f32 = 0.015;

/// Puts the contacts of the digits that touch and of the palm into `contacts`, thumb first and the palm last.
pub(super) fn collect_contacts(
    object: &GraspObject,
    digits: &[ClosedDigit; 5],
    solids: &HandSolids,
    contacts: &mut Vec<Contact>,
) {
    contacts.clear();
    for (digit, closed) in Digit::ALL.into_iter().zip(digits) {
        for (phalanx, link) in Phalanx::ALL.into_iter().zip(&closed.links) {
            if !closed.touches[phalanx.index()] {
                continue;
            }
            let touch = closest(link, &object.surface, 0.0);
            contacts.extend(touch.and_then(|touch| contact(link, &touch, HandPart::Phalanx(digit, phalanx))));
        }
    }
    let first_of_palm = contacts.len();
    // The ball of the thumb gives way with its metacarpal, and the web is a fold of skin: neither bears anything.
    for solid in &solids.palm {
        let Some(touch) = closest(solid, &object.surface, TOUCHING) else {
            continue;
        };
        let is_new = |other: &Contact| other.position.distance(touch.point) >= PALM_SPACING;
        if contacts[first_of_palm..].iter().all(is_new) {
            contacts.extend(contact(solid, &touch, HandPart::Palm));
        }
    }
}

/// The contacts as soft fingers, for objects with a friction coefficient of `friction`.
pub(crate) fn soften(contacts: &[Contact], friction: f32, soft_contacts: &mut Vec<SoftContact>) {
    soft_contacts.clear();
    soft_contacts.extend(contacts.iter().map(|contact| SoftContact {
        position: contact.position,
        normal: contact.normal,
        digit: contact.part.digit(),
        friction,
        torsion_radius: friction * TORSION_LEVER,
    }));
}

/// True if something of the hand presses against the thumb: contacts whose normals differ by less than a right angle
/// never hold anything. It settles most hopeless grips before any force is solved for.
pub(super) fn are_opposed(contacts: &[Contact]) -> bool {
    contacts
        .iter()
        .enumerate()
        .any(|(i, a)| contacts[..i].iter().any(|b| a.normal.dot(b.normal) < 0.0))
}

/// The contact of a touch, if the surface faces the bone there.
fn contact(solid: &TaperedCapsule, touch: &Touch, part: HandPart) -> Option<Contact> {
    // The way to the bone is the triangle's normal inside of it; at an edge or a corner it is the one of all directions
    // between its triangles' normals in which round flesh presses.
    let outward: Vec3 = (solid.at(touch.along) - touch.point).normalize_or_zero();
    (outward.dot(touch.normal) >= FACING_COS).then_some(Contact {
        position: touch.point,
        normal: outward,
        triangle: touch.triangle,
        part,
    })
}
