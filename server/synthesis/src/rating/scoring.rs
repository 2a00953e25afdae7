//! The score: which of several valid grasps a viewer would prefer.
//!
//! It combines comfort E of the thesis (4.6) with traits that make a hand look human. Each term is in 0 to 1, 1 being best; the
//! score is their weighted mean. The weights are this project's choice: visible traits (fingers, placement of the hand) count more
//! than forces.
//!
//! People take objects across the long axis and near the centre of mass (R. Balasubramanian et al., "Physical human
//! interactive guidance: identifying grasping principles from human-planned grasps", 2012; J. Lukos, C. Ansuini and M. Santello,
//! "Choice of contact points during multidigit grasping", 2007), across a small dimension (T. Feix, I. Bullock and A. Dollar,
//! "Analysis of human grasping behavior: object characteristics and grasp type", 2014), at handles, and with the wrist near neutral
//! (D. Rosenbaum et al., "Requirements for action selection: overhand versus underhand grips", 1990).

use glam::Vec3;

use super::stiffness::compliance;
use crate::{
    base::{pose::Pose, ramp::ramp},
    model::{
        grasp::{COMFORTABLE_SHARES, Contact, GRAVITY, Grasp},
        grasp_type::{CLEAR_CONFIDENCE, Classification},
        hand::{Digit, HandPart, HandPose, kinematics::hand_frames, rig::Rig},
        object::{GraspObject, Parts},
        requirements::approach_direction,
        score::{Score, TERMS, Term, Values},
    },
    physical::{
        immobility::firm_force,
        presented::{ObjectScene, Presented},
        solids::HandSolids,
    },
};

/// E at which the comfort term drops to 1/e: the median of grasps under `THESIS` validity.
const COMFORT_SCALE: f32 = 0.04;

/// Difference in total flexion of neighbouring fingers, in radians, at which shared flexion scores 0: a third of a finger's
/// range.
const MAX_FLEXION_DIFFERENCE: f32 = 1.2;

/// Weight in newtons for which a person adds another finger, up to all five digits for a bottle (after the masses by grasp type
/// in Feix, Bullock and Dollar, "Analysis of human grasping behavior: object characteristics and grasp type", 2014).
const WEIGHT_PER_FINGER: f32 = 1.5;

/// Fewest fingers, besides the thumb, for a full score: between two digits, even a light object turns about the line through
/// them.
const MIN_FINGERS: f32 = 2.0;

/// Distance of the hand from the centre of mass, in metres, at which the weight counts double for its lever.
const LEVER: f32 = 0.06;

/// Masses in kilograms between which a load begins to call for the palm: things heavier than half a kilogram are mostly held in
/// power grasps (Feix, Bullock and Dollar 2014).
const PALM_MASSES: [f32; 2] = [0.4, 1.0];

/// Closures, as multiples of the minimum for validity, at which a hand is firm enough and at which more changes nothing.
const CLOSURES: [f32; 2] = [4.0, 6.0];

/// Steadiness, 0 to 1, that is firm enough.
const STEADY_ENOUGH: f32 = 0.65;

/// Value of closure and steadiness once they are firm enough: visible traits count more from there.
const FIRM: f32 = 0.8;

/// Displacements in metres under a push as large as the object's weight at which steadiness scores 1 and 0; logarithmic in
/// between.
const DISPLACEMENT_RANGE: [f32; 2] = [1e-5, 1e-3];

/// Value just below [`CLEAR_CONFIDENCE`], where the type is ambiguous; it decreases linearly to 0.
const AMBIGUOUS_TYPE_VALUE: f32 = 0.6;

/// Force of the strongest contact, relative to the total force of a firm hold, at which ease scores 1 and 0; logarithmic in
/// between. In an easy hold, the thumb bears half.
const EFFORT_RANGE: [f32; 2] = [0.6, 2.0];

/// Distance from the giver's hand that scores 1, in metres: half a hand's breadth.
const AMPLE_GIVER_CLEARANCE: f32 = 0.04;

/// Distance from forbidden surfaces that scores 1, in metres: the thickness of two fingers.
const AMPLE_STERILE_CLEARANCE: f32 = 0.03;

/// Mean share of the available friction in use at pressing contacts for which the friction reserve scores 1 and 0.
const FRICTION_USE_RANGE: [f32; 2] = [0.25, 0.7];

