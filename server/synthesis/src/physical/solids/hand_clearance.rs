//! Clearance of a hand from itself, and lower bounds on the distance of two solids.

use glam::Vec3;

use super::{HandSolids, SolidPart, TaperedCapsule};
use crate::model::hand::{Digit, Phalanx};

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
    least_distance(hand, 0.0, |_| ()) + SOFT_CONTACT
}

/// The two parts of a hand that can meet and come closest, with their solids, and [`self_clearance`] of them, however far
/// apart they are.
pub fn nearest_parts(hand: &HandSolids) -> Option<(f32, [(SolidPart, TaperedCapsule); 2])> {
    let mut nearest = None;
    let least = least_distance(hand, f32::INFINITY, |parts| nearest = Some(parts));
    nearest.map(|parts| (least + SOFT_CONTACT, parts))
}

/// The smallest distance between parts that can meet, or `enough` if it is larger. Each pair that is closer than all before it is
/// passed to `nearer`.
#[inline]
fn least_distance(
    hand: &HandSolids,
    enough: f32,
    mut nearer: impl FnMut([(SolidPart, TaperedCapsule); 2]),
) -> f32 {
    let mut least = enough;
    let mut phalanges = hand.phalanges;
    for [first, ..] in &mut phalanges[1..] {
        first.start_radius = first.start_radius.min(first.end_radius * KNUCKLE_TAPER);
    }
    let digits = phalanges.map(|links| links.map(Bounded::new));
    // Missing digits are a point in the palm.
    let is_there = |digit: &[Bounded; 3]| digit[2].solid.end_radius > 0.0;
    let link = |digit: usize, link: usize| SolidPart::Phalanx(Digit::ALL[digit], Phalanx::ALL[link]);
    for (i, digit) in digits.iter().enumerate().filter(|(_, digit)| is_there(digit)) {
        let others = digits.iter().enumerate().skip(i + 1);
        for (j, other) in others.filter(|(_, other)| is_there(other)) {
            least = between(digit, other, least, |our, their| {
                nearer([
                    (link(i, our), digit[our].solid),
                    (link(j, their), other[their].solid),
                ]);
            });
        }
    }
    let palm = hand.palm.map(Bounded::new);
    let thenar = hand.thenar.map(Bounded::new);
    for (i, digit) in digits.iter().enumerate().filter(|(_, digit)| is_there(digit)) {
        let outer = &digit[1..];
        least = between(outer, &palm, least, |our, their| {
            nearer([
                (link(i, our + 1), outer[our].solid),
                (SolidPart::Palm, palm[their].solid),
            ]);
        });
        if i > 0 {
            least = between(outer, &thenar, least, |our, their| {
                nearer([
                    (link(i, our + 1), outer[our].solid),
                    (SolidPart::ThumbBall, thenar[their].solid),
                ]);
            });
        }
    }
    least
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

/// The smallest distance between two groups of solids, or `least` if it is larger. The places of each closer pair are passed to
/// `nearer`.
#[inline]
fn between(ours: &[Bounded], theirs: &[Bounded], least: f32, mut nearer: impl FnMut(usize, usize)) -> f32 {
    let mut least = least;
    for (our_place, our) in ours.iter().enumerate() {
        for (their_place, their) in theirs.iter().enumerate() {
            if our.is_beyond(their, least) {
                continue;
            }
            let distance = our.solid.distance(&their.solid);
            if distance < least {
                least = distance;
                nearer(our_place, their_place);
            }
        }
    }
    least
}
