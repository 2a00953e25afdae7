//! The score: which of several valid grasps a person would rather see.
//!
//! Comfort E of the thesis (4.6) plus what makes a hand look human. Each term is a number from 0 to 1, 1 being best, and
//! the score their weighted mean. The weights are the project's choice: they put what an onlooker notices first, fingers
//! and the place of the hand, before what only forces tell.

use glam::Vec3;

use super::{
    comfort::{comfort, digit_totals},
    stiffness::give,
};
use crate::{
    model::{
        forces::GRAVITY,
        grasp::{Contact, Grasp},
        grasp_type::Classification,
        hand::{Digit, HandPart, HandPose, kinematics::hand_frames, rig::Rig},
        object::GraspObject,
        score::{Score, TERMS, Term, Values},
    },
    physical::{
        immobility::firm_force,
        scene::{ObjectScene, Presented},
        solids::HandSolids,
    },
};

/// E at which comfort counts a third: of grasps valid by the thesis, half are below 0.04.
const UNCOMFORTABLE: f32 = 0.04;

/// Difference of two neighbouring fingers' flexion in radians, all joints together, at which they look unrelated: about
/// a third of a finger's range. Fingers move together (M. Santello, M. Flanders, J. Soechting, "Postural hand synergies
/// for tool use", 1998: two components explain 80 % of hand postures).
const UNRELATED_FLEXION: f32 = 1.2;

/// Newtons of weight that a person holds with each finger beside the thumb before taking one more: two fingers lift a
/// pen, and five a bottle (after the masses by grasp type of Feix, Bullock and Dollar, "Analysis of human grasping
/// behavior: object characteristics and grasp type", 2014).
const WEIGHT_PER_FINGER: f32 = 1.5;

/// Fingers that anything wants beside the thumb: between two digits, even what is light turns about the line from one to the
/// other. With 1, half of the holds of a scalpel that a simulation lost were such pinches.
const LEAST_FINGERS: f32 = 2.0;

/// Closure at which a hold looks safe, in multiples of what validity asks for.
const SAFE_CLOSURE: f32 = 6.0;

/// Ways in metres that an object gives when it is pushed with its weight: where a hold looks steady, and where it looks
/// loose. Between them, each time as far counts as much less.
const STEADY: [f32; 2] = [1e-5, 1e-3];

/// Confidence of a classification from which a grasp is beyond doubt of its type, …
const SURE_TYPE: f32 = 0.5;

/// … and what it counts right below that: nobody can name it.
const DOUBTFUL_TYPE: f32 = 0.6;

/// The strongest contact's force, over what all digits together press with to hold the object firmly, at which a hold
/// looks easy (the thumb bears half), and where it looks strained.
const EASY: [f32; 2] = [0.6, 2.0];

/// Distance from the giver's hand in metres from which nobody worries: half a hand's breadth.
const EASY_CLEARANCE: f32 = 0.04;

/// Distance from forbidden surfaces in metres from which nobody worries: two fingers' thickness.
const STERILE_CLEARANCE: f32 = 0.03;

/// Mean share of friction along the surface that pressing contacts use, in a hold that looks safe, and where it looks as if
/// it slips. Of what is known of a grip, this tells best whether a simulation by others loses it to pushes: of two grips of
/// which one is lost, it uses more in 69 of 100 cases (600 grips of the built-in objects).
const RUBBING: [f32; 2] = [0.25, 0.7];

/// Share of the pressing from which a contact matters to the reserve.
const MATTERING_SHARE: f32 = 0.05;

/// The term of comfort E, its value from 0 to 1.
pub fn comfort_value(comfort: f32) -> f32 {
    (-comfort / UNCOMFORTABLE).exp()
}

/// The values of the terms that follow from where a hand touches, without further ado; the others are 0.
pub fn posture_values(
    object: &GraspObject,
    rig: &Rig,
    pose: &HandPose,
    contacts: &[Contact],
    classification: Classification,
) -> Values {
    let mut values = [0.0; TERMS];
    values[Term::SharedFlexion as usize] = shared_flexion(pose);
    values[Term::EnoughDigits as usize] = enough_digits(object, contacts);
    values[Term::Pads as usize] = pads(rig, pose, contacts);
    values[Term::NaturalType as usize] = natural_type(classification);
    values
}

/// The values of the terms that depend on hand and object alone; the others are 0.
pub fn grip_values(
    scene: &ObjectScene<'_>,
    rig: &Rig,
    pose: &HandPose,
    contacts: &[Contact],
    classification: Classification,
    epsilon: f32,
    solids: &HandSolids,
) -> Values {
    let mut values = posture_values(scene.object, rig, pose, contacts, classification);
    values[Term::Closure as usize] = (epsilon / (SAFE_CLOSURE * scene.required_epsilon)).min(1.0);
    values[Term::Steadiness as usize] = steadiness(scene.object, rig, pose, contacts);
    values[Term::SterileDistance as usize] = sterile_distance(scene.object, solids);
    values
}

/// 0 without a type.
fn natural_type(classification: Classification) -> f32 {
    classification
        .grasp_type
        .map_or(0.0, |_| match classification.confidence / SURE_TYPE {
            sure if sure >= 1.0 => 1.0,
            share => DOUBTFUL_TYPE * share,
        })
}

