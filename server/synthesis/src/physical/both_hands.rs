//! Two hands that hold an object together: closure and balance by the contacts of both, and whether they can belong to one body.

use glam::Vec3;

use super::{
    contacts::soften,
    grip::Grip,
    immobility::{Balance, Buffers, MAX_CONTACTS, SoftContact, balance, epsilon},
    presented::ObjectScene,
    solids::{FOREARM_LENGTH, HandSolids, PreparedHand, TrackedSolids},
};
use crate::{
    base::{
        pose::Pose,
        rejection::Rejection,
        stopwatch::{Step, Stopwatch},
    },
    model::{
        grasp::Contact,
        hand::{Handedness, rig::Rig},
    },
};

/// Clearance between a person's two hands and forearms, in metres. Larger values find fewer holds of small objects.
const HANDS_CLEARANCE: f32 = 0.001;

/// One of two hands that hold together.
#[derive(Clone, Debug)]
pub(crate) struct HalfGrip {
    /// The closed hand; its epsilon is 0.
    pub grip: Grip,
    /// Its solids.
    pub solids: HandSolids,
    /// Its contacts, in the order of [`crate::model::grasp::Grasp::contacts`].
    pub contacts: Vec<Contact>,
}

/// How two hands hold an object.
#[derive(Clone, Debug)]
pub(crate) struct SharedHold {
    /// Ferrari-Canny epsilon of all contacts.
    pub epsilon: f32,
    /// The same as a multiple of the required one.
    pub relative_closure: f32,
    /// Each hand's part of the forces that balance gravity, one entry per contact.
    pub balances: [Balance; 2],
}

impl HalfGrip {
    /// The hand and its forearm as another hand meets them.
    pub(crate) fn tracked(&self, rig: &Rig) -> TrackedSolids {
        TrackedSolids::of_rig(rig, self.grip.pose.frame_from_wrist, &self.solids)
    }
}

/// True if a hand and its forearm are clear of the same person's other ones.
pub(crate) fn are_clear(hand: &PreparedHand, other: &TrackedSolids) -> bool {
    !hand.comes_within(other.iter(), HANDS_CLEARANCE)
}

/// Closure, and forces that balance gravity, by all contacts of two hands. `up` is a unit vector against gravity, in the
/// object's frame.
///
/// # Errors
/// `NotImmobilizing` if the contacts have no closure or cannot bear the weight.
pub(crate) fn hold_together(
    scene: &ObjectScene<'_>,
    up: Vec3,
    halves: [&HalfGrip; 2],
    buffers: &mut Buffers,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<SharedHold, Rejection> {
    let bearing = bearing_contacts(halves.map(|half| half.contacts.as_slice()));
    let of_both = || bearing.iter().map(|&(hand, place)| &halves[hand].contacts[place]);
    let mut soft: Vec<SoftContact> = Vec::with_capacity(bearing.len());
    soften(of_both(), scene.friction, &mut soft);
    let load = scene.load(&soft, up);
    let required = scene.required_epsilon(&load.torque_scale);
    let epsilon = epsilon(&soft, &load, required, buffers);
    let is_closed = epsilon > 0.0 && epsilon >= required;
    let balance = is_closed.then(|| balance(&soft, &load, buffers)).flatten();
    stopwatch.lap(Step::ImmobilityValidation);
    let balance = balance.ok_or(Rejection::NotImmobilizing)?;
    let balances = [0, 1].map(|hand| {
        let count = halves[hand].contacts.len();
        let mut part = Balance {
            forces: vec![Vec3::ZERO; count],
            torsions: vec![0.0; count],
            ..balance
        };
        for (k, &(of_hand, place)) in bearing.iter().enumerate() {
            if of_hand == hand {
                part.forces[place] = balance.forces[k];
                part.torsions[place] = balance.torsions[k];
            }
        }
        part
    });
    Ok(SharedHold {
        epsilon,
        relative_closure: epsilon / required,
        balances,
    })
}

/// Hand and index of the contacts that bear load: at most [`MAX_CONTACTS`], without those closest to others of their hand.
fn bearing_contacts(contacts: [&[Contact]; 2]) -> Vec<(usize, usize)> {
    let mut bearing: Vec<(usize, usize)> = (0..2)
        .flat_map(|hand| (0..contacts[hand].len()).map(move |place| (hand, place)))
        .collect();
    while bearing.len() > MAX_CONTACTS {
        let position = |(hand, place): (usize, usize)| contacts[hand][place].position;
        let room = |&of: &(usize, usize)| {
            let others = bearing.iter().filter(|&&other| other != of && other.0 == of.0);
            others.fold(f32::INFINITY, |least, &other| {
                least.min(position(of).distance_squared(position(other)))
            })
        };
        let crowded = (0..bearing.len()).min_by(|&a, &b| room(&bearing[a]).total_cmp(&room(&bearing[b])));
        let Some(crowded) = crowded else { break };
        bearing.remove(crowded);
    }
    bearing
}

/// Cosine of the largest angle between the forearms: 110°. A wider one would embrace the object.
const MIN_FOREARM_COS: f32 = -0.342;

/// Range of a forearm's rise from the elbow to the wrist, as sines: from 58° down to 64° up.
const FOREARM_RISE: [f32; 2] = [-0.85, 0.9];

/// Sine of the least slope from the little finger's side up to the thumb's: forearms twist little past palm up and palm down.
const MIN_THUMB_RISE: f32 = -0.4;

/// Weight of the thumbs' side against the fingers' direction in where the body faces, for hands that reach up, down or inward.
const THUMB_WEIGHT: f32 = 0.5;

/// Shortest sum of the hands' horizontal directions that shows where the body faces.
const MIN_FACING: f32 = 0.3;

/// How far a hand may point back at its body: the cosine of 96°.
const MIN_FORWARD_COS: f32 = -0.1;

/// How far the right hand may be to the left of the left one, in metres: a finger's breadth, for hands one above the other.
const MAX_CROSSING: f32 = 0.02;

/// Range of the elbows' distance across the body, in metres: up to the width that shoulders and upper arms allow.
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
