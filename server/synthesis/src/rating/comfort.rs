//! The evaluation measure "comfort" (thesis 4.6, Eq. 4.6).

use glam::Vec3;

use crate::model::{forces::COMFORTABLE_SHARES, grasp::Contact};

/// E of Eq. 4.6: how far the digits' forces are from the comfortable distribution; 0 is the most comfortable.
///
/// `digit_totals` are the force magnitudes of the digits, thumb first, in any unit; a digit without contact has 0.
/// At least one of them touches. D' are the comfortable shares of the digits that touch, scaled to sum one. The thesis
/// leaves the scale of the f open; as D' sums to one, so do they here, or E would say how heavy the object is.
pub fn comfort(digit_totals: [f32; 5]) -> f32 {
    let total: f32 = digit_totals.iter().sum();
    debug_assert!(total > 0.0, "no digit applies a force: {digit_totals:?}");
    let touching = digit_totals.map(|force| if force > 0.0 { 1.0 } else { 0.0 });
    let z: f32 = COMFORTABLE_SHARES.iter().zip(touching).map(|(d, b)| b * d).sum();
    (0..5)
        .map(|i| (touching[i] * COMFORTABLE_SHARES[i] / z - digit_totals[i] / total).powi(2))
        .sum()
}

/// The force magnitudes of each digit, thumb first, summed over its contacts; `forces` has one entry a contact.
pub fn digit_totals(contacts: &[Contact], forces: &[Vec3]) -> [f32; 5] {
    let mut totals = [0.0; 5];
    for (contact, force) in contacts.iter().zip(forces) {
        if let Some(digit) = contact.part.digit() {
            totals[digit.index()] += force.length();
        }
    }
    totals
}