/// Minimum share of the total normal force for a contact to count in the friction reserve.
const MIN_NORMAL_SHARE: f32 = 0.05;

/// Value of the comfort term, 0 to 1, for E of Eq. 4.6.
pub(crate) fn comfort_value(comfort: f32) -> f32 {
    (-comfort / COMFORT_SCALE).exp()
}

/// Values of the terms that depend only on posture and contacts; the others are 0.
pub(crate) fn posture_values(
    object: &GraspObject,
    rig: &Rig,
    pose: &HandPose,
    contacts: &[Contact],
    classification: Classification,
) -> Values {
    let mut values = [0.0; TERMS];
    values[Term::SharedFlexion as usize] = shared_flexion(rig, pose);
    values[Term::EnoughDigits as usize] = enough_digits(object, contacts);
    values[Term::Pads as usize] = pads(rig, pose, contacts);
    values[Term::NaturalType as usize] = natural_type(classification);
    sum(values, choice_values(object, pose.frame_from_wrist, contacts))
}

/// The sum of the values of different terms.
pub fn sum(mut values: Values, others: Values) -> Values {
    for (value, other) in values.iter_mut().zip(others) {
        *value += other;
    }
    values
}

/// Values of the terms that depend only on hand and object, not on how it is presented; the others are 0. `relative_closure` is
/// the epsilon of the contacts as a multiple of the required one; for a hook, the height of the way out.
pub fn grip_values(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    pose: &HandPose,
    contacts: &[Contact],
    classification: Classification,
    relative_closure: f32,
    solids: &HandSolids,
) -> Values {
    let mut values = posture_values(scene.object, rig, pose, contacts, classification);
    values[Term::Closure as usize] = firm(relative_closure, CLOSURES);
    values[Term::Steadiness as usize] = firm(
        steadiness(scene.object, rig, pose, contacts),
        [STEADY_ENOUGH, 1.0],
    );
    values[Term::SterileDistance as usize] = sterile_distance(scene.object, solids);
    values
}

/// 0 without a type, rising with the confidence of one up to [`CLEAR_CONFIDENCE`].
fn natural_type(classification: Classification) -> f32 {
    classification
        .grasp_type
        .map_or(0.0, |_| match classification.confidence / CLEAR_CONFIDENCE {
            sure if sure >= 1.0 => 1.0,
            share => AMBIGUOUS_TYPE_VALUE * share,
        })
}

/// Values of the terms that depend on the forces that balance gravity; the others are 0.
pub(crate) fn force_values(scene: &ObjectScene<'_>, contacts: &[Contact], forces: &[Vec3]) -> Values {
    let mut values = [0.0; TERMS];
    values[Term::Comfort as usize] = comfort_value(comfort(digit_totals(contacts, forces)));
    values[Term::FrictionReserve as usize] = friction_reserve(scene.friction, contacts, forces);
    values[Term::Ease as usize] = ease(scene, forces);
    values
}

/// 1 if no contact has to press hard, relative to a firm hold; 0 if one is strained.
fn ease(scene: &ObjectScene<'_>, forces: &[Vec3]) -> f32 {
    let strongest = forces.iter().map(|force| force.length()).fold(0.0, f32::max);
    let [easy, strained] = EFFORT_RANGE;
    let weight = f64::from(scene.object.mass * GRAVITY);
    let share = strongest / firm_force(weight, f64::from(scene.friction)) as f32;
    ((strained / share).ln() / (strained / easy).ln()).clamp(0.0, 1.0)
}

/// 1 if the contacts are far from slipping, 0 if they are about to.
fn friction_reserve(friction: f32, contacts: &[Contact], forces: &[Vec3]) -> f32 {
    let pressing = || {
        contacts
            .iter()
            .zip(forces)
            .map(|(contact, &force)| (-force.dot(contact.normal), force, contact.normal))
    };
    let total: f32 = pressing().map(|(normal, ..)| normal).sum();
    let (mut used, mut count) = (0.0, 0.0_f32);
    for (normal, force, surface) in pressing().filter(|(normal, ..)| *normal > MIN_NORMAL_SHARE * total) {
        used += (force + surface * normal).length() / (friction * normal);
        count += 1.0;
    }
    let [safe, slipping] = FRICTION_USE_RANGE;
    ((slipping - used / count.max(1.0)) / (slipping - safe)).clamp(0.0, 1.0)
}

