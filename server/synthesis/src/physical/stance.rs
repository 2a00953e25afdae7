//! Whether two hands can belong to one body.
//!
//! Nothing is known of the body, so it is guessed from the hands: it stands upright behind them, where the forearms come
//! from.

use glam::Vec3;

use super::solids::FOREARM_LENGTH;
use crate::{
    base::pose::Pose,
    model::hand::{Handedness, rig::Rig},
};

/// Largest angle between the forearms, as its cosine: 110°. Wider ones would embrace the object.
const MIN_FOREARM_COS: f32 = -0.342;

/// Range of a forearm's rise from the elbow to the wrist, as sines: from 58° down to 64° up. Steeper ones need a body above
/// or below the object.
const FOREARM_RISE: [f32; 2] = [-0.85, 0.9];

/// Smallest height of the thumb's side of the hand over the other side, as the sine of its slope: forearms twist from
/// palm up over thumb up to palm down, and little farther.
const MIN_THUMB_RISE: f32 = -0.4;

/// Weight of the thumbs' side against the fingers' direction where the body faces: only hands that reach straight up,
/// down or inward need it.
const THUMB_WEIGHT: f32 = 0.5;

/// Shortest sum of the hands' horizontal directions from which it is known where the body faces.
const MIN_FACING: f32 = 0.3;

/// How far a hand may point back at its body: the cosine of 96°.
const MIN_FORWARD_COS: f32 = -0.1;

/// How far the right hand may be to the left of the left one, in metres: a finger's breadth, for hands one above the
/// other.
const MAX_CROSSING: f32 = 0.02;

/// Range of the elbows' distance, in metres: from close together in front of the body, measured across it, to as far apart
/// as shoulders of 0.36 m and upper arms of 0.3 m allow.
const ELBOW_DISTANCES: [f32; 2] = [0.1, 0.9];

/// True if the hands of two rigs with these wrist poses suit one upright body: forearms from the same side, twisted no
/// farther than they turn, and not crossed. One hand may be above the other. `up` is a unit vector; all are in one
/// frame.
pub fn suits_one_body(hands: [(&Rig, Pose); 2], up: Vec3) -> bool {
    let [(a, _), (b, _)] = hands;
    let (right, left) = match (a.handedness, b.handedness) {
        (Handedness::Right, Handedness::Left) => (Arm::new(hands[0]), Arm::new(hands[1])),
        (Handedness::Left, Handedness::Right) => (Arm::new(hands[1]), Arm::new(hands[0])),
        _ => return false,
    };
    let arms = [&right, &left];
    let [least_rise, most_rise] = FOREARM_RISE;
    if right.along.dot(left.along) < MIN_FOREARM_COS
        || arms.iter().any(|arm| {
            !(least_rise..=most_rise).contains(&arm.along.dot(up)) || arm.thumb.dot(up) < MIN_THUMB_RISE
        })
    {
        return false;
    }
    let directions = right.along + left.along + THUMB_WEIGHT * (right.thumb + left.thumb);
    let horizontal = directions.reject_from_normalized(up);
    if horizontal.length() < MIN_FACING {
        return false;
    }
    let forward = horizontal.normalize_or_zero();
    let rightward = forward.cross(up);
    let [nearest, farthest] = ELBOW_DISTANCES;
    arms.iter().all(|arm| arm.along.dot(forward) >= MIN_FORWARD_COS)
        && (right.palm - left.palm).dot(rightward) >= -MAX_CROSSING
        && (right.elbow - left.elbow).dot(rightward) >= nearest
        && right.elbow.distance(left.elbow) <= farthest
}

/// A hand and forearm as far as they show where the body is.
struct Arm {
    /// The palm's centre.
    palm: Vec3,
    /// The elbow.
    elbow: Vec3,
    /// From the elbow to the wrist, a unit vector.
    along: Vec3,
    /// From the little finger's side to the thumb's, a unit vector.
    thumb: Vec3,
}

impl Arm {
    fn new((rig, wrist): (&Rig, Pose)) -> Self {
        let along = wrist.transform_vector(Vec3::Y);
        let thumb = match rig.handedness {
            Handedness::Right => Vec3::X,
            Handedness::Left => Vec3::NEG_X,
        };
        Self {
            palm: wrist.transform_point(rig.palm),
            elbow: wrist.position - along * FOREARM_LENGTH,
            along,
            thumb: wrist.transform_vector(thumb),
        }
    }
}
