//! Two hands that hold an object together.

use grasp_synthesis::{model::plain_object::SKIN_FRICTION, physical::hanging::MAX_SWING};

use crate::prelude::*;

const GRAVITY: f64 = 9.80665;

/// Torsion that a fingertip bears per newton and coefficient of friction, in metres.
const TORSION_LEVER: f64 = 0.0033;

const BALL_RADIUS: f32 = 0.12;

fn hands(grasp: &Grasp) -> [&Grasp; 2] {
    let other = grasp.other_hand.as_deref().expect("there are two hands");
    assert!(other.other_hand.is_none());
    [grasp, other]
}

fn solids(hands: [&Grasp; 2]) -> [TrackedSolids; 2] {
    let [right, left] = hands.map(|hand| &hand.pose);
    let rig = adult(Handedness::Left);
    let left = TrackedSolids::of_rig(rig, left.frame_from_wrist, &HandSolids::of_pose(rig, left));
    [tracked(right), left]
}

/// Every force inside its friction limit, and all of them against the weight, in double precision.
fn assert_forces_hold(grasp: &Grasp, object: &GraspObject) {
    let friction = f64::from(SKIN_FRICTION);
    let (mut force, mut torque, mut middle, mut count) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, 0.0);
    let centre = object.centre_of_mass.as_dvec3();
    for hand in hands(grasp) {
        assert!(hand.contacts.len() == hand.forces.len() && hand.contacts.len() == hand.torsions.len());
        let mut pressed = 0.0;
        for ((contact, &push), &torsion) in hand.contacts.iter().zip(&hand.forces).zip(&hand.torsions) {
            let (push, torsion) = (push.as_dvec3(), f64::from(torsion));
            let inward = -contact.normal.as_dvec3();
            let pressure = push.dot(inward);
            let sliding = (push - inward * pressure).length();
            let used = (sliding / friction).powi(2) + (torsion / (friction * TORSION_LEVER)).powi(2);
            let holds = pressure >= 0.0 && used <= (pressure * 1.0001 + 1e-6).powi(2);
            assert!(holds, "{push} slips");
            assert!(push.length() <= 27.0 * (1.0 + 1e-6));
            force += push;
            torque += (contact.position.as_dvec3() - centre).cross(push) + inward * torsion;
            middle += contact.position.as_dvec3();
            count += 1.0;
            pressed += pressure;
        }
        assert!(pressed > 0.0, "a hand does nothing");
    }
    let weight = f64::from(object.mass) * GRAVITY;
    let left = force - UP.as_dvec3() * weight;
    let tolerance = f64::from(BALANCE_TOLERANCE) * weight;
    assert!(left.length() <= tolerance * 1.01, "{left} is left");
    // Torque counts about the middle of the contacts, over up to 6 cm.
    let about_middle = torque - (middle / count - centre).cross(left);
    assert!(about_middle.length() <= tolerance * 0.06 * 1.05, "{about_middle}");
}

/// Hands clear of each other, not crossed, and no deeper than skin yields in a body with this signed distance, which is
/// exact to `slack` metres.
fn assert_hands_fit(grasp: &Grasp, signed_distance: impl Fn(Vec3) -> f32, slack: f32) {
    let [right, left] = solids(hands(grasp));
    for (ours, theirs) in right
        .iter()
        .flat_map(|ours| left.iter().map(move |theirs| (ours, theirs)))
    {
        for (a, a_radius) in balls(ours, 12) {
            for (b, b_radius) in balls(theirs, 12) {
                assert!(a.distance(b) > a_radius + b_radius, "the hands meet");
            }
        }
    }
    for (handedness, hand) in [(Handedness::Right, grasp), (Handedness::Left, hands(grasp)[1])] {
        for capsule in HandSolids::of_pose(adult(handedness), &hand.pose).iter() {
            for (centre, radius) in balls(capsule, 12) {
                let depth = radius - signed_distance(centre);
                assert!(depth <= MAX_PENETRATION + slack, "it is {depth} m deep");
            }
        }
        let is_on_surface = |contact: &Contact| signed_distance(contact.position).abs() <= slack;
        assert!(hand.contacts.iter().all(is_on_surface));
    }
    let fingers = |hand: &Grasp| hand.pose.frame_from_wrist.transform_vector(Vec3::Y);
    let [a, b] = hands(grasp);
    let cosine = fingers(a).dot(fingers(b));
    assert!(cosine > 110.0_f32.to_radians().cos() - 1e-4);
}