/// The score of a grasp: [`grip_values`] plus the terms that depend on how the object is presented.
pub fn score(
    grip_values: Values,
    grasp: &Grasp,
    scene: &ObjectScene<'_>,
    rig: &Rig,
    presented: &Presented,
) -> Score {
    let of_presentation = sum(
        force_values(scene, &grasp.contacts, &grasp.forces),
        upright_values(scene.object, grasp.pose.frame_from_wrist, presented.up),
    );
    let mut values = sum(grip_values, of_presentation);
    values[Term::Stance as usize] = presented.receiver.suits(rig, grasp.pose.frame_from_wrist);
    let clearance = grasp.margins.and_then(|margins| margins.giver_clearance);
    values[Term::GiverClearance as usize] =
        clearance.map_or(1.0, |distance| (distance / AMPLE_GIVER_CLEARANCE).min(1.0));
    values[Term::AwayFromGiver as usize] = away_from_giver(scene.object, rig, &grasp.pose, presented);
    Score {
        values,
        regions: scene.object.regions().values(&grasp.contacts),
    }
}

/// 1 if neighbouring fingers flex alike, 0 if some pair differs by [`MAX_FLEXION_DIFFERENCE`].
fn shared_flexion(rig: &Rig, pose: &HandPose) -> f32 {
    let flexion = |digit: Digit| {
        let angles = pose.digits[digit.index()];
        angles.base_pitch + angles.second_pitch + angles.third_pitch
    };
    let mut flexions = rig.fingers().map(flexion);
    let mut before = flexions.next().unwrap_or_default();
    let mut worst = 0.0_f32;
    for flexion in flexions {
        worst = worst.max((before - flexion).abs());
        before = flexion;
    }
    (1.0 - worst / MAX_FLEXION_DIFFERENCE).max(0.0)
}

/// [`FIRM`] once a measure suffices, and 1 once more changes nothing.
fn firm(measure: f32, [enough, ample]: [f32; 2]) -> f32 {
    FIRM * (measure / enough).min(1.0) + (1.0 - FIRM) * (measure / ample).min(1.0)
}

/// Touching digits as a share of those that the load demands: its weight, and its lever about the contacts.
fn enough_digits(object: &GraspObject, contacts: &[Contact]) -> f32 {
    let mut touching = [false; 5];
    let mut palm = false;
    for contact in contacts {
        match contact.part {
            HandPart::Phalanx(digit, _) => touching[digit.index()] = true,
            HandPart::Palm => palm = true,
        }
    }
    let lever = middle(contacts.iter()).distance(object.centre_of_mass);
    // The palm counts as two fingers.
    let fingers =
        touching[1..].iter().filter(|touches| **touches).count() as f32 + if palm { 2.0 } else { 0.0 };
    let wanted = 1.0 + object.mass * GRAVITY * (1.0 + lever / LEVER) / WEIGHT_PER_FINGER;
    let most = 4.0 + 2.0 * ramp(object.mass, PALM_MASSES);
    (fingers / wanted.clamp(MIN_FINGERS, most)).min(1.0)
}

/// 1 if the object hardly moves under a push as large as its weight, 0 if it is loose.
fn steadiness(object: &GraspObject, rig: &Rig, pose: &HandPose, contacts: &[Contact]) -> f32 {
    let displacement = object.mass * GRAVITY * compliance(rig, pose, contacts, object.centre_of_mass);
    let [steady, loose] = DISPLACEMENT_RANGE;
    ((loose / displacement).ln() / (loose / steady).ln()).clamp(0.0, 1.0)
}

