//! Step 4, Contact Validation: Algorithm 7 (`COLLIDESWITHFORBIDDENSURFACE`).

use super::finger_posing::PosedDigit;
use crate::model::{
    grasp::Contact,
    hand::{Digit, HandPart, Phalanx},
    object::GraspObject,
};

/// Puts the contacts of the posed digits into `contacts`, thumb first and from the palm outward.
pub fn collect_contacts(object: &GraspObject, digits: &[PosedDigit; 5], contacts: &mut Vec<Contact>) {
    contacts.clear();
    for (digit, posed) in Digit::ALL.into_iter().zip(digits) {
        for (phalanx, hit) in Phalanx::ALL.into_iter().zip(posed.hits) {
            contacts.extend(hit.map(|hit| Contact {
                position: hit.position,
                normal: object.surface.mesh().normal(hit.triangle as usize),
                triangle: hit.triangle,
                part: HandPart::Phalanx(digit, phalanx),
            }));
        }
    }
}

/// True if a contact lies on a forbidden surface of the object.
pub fn touches_forbidden_surface(object: &GraspObject, contacts: &[Contact]) -> bool {
    contacts
        .iter()
        .any(|contact| object.is_forbidden(contact.triangle))
}
