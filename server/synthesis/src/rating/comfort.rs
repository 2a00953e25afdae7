//! Comfort, the thesis' evaluation measure (4.6, Eq. 4.6).

use glam::Vec3;

use crate::model::grasp::{COMFORTABLE_SHARES, Contact};

/// E of Eq. 4.6: squared distance of the digits' force shares from the comfortable ones; 0 is most comfortable.
///
/// `digit_totals` are force magnitudes, thumb first, in any unit; 0 for a digit without contact. E is 0 if all are: of two
/// hands, one may hold by its palm alone. D' are the comfortable shares of the touching digits, normalized to sum 1. The
/// thesis leaves the scale of f open; f is normalized likewise here, so that E does not depend on the object's weight.
pub fn comfort(digit_totals: [f32; 5]) -> f32 {
    let total: f32 = digit_totals.iter().sum();
    if total <= 0.0 {
        return 0.0;
    }
    let touching = digit_totals.map(|force| if force > 0.0 { 1.0 } else { 0.0 });
    let z: f32 = COMFORTABLE_SHARES.iter().zip(touching).map(|(d, b)| b * d).sum();
    (0..5)
        .map(|i| (touching[i] * COMFORTABLE_SHARES[i] / z - digit_totals[i] / total).powi(2))
        .sum()
}

/// Total force magnitude of each digit, thumb first; `forces` has one entry per contact.
pub fn digit_totals(contacts: &[Contact], forces: &[Vec3]) -> [f32; 5] {
    let mut totals = [0.0; 5];
    for (contact, force) in contacts.iter().zip(forces) {
        if let Some(digit) = contact.part.digit() {
            totals[digit.index()] += force.length();
        }
    }
    totals
}