/// The values of the terms that depend on the forces that balance gravity; the others are 0.
pub fn force_values(scene: &ObjectScene<'_>, contacts: &[Contact], forces: &[Vec3]) -> Values {
    let mut values = [0.0; TERMS];
    values[Term::Comfort as usize] = comfort_value(comfort(digit_totals(contacts, forces)));
    values[Term::FrictionReserve as usize] = friction_reserve(scene.friction, contacts, forces);
    values[Term::Ease as usize] = ease(scene, forces);
    values
}

fn ease(scene: &ObjectScene<'_>, forces: &[Vec3]) -> f32 {
    let strongest = forces.iter().map(|force| force.length()).fold(0.0, f32::max);
    let [easy, strained] = EASY;
    let weight = f64::from(scene.object.mass * GRAVITY);
    let share = strongest / firm_force(weight, f64::from(scene.friction)) as f32;
    ((strained / share).ln() / (strained / easy).ln()).clamp(0.0, 1.0)
}

/// 1 where contacts press, 0 where they would slip with a little more.
fn friction_reserve(friction: f32, contacts: &[Contact], forces: &[Vec3]) -> f32 {
    let pressing = || {
        contacts
            .iter()
            .zip(forces)
            .map(|(contact, &force)| (-force.dot(contact.normal), force, contact.normal))
    };
    let all: f32 = pressing().map(|(normal, ..)| normal).sum();
    let (mut used, mut count) = (0.0, 0.0_f32);
    for (normal, force, surface) in pressing().filter(|(normal, ..)| *normal > MATTERING_SHARE * all) {
        used += (force + surface * normal).length() / (friction * normal);
        count += 1.0;
    }
    let [safe, slipping] = RUBBING;
    ((slipping - used / count.max(1.0)) / (slipping - safe)).clamp(0.0, 1.0)
}

/// Adds what depends on how the object is held out to a grip's values.
pub fn score(
    grip_values: Values,
    grasp: &Grasp,
    scene: &ObjectScene<'_>,
    rig: &Rig,
    presented: &Presented,
) -> Score {
    let mut values = grip_values;
    let of_forces = force_values(scene, &grasp.contacts, &grasp.forces);
    for (value, of_forces) in values.iter_mut().zip(of_forces) {
        *value += of_forces;
    }
    let clearance = grasp.margins.and_then(|margins| margins.giver_clearance);
    values[Term::GiverClearance as usize] =
        clearance.map_or(1.0, |distance| (distance / EASY_CLEARANCE).min(1.0));
    values[Term::AwayFromGiver as usize] = away_from_giver(scene.object, rig, &grasp.pose, presented);
    Score { values }
}

fn shared_flexion(pose: &HandPose) -> f32 {
    let flexion = |digit: Digit| {
        let angles = pose.digits[digit.index()];
        angles.base_pitch + angles.second_pitch + angles.third_pitch
    };
    let worst = Digit::ALL[1..]
        .windows(2)
        .map(|pair| (flexion(pair[0]) - flexion(pair[1])).abs())
        .fold(0.0, f32::max);
    (1.0 - worst / UNRELATED_FLEXION).max(0.0)
}

fn enough_digits(object: &GraspObject, contacts: &[Contact]) -> f32 {
    let mut touching = [false; 5];
    let mut palm = false;
    for contact in contacts {
        match contact.part {
            HandPart::Phalanx(digit, _) => touching[digit.index()] = true,
            HandPart::Palm => palm = true,
        }
    }
    // The palm carries as much as two fingers.
    let fingers =
        touching[1..].iter().filter(|touches| **touches).count() as f32 + if palm { 2.0 } else { 0.0 };
    let wanted = 1.0 + object.mass * GRAVITY / WEIGHT_PER_FINGER;
    (fingers / wanted.clamp(LEAST_FINGERS, 4.0)).min(1.0)
}

/// 1 for what hardly moves, 0 for what hangs loose.
fn steadiness(object: &GraspObject, rig: &Rig, pose: &HandPose, contacts: &[Contact]) -> f32 {
    let way = object.mass * GRAVITY * give(rig, pose, contacts, object.centre_of_mass);
    let [steady, loose] = STEADY;
    ((loose / way).ln() / (loose / steady).ln()).clamp(0.0, 1.0)
}

/// How far the phalanges' contacts lie toward their palmar sides, on average; a contact on the back counts as none.
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

fn sterile_distance(object: &GraspObject, solids: &HandSolids) -> f32 {
    if object.forbidden_count() == 0 {
        return 1.0;
    }
    // By halves: nobody sees the difference of a few millimetres.
    let is_near = |distance: f32| {
        solids
            .iter()
            .any(|part| object.is_forbidden_within(part, distance))
    };
    if !is_near(STERILE_CLEARANCE) {
        1.0
    } else if !is_near(0.5 * STERILE_CLEARANCE) {
        0.6
    } else {
        0.2
    }
}

/// 1 if the palms lie on opposite sides of the centre of mass, seen from above, 0 if on the same side.
fn away_from_giver(object: &GraspObject, rig: &Rig, pose: &HandPose, presented: &Presented) -> f32 {
    let Some(giver) = presented.giver_palm else {
        return 1.0;
    };
    let flat = |v: Vec3| v.reject_from_normalized(presented.up).normalize_or_zero();
    let ours = flat(pose.frame_from_wrist.transform_point(rig.palm) - object.centre_of_mass);
    let theirs = flat(giver - object.centre_of_mass);
    0.5 - 0.5 * ours.dot(theirs)
}
