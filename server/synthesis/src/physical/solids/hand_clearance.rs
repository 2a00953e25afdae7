//! How far a hand is from itself and from another.

use glam::Vec3;

use super::{HandSolids, TaperedCapsule};

/// How far the skins of two parts of a hand may press into each other before one counts as going through the other, in
/// metres: neighbouring fingers touch in life, and the flesh of both gives way by a millimetre under little force. More
/// lets fingers visibly share room, less refuses hands that are closed like every other.
pub const SOFT_CONTACT: f32 = 0.002;

/// The smallest distance between parts of a hand that can meet in metres, with what soft flesh allows
/// ([`SOFT_CONTACT`]) added: negative if one goes through the other, [`SOFT_CONTACT`] if none touches another.
///
/// Those are the links of different digits, and the two outer links of a digit with the palm, for fingers also with the
/// ball of the thumb. The inner links and the thumb's ball overlap the palm in every pose.
pub fn self_clearance(hand: &HandSolids) -> f32 {
    let mut least = 0.0;
    let digits = hand.phalanges.map(|links| links.map(Bounded::new));
    for (i, digit) in digits.iter().enumerate() {
        for other in &digits[i + 1..] {
            least = between(digit, other, least);
        }
    }
    let palm = hand.palm.map(Bounded::new);
    let thenar = hand.thenar.map(Bounded::new);
    for (i, digit) in digits.iter().enumerate() {
        least = between(&digit[1..], &palm, least);
        if i > 0 {
            least = between(&digit[1..], &thenar, least);
        }
    }
    least + SOFT_CONTACT
}

/// The smallest distance between two hands with their forearms in metres; negative if they overlap.
pub fn giver_clearance(receiver: &HandSolids, giver: &HandSolids) -> f32 {
    // The distance of any pair bounds the smallest; that of the pair with the nearest middles is a good one.
    let theirs: [TaperedCapsule; HandSolids::COUNT] = giver.to_array();
    let middles = theirs.map(|solid| solid.start + solid.end);
    let mut nearest = f32::INFINITY;
    let mut pair = (receiver.palm[0], theirs[0]);
    for ours in receiver.to_array() {
        let middle = ours.start + ours.end;
        for (their_middle, theirs) in middles.iter().zip(&theirs) {
            let apart = middle.distance_squared(*their_middle);
            if apart < nearest {
                nearest = apart;
                pair = (ours, *theirs);
            }
        }
    }
    let enough = pair.0.distance(&pair.1);
    least_distance(receiver.iter(), giver, enough)
}

/// The smallest distance between solids and a hand with its forearm in metres, or `enough` if it is more than that.
pub fn least_distance<'a>(
    solids: impl IntoIterator<Item = &'a TaperedCapsule>,
    hand: &HandSolids,
    enough: f32,
) -> f32 {
    let theirs = hand.to_array().map(Bounded::new);
    // The balls, coordinate by coordinate, so that a whole hand of them is compared at once.
    let balls: [[f32; HandSolids::COUNT]; 4] = [
        theirs.map(|their| their.centre.x),
        theirs.map(|their| their.centre.y),
        theirs.map(|their| their.centre.z),
        theirs.map(|their| their.radius),
    ];
    let mut least = enough;
    for ours in solids {
        let our = Bounded::new(*ours);
        let is_near: [bool; HandSolids::COUNT] = std::array::from_fn(|i| {
            let (x, y, z) = (
                balls[0][i] - our.centre.x,
                balls[1][i] - our.centre.y,
                balls[2][i] - our.centre.z,
            );
            let reach = (least + our.radius + balls[3][i]).max(0.0);
            x * x + y * y + z * z <= reach * reach
        });
        for (their, _) in theirs.iter().zip(is_near).filter(|(_, near)| *near) {
            least = between(&[our], &[*their], least);
        }
    }
    least
}

/// A solid with the ball around it.
#[derive(Clone, Copy)]
struct Bounded {
    solid: TaperedCapsule,
    centre: Vec3,
    radius: f32,
}

impl Bounded {
    fn new(solid: TaperedCapsule) -> Self {
        let (centre, radius) = solid.bounding_ball();
        Self {
            solid,
            centre,
            radius,
        }
    }

    /// True if the other is certainly farther away than `distance`: by the balls around both, then by one ball and the
    /// longer solid's axis, as the ball around a forearm is wide.
    fn is_beyond(&self, other: &Self, distance: f32) -> bool {
        let reach = distance + self.radius + other.radius;
        if reach < 0.0 || self.centre.distance_squared(other.centre) > reach * reach {
            return true;
        }
        let (long, round) = if self.radius > other.radius {
            (self, other)
        } else {
            (other, self)
        };
        let thickest = long.solid.start_radius.max(long.solid.end_radius);
        let axis = long.solid.end - long.solid.start;
        let offset = round.centre - long.solid.start;
        let along = (offset.dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        let reach = distance + thickest + round.radius;
        reach < 0.0 || offset.distance_squared(axis * along) > reach * reach
    }
}

/// The smallest distance between two groups of solids, or `least` if it is more than that.
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
