//! How far a hand is from itself and from another.

use super::{HandSolids, TaperedCapsule};

/// How far the skins of two digits may press into each other before they count as one going through the other, in
/// metres: neighbouring fingers touch in life, and flesh gives way by about this much on either side.
pub const SOFT_CONTACT: f32 = 0.002;

/// The smallest distance between two digits of a hand in metres, less what soft flesh allows ([`SOFT_CONTACT`]):
/// negative if one goes through the other.
pub fn self_clearance(hand: &HandSolids) -> f32 {
    let mut least = f32::INFINITY;
    for first in 0..5 {
        for second in first + 1..5 {
            for (i, a) in hand.phalanges[first].iter().enumerate() {
                for (j, b) in hand.phalanges[second].iter().enumerate() {
                    // Neighbours are one flesh where they begin.
                    if i == 0 && j == 0 {
                        continue;
                    }
                    least = least.min(a.distance(b));
                }
            }
        }
    }
    least + SOFT_CONTACT
}

/// The smallest distance between two hands with their forearms in metres; negative if they overlap.
pub fn giver_clearance(receiver: &HandSolids, giver: &HandSolids) -> f32 {
    let mut least = f32::INFINITY;
    for a in receiver.iter() {
        for b in giver.iter() {
            if apart(a, b) < least {
                least = least.min(a.distance(b));
            }
        }
    }
    least
}

/// A lower bound of the distance between two solids.
fn apart(a: &TaperedCapsule, b: &TaperedCapsule) -> f32 {
    let ((centre_a, radius_a), (centre_b, radius_b)) = (a.bounding_ball(), b.bounding_ball());
    centre_a.distance(centre_b) - radius_a - radius_b
}
