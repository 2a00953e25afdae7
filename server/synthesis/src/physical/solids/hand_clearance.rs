//! Clearance of a hand from itself, and lower bounds on the distance of two solids.

use glam::Vec3;

use super::{HandSolids, TaperedCapsule};

/// How far two parts of a hand may press into each other before one counts as going through the other, in metres:
/// neighbouring fingers touch in life, and both yield by a millimetre under little force. Larger values let fingers
/// visibly overlap, smaller ones reject ordinary closed hands.
pub const SOFT_CONTACT: f32 = 0.002;

/// Upper bound on the radius of a finger's first phalanx at the knuckle over that at its far joint, where neighbours
/// are compared: a knuckle's radius includes flesh of the palm that neighbours share.
const KNUCKLE_TAPER: f32 = 1.03;

/// The smallest distance in metres between parts of a hand that can meet, plus what soft flesh allows
/// ([`SOFT_CONTACT`]): negative if one goes through another, [`SOFT_CONTACT`] if none touch.
///
/// The parts that can meet are the links of different digits, the two outer links of a digit and the palm, and, for
/// fingers, the ball of the thumb. Inner links and the thumb's ball overlap the palm in every pose.
pub fn self_clearance(hand: &HandSolids) -> f32 {
    let mut least = 0.0;
    let mut phalanges = hand.phalanges;
    for [first, ..] in &mut phalanges[1..] {
        first.start_radius = first.start_radius.min(first.end_radius * KNUCKLE_TAPER);
    }
    let digits = phalanges.map(|links| links.map(Bounded::new));
    // Missing digits are a point in the palm.
    let is_there = |digit: &[Bounded; 3]| digit[2].solid.end_radius > 0.0;
    for (i, digit) in digits.iter().enumerate().filter(|(_, digit)| is_there(digit)) {
        for other in digits[i + 1..].iter().filter(|other| is_there(other)) {
            least = between(digit, other, least);
        }
    }
    let palm = hand.palm.map(Bounded::new);
    let thenar = hand.thenar.map(Bounded::new);
    for (i, digit) in digits.iter().enumerate().filter(|(_, digit)| is_there(digit)) {
        least = between(&digit[1..], &palm, least);
        if i > 0 {
            least = between(&digit[1..], &thenar, least);
        }
    }
    least + SOFT_CONTACT
}

/// A solid with its bounding sphere.
#[derive(Clone, Copy, Debug)]
pub struct Bounded {
    pub(in crate::physical) solid: TaperedCapsule,
    pub(in crate::physical) centre: Vec3,
    pub(in crate::physical) radius: f32,
}

impl Bounded {
    pub(in crate::physical) fn new(solid: TaperedCapsule) -> Self {
        let (centre, radius) = solid.bounding_sphere();
        Self {
            solid,
            centre,
            radius,
        }
    }

    /// A lower bound on the distance in metres, by the same tests as [`Bounded::is_beyond`].
    pub(in crate::physical) fn distance_lower_bound(&self, other: &Self) -> f32 {
        let by_spheres = self.centre.distance(other.centre) - self.radius - other.radius;
        let (long, round) = self.longer_first(other);
        let by_axis = long.distance_squared_from_axis(round.centre).sqrt() - long.thickest() - round.radius;
        by_spheres.max(by_axis)
    }

    /// True if the other is certainly farther away than `distance`: by the bounding spheres, then by one sphere and
    /// the longer solid's axis, because the sphere around a forearm is wide.
    pub(in crate::physical) fn is_beyond(&self, other: &Self, distance: f32) -> bool {
        let reach = distance + self.radius + other.radius;
        if reach < 0.0 || self.centre.distance_squared(other.centre) > reach * reach {
            return true;
        }
        let (long, round) = self.longer_first(other);
        let reach = distance + long.thickest() + round.radius;
        reach < 0.0 || long.distance_squared_from_axis(round.centre) > reach * reach
    }

    fn longer_first<'a>(&'a self, other: &'a Self) -> (&'a Self, &'a Self) {
        if self.radius > other.radius {
            (self, other)
        } else {
            (other, self)
        }
    }

    fn thickest(&self) -> f32 {
        self.solid.start_radius.max(self.solid.end_radius)
    }

    fn distance_squared_from_axis(&self, point: Vec3) -> f32 {
        let axis = self.solid.end - self.solid.start;
        let offset = point - self.solid.start;
        let along = (offset.dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        offset.distance_squared(axis * along)
    }
}

/// The smallest distance between two groups of solids, or `least` if it is larger.
fn between(ours: &[Bounded], theirs: &[Bounded], least: f32) -> f32 {
    let mut least = least;
    for our in ours {
        for their in theirs {
            if !our.is_beyond(their, least) {
                least = least.min(our.solid.distance(&their.solid));
            }
        }
    }
    least
}