/// Mean over the phalanges' contacts of the cosine between push and palmar direction; contacts on the back count 0.
fn pads(rig: &Rig, pose: &HandPose, contacts: &[Contact]) -> f32 {
    let frames = hand_frames(rig, pose);
    let mut sum = 0.0;
    let mut count = 0.0;
    for contact in contacts {
        if let HandPart::Phalanx(digit, phalanx) = contact.part {
            let frame = frames.digits[digit.index()].links[phalanx.index()];
            sum += (-contact.normal.dot(frame.transform_vector(Vec3::Z))).max(0.0);
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// 1 if the hand is well clear of forbidden surfaces, 0.2 if it is close; 1 for an object without any.
fn sterile_distance(object: &GraspObject, solids: &HandSolids) -> f32 {
    if object.forbidden_count() == 0 {
        return 1.0;
    }
    // Two thresholds suffice: a difference of a few millimetres is invisible.
    let is_near = |distance: f32| {
        solids
            .iter()
            .any(|part| object.is_forbidden_within(part, distance))
    };
    if !is_near(AMPLE_STERILE_CLEARANCE) {
        1.0
    } else if !is_near(0.5 * AMPLE_STERILE_CLEARANCE) {
        0.6
    } else {
        0.2
    }
}

/// 1 if the palms are on opposite sides of the centre of mass, seen from above; 0 if on the same side.
fn away_from_giver(object: &GraspObject, rig: &Rig, pose: &HandPose, presented: &Presented) -> f32 {
    let Some(giver) = presented.giver_palm else {
        return 1.0;
    };
    let flat = |v: Vec3| v.reject_from_normalized(presented.up).normalize_or_zero();
    let ours = flat(pose.frame_from_wrist.transform_point(rig.palm) - object.centre_of_mass);
    let theirs = flat(giver - object.centre_of_mass);
    0.5 - 0.5 * ours.dot(theirs)
}

/// Least value of the handle's term of a hand that holds a handle: nearly all contacts are on it.
pub(crate) const HELD_BY_HANDLE: f32 = 0.8;

/// Cosines of the angle between approach and long axis at which a hand comes across it, and from its end: 65° and 35°.
const END_ON: [f32; 2] = [0.42, 0.82];

/// Cosines of the angle at the object's middle between the wrist and the long axis at which the wrist is beside the object, and
/// beyond its end: 55° and 30°; and how much that counts next to the direction of the hand.
const BEYOND: [f32; 2] = [0.57, 0.87];
const BEYOND_WEIGHT: f32 = 0.6;

/// Offset of the contacts' middle from the centre of mass, as a share of half the object's length, up to which a hand is near and
/// from which it is far; and the offset in metres that is always near.
const OFFSET: [f32; 2] = [0.15, 0.9];
const NEAR: f32 = 0.015;

/// Distance of thumb and fingers, as a multiple of the object's smallest dimension, up to which they span that, and from which
/// they span quite another; and the least that counts as a dimension, in metres: a finger is thicker than a card.
const SPAN: [f32; 2] = [1.6, 4.0];
const MIN_DIMENSION: f32 = 0.015;

/// Slope of palm and approach, as sines: up to 10° upward is from the side, from 45° upward is from beneath.
const BENEATH: [f32; 2] = [0.17, 0.7];

/// Torques at the wrist in newton metres that are easy to bear, and that few bear with an outstretched hand (S. Hallbeck,
/// "Flexion and extension forces generated by wrist-dedicated muscles over the range of motion", 1994, and S. Delp et al.,
/// "Maximum isometric moments generated by the wrist muscles", 1996: 3 to 19 N·m of ten men).
const TORQUES: [f32; 2] = [1.0, 6.0];

/// Value of the handle's term for a hand with every second contact on the handle.
const HALF_ON_HANDLE: f32 = 0.7;

/// Values of the terms that depend on hand and object alone; the others are 0.
pub fn choice_values(object: &GraspObject, object_from_wrist: Pose, contacts: &[Contact]) -> Values {
    let parts = object.parts();
    let on_handle = on_handle(parts, contacts);
    let mut values = [0.0; TERMS];
    values[Term::AcrossLongAxis as usize] = across_long_axis(parts, object_from_wrist);
    // An object held by its handle need not be held near its centre.
    let near = near_centre(object, parts, contacts);
    values[Term::NearCentre as usize] = if parts.is_handled {
        near.max(on_handle)
    } else {
        near
    };
    values[Term::SmallSpan as usize] = small_span(parts, contacts);
    values[Term::OnHandle as usize] = on_handle;
    values[Term::OffSharp as usize] = off_sharp(parts, contacts);
    values
}

/// Values of the terms that depend on the direction against gravity, a unit vector, too; the others are 0.
pub fn upright_values(object: &GraspObject, object_from_wrist: Pose, up: Vec3) -> Values {
    let mut values = [0.0; TERMS];
    values[Term::FromSideOrAbove as usize] = from_side_or_above(object_from_wrist, up);
    values[Term::WristLoad as usize] = wrist_load(object, object_from_wrist, up);
    values
}

/// 1 if a hand comes across the long axis, or if there is none; 0 if it comes along it. A wrist beyond an end loses part of it.
pub fn across_long_axis(parts: &Parts, object_from_wrist: Pose) -> f32 {
    let along = approach_direction(object_from_wrist).dot(parts.long_axis).abs();
    let from_middle = (object_from_wrist.position - parts.middle).normalize_or_zero();
    let beyond = from_middle.dot(parts.long_axis).abs();
    let end_on = ramp(along, END_ON).max(BEYOND_WEIGHT * ramp(beyond, BEYOND));
    1.0 - parts.is_long * end_on
}

/// 1 if neither the palm faces up nor the hand moves up; 0 if it reaches beneath the object.
pub fn from_side_or_above(object_from_wrist: Pose, up: Vec3) -> f32 {
    let palm = object_from_wrist.transform_vector(Vec3::Z).dot(up);
    let approach = approach_direction(object_from_wrist).dot(up);
    1.0 - ramp(palm.max(approach), BENEATH)
}

/// 1 if the object's weight hardly turns the wrist, 0 if it does so more than a person bears.
fn wrist_load(object: &GraspObject, object_from_wrist: Pose, up: Vec3) -> f32 {
    let lever = (object.centre_of_mass - object_from_wrist.position).reject_from_normalized(up);
    1.0 - ramp(object.mass * GRAVITY * lever.length(), TORQUES)
}

/// 1 if the contacts' middle is near the centre of mass, 0 if it is at an end of the object.
fn near_centre(object: &GraspObject, parts: &Parts, contacts: &[Contact]) -> f32 {
    let offset = (middle(contacts.iter()) - object.centre_of_mass).length() - NEAR;
    1.0 - ramp(offset.max(0.0) / parts.half_length.max(NEAR), OFFSET)
}

/// 1 if thumb and fingers, or palm and fingers, are about as far apart as the object is thin.
fn small_span(parts: &Parts, contacts: &[Contact]) -> f32 {
    let is_finger = |contact: &&Contact| contact.part.digit().is_some_and(|digit| digit != Digit::Thumb);
    let opposing = || contacts.iter().filter(|contact| !is_finger(contact));
    if opposing().next().is_none() {
        return 1.0;
    }
    let span = middle(contacts.iter().filter(is_finger)).distance(middle(opposing()));
    1.0 - ramp(span / parts.smallest.max(MIN_DIMENSION), SPAN)
}

/// 1 if the object has no handle, or if nearly all contacts are on it; 0 if none is.
fn on_handle(parts: &Parts, contacts: &[Contact]) -> f32 {
    if !parts.is_handled {
        return 1.0;
    }
    let on = contacts
        .iter()
        .filter(|contact| parts.handles.contain(contact.position));
    let share = on.count() as f32 / contacts.len().max(1) as f32;
    if share < 0.5 {
        2.0 * HALF_ON_HANDLE * share
    } else {
        HALF_ON_HANDLE + 2.0 * (1.0 - HALF_ON_HANDLE) * (share - 0.5)
    }
}

/// 1 if no contact is sharp, 0 from two on.
fn off_sharp(parts: &Parts, contacts: &[Contact]) -> f32 {
    let sharp = contacts
        .iter()
        .filter(|contact| parts.sharp.are_near(contact.position));
    (1.0 - 0.6 * sharp.count() as f32).max(0.0)
}

/// The mean of contacts' positions; the origin without contacts.
pub(crate) fn middle<'a>(contacts: impl Iterator<Item = &'a Contact> + Clone) -> Vec3 {
    let count = contacts.clone().count().max(1) as f32;
    contacts.map(|contact| contact.position).sum::<Vec3>() / count
}

/// E of Eq. 4.6: squared distance of the digits' force shares from the comfortable ones; 0 is most comfortable.
///
/// `digit_totals` are force magnitudes, thumb first, in any unit; 0 for a digit without contact. E is 0 if all are: of two hands,
/// one may hold by its palm alone. D' are the comfortable shares of the touching digits, normalized to sum 1. The thesis leaves
/// the scale of f open; f is normalized likewise here, so that E does not depend on the object's weight.
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
