//! Step 4, Contact Validation: Algorithm 7 (`COLLIDESWITHFORBIDDENSURFACE`).

use super::finger_posing::PosedDigit;
use crate::model::{
    grasp::Contact,
    hand::{Digit, HandPart, Phalanx},
    object::GraspObject,
};

/// Replaces `contacts` with those of the posed digits, thumb first, from the proximal to the distal phalanx.
pub(crate) fn collect_contacts(object: &GraspObject, digits: &[PosedDigit; 5], contacts: &mut Vec<Contact>) {
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

/// `COLLIDESWITHFORBIDDENSURFACE`: true if a contact lies on a forbidden triangle of the object.
pub(crate) fn touches_forbidden_surface(object: &GraspObject, contacts: &[Contact]) -> bool {
    contacts
        .iter()
        .any(|contact| object.is_forbidden(contact.triangle))
}