#[test]
fn both_hands_hold_a_ball_of_24_cm() {
    let mesh = Parts::default().sphere(Vec3::ZERO, BALL_RADIUS, 32, true).mesh();
    let ball = GraspObject::new(mesh, 2.0, Vec3::ZERO, None, &[]).expect("the object is sound");
    let holdout = floating(ball);
    for seed in 0..6 {
        let search = guided(&holdout).seed(seed).max_attempts(1000);
        let grasp = search.other_hand(adult(Handedness::Left)).grasp();
        let grasp = grasp.expect("both hands hold it");
        assert_forces_hold(&grasp, &holdout.object);
        // The mesh lies up to half a millimetre inside the ball.
        assert_hands_fit(&grasp, |point| point.length() - BALL_RADIUS, 6e-4);
        // The pair is no known grip, but each hand is one.
        assert!(Entry::of_grasp(&grasp).is_none() && Entry::of_grasp(hands(&grasp)[1]).is_some());
    }
}

const ROOM: f32 = 0.047;

fn only_hooks() -> Requirements {
    Requirements {
        allowed_types: Some(TypeSet::from_iter([GraspType::FixedHook])),
        ..Requirements::default()
    }
}

fn found(room: f32, up: Vec3, requirements: Requirements, attempts: u64) -> Option<Grasp> {
    let holdout = Holdout::new(lunch_box(room).into(), None, up).expect("up is a unit vector");
    guided(&holdout)
        .requirements(requirements)
        .max_attempts(attempts)
        .grasp()
}

/// Whether the forces hold the weight of a load that swings by no more than it may.
fn assert_holds(grasp: &Grasp, up: Vec3) {
    let weight = 1.5 * 9.81;
    let force: Vec3 = grasp.forces.iter().sum();
    assert!((force - up * weight).length() < 0.03 * weight, "{force}");
    let mut torque = Vec3::ZERO;
    for ((contact, force), torsion) in grasp.contacts.iter().zip(&grasp.forces).zip(&grasp.torsions) {
        let pressing = -force.dot(contact.normal);
        let rubbing = (force + contact.normal * pressing).length();
        assert!(pressing >= 0.0 && force.length() <= 27.001, "{force}");
        assert!(rubbing <= 0.6 * pressing * 1.001 + 1e-5, "{rubbing} {pressing}");
        torque += contact.position.cross(*force) - contact.normal * *torsion;
    }
    // The force acts along a vertical line that the centre of mass swings to.
    assert!(torque.dot(up).abs() < 0.02 * weight * 0.06, "{torque}");
    let line = up.cross(torque) / weight;
    let pivot_height = grasp.contacts[0].position.dot(up);
    let swing = line.length().atan2(pivot_height);
    assert!(swing <= MAX_SWING + 0.1, "{swing}");
}

#[test]
fn a_lunch_box_hangs_in_hooked_fingers() {
    let tilted = |axis: Vec3| Quat::from_axis_angle(axis, 20.0_f32.to_radians()) * Vec3::Y;
    for up in [Vec3::Y, tilted(Vec3::X), tilted(Vec3::NEG_X), tilted(Vec3::Z)] {
        for requirements in [only_hooks(), without_thumb()] {
            let grasp = found(ROOM, up, requirements, 3_000).unwrap_or_else(|| panic!("none under {up}"));
            assert!(grasp.hangs && requirements.admits(&grasp));
            assert_eq!(grasp.classification.grasp_type, Some(GraspType::FixedHook));
            assert_holds(&grasp, up);
            // Under another direction of gravity, the load would not be balanced.
            assert!(Entry::of_grasp(&grasp).is_none());
        }
    }
}

const HANDS: [&[Digit]; 4] = [
    &[Digit::Index, Digit::Middle, Digit::Ring],
    &[Digit::Middle, Digit::Ring, Digit::Little],
    &[Digit::Index, Digit::Little],
    &[Digit::Index, Digit::Middle],
];

fn missing(rig: &PreparedRig) -> impl Iterator<Item = Digit> {
    Digit::ALL.into_iter().filter(|&digit| !rig.has(digit))
}

#[test]
fn grasps_do_without_missing_fingers() {
    for fingers in HANDS {
        let rig = adult_with(fingers, Handedness::Right);
        let mut found = 0;
        for holdout in holdouts() {
            let held_out = holdout.to_holdout().expect("it is sound");
            let search = guided(&held_out).rig(&rig).max_attempts(400);
            let Some(grasp) = search.grasp() else { continue };
            found += 1;
            for digit in missing(&rig) {
                assert!(!touches(&grasp.contacts, digit), "{digit:?} of {fingers:?}");
                assert_eq!(grasp.bend_ratios[digit.index()], None);
            }
            let touches = |&finger: &Digit| touches(&grasp.contacts, finger);
            assert!(fingers.iter().any(touches), "{fingers:?}");
        }
        assert!(found >= 12, "{fingers:?}: {found}");
    }
}
