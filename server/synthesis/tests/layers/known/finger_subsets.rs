//! Known grips by a subset of their fingers, where a giver blocks the others, against comparing hands one by one.

use std::sync::Arc;

use grasp_synthesis::{
    known::{atlas::Atlas, entry::Entry},
    model::{
        grasp::{Contact, Grasp},
        hand::{Digit, DigitAngles, HandPose},
        holdout::Holdout,
    },
    physical::{
        grip::{GIVER_CLEARANCE, MAX_PENETRATION},
        immobility::{BALANCE_TOLERANCE, Buffers, EPSILON_TOLERANCE, SoftContact, epsilon},
        scene::ObjectScene,
        solids::{HandSolids, TaperedCapsule, TrackedSolids, clearance, self_clearance},
    },
    search::{GraspSource, SearchOutcome},
};

use crate::fixtures::{
    atlases::{complete_atlas, scissors_atlas_of, scissors_held_by, sparse},
    hands::right,
    holdouts::{UP, giver_solids},
    objects::object,
    proposals::object_scene,
    searches::Search,
};

/// Standard gravity.
const GRAVITY: f32 = 9.80665;

/// Torsion of a fingertip per newton and coefficient of friction, in metres.
const TORSION_LEVER: f32 = 0.0033;

fn search(holdout: &Holdout, known: &Arc<Atlas>, workers: usize) -> SearchOutcome {
    let search = Search {
        atlas: Some(Arc::clone(known)),
        workers,
        ..Search::guided(holdout, right())
    };
    search.run()
}

/// The sixteen subsets of fingers with the thumb, thumb first.
fn sets() -> impl Iterator<Item = [bool; 5]> {
    (0_u8..16).map(|set| std::array::from_fn(|digit| digit == 0 || set >> (digit - 1) & 1 == 1))
}

/// The epsilon of the contacts of some digits and the palm.
fn epsilon_of(contacts: &[Contact], kept: [bool; 5], scene: &ObjectScene<'_>) -> f32 {
    let is_kept = |contact: &&Contact| contact.part.digit().is_none_or(|digit| kept[digit.index()]);
    let soft: Vec<SoftContact> = contacts
        .iter()
        .filter(is_kept)
        .map(|contact| SoftContact {
            position: contact.position,
            normal: contact.normal,
            digit: contact.part.digit(),
            friction: scene.friction,
            torsion_radius: scene.friction * TORSION_LEVER,
        })
        .collect();
    epsilon(&soft, &scene.load(UP), 0.0, &mut Buffers::default())
}

#[test]
fn recorded_finger_subsets_are_those_with_closure() {
    let scene = object_scene(object("scissors"));
    let known = complete_atlas("scissors");
    let (mut closing, mut open) = (0, 0);
    for (place, entry) in known.entries().iter().enumerate().step_by(173) {
        let holding = entry.grip.bend_ratios.map(|ratio| ratio.is_some());
        for kept in sets() {
            let is_of_holding =
                kept[1..].contains(&true) && kept.iter().zip(holding).all(|(kept, holds)| !kept || holds);
            let is_set = entry.finger_subsets.contains(kept);
            if !is_of_holding {
                assert!(!is_set, "grip {place}, {kept:?}");
                continue;
            }
            // Epsilon is exact to its tolerance; within that, either answer is right.
            let bound = epsilon_of(&entry.contacts, kept, &scene);
            if bound >= scene.required_epsilon {
                closing += 1;
                assert!(is_set, "grip {place}, {kept:?}: {bound}");
            } else if bound < (1.0 - EPSILON_TOLERANCE) * scene.required_epsilon {
                open += 1;
                assert!(!is_set, "grip {place}, {kept:?}: {bound}");
            }
        }
    }
    assert!(closing >= 60 && open >= 60, "{closing} sets close, {open} do not");
}

/// Distance of some solids from a giver's, pair by pair.
fn distance<'a>(ours: impl Iterator<Item = &'a TaperedCapsule>, giver: &TrackedSolids) -> f32 {
    ours.flat_map(|ours| giver.iter().map(move |theirs| ours.distance(theirs)))
        .fold(f32::INFINITY, f32::min)
}

/// The holding digits that a giver does not block, and whether it blocks any digit; none if it blocks palm or forearm.
fn left(entry: &Entry, giver: &TrackedSolids) -> Option<([bool; 5], bool)> {
    let rig = right();
    let solids = HandSolids::of_pose(rig, &entry.grip.pose);
    let tracked = TrackedSolids::of_rig(rig, entry.grip.pose.frame_from_wrist, &solids);
    if distance(tracked.still().chain(&solids.thenar), giver) < GIVER_CLEARANCE {
        return None;
    }
    let is_met = solids
        .phalanges
        .map(|links| distance(links.iter(), giver) < GIVER_CLEARANCE);
    let holds = entry.grip.bend_ratios.map(|ratio| ratio.is_some());
    let left = std::array::from_fn(|digit| holds[digit] && !is_met[digit]);
    Some((left, is_met.contains(&true)))
}

fn pose_of_digits(pose: &HandPose, digits: [bool; 5]) -> HandPose {
    let mut pose = *pose;
    for (angles, keeps) in pose.digits.iter_mut().zip(digits) {
        if !keeps {
            *angles = DigitAngles::default();
        }
    }
    pose
}

/// Every check of a grasp, independently of the search.
pub(crate) fn assert_is_valid(grasp: &Grasp, holdout: &Holdout, giver: &TrackedSolids) {
    let rig = right();
    let object = &holdout.object;
    let solids = HandSolids::of_pose(rig, &grasp.pose);
    let tracked = TrackedSolids::of_rig(rig, grasp.pose.frame_from_wrist, &solids);
    let margins = grasp.margins.expect("it is physically valid");
    let off_giver = distance(tracked.iter(), giver);
    assert!(off_giver >= GIVER_CLEARANCE);
    assert!((margins.giver_clearance.expect("there is a giver") - off_giver).abs() < 1e-5);
    assert!(self_clearance(&solids) >= 0.0);
    let deepest = solids
        .iter()
        .map(|solid| clearance(solid, &object.surface, 0.0))
        .fold(0.0, f32::min);
    assert!((deepest + margins.penetration).abs() < 1e-6 && -deepest <= MAX_PENETRATION);

    let weight = object.mass * GRAVITY;
    let force: glam::Vec3 = grasp.forces.iter().sum();
    assert!((force - UP * weight).length() <= BALANCE_TOLERANCE * weight * 1.01);
    let scene = object_scene(object);
    let closure = epsilon_of(&grasp.contacts, [true; 5], &scene);
    assert!(closure >= (1.0 - EPSILON_TOLERANCE) * scene.required_epsilon);
}

#[test]
fn fingers_that_a_giver_blocks_are_lifted() {
    let known = complete_atlas("scissors");
    let (mut subsets, mut rejected, mut idle_only) = (0, 0, 0);
    for index in (0..known.entries().len()).step_by(109) {
        let entry = &known.entries()[index];
        let alone = scissors_atlas_of(vec![entry.clone()]);
        for giver in (0..known.entries().len()).step_by(61) {
            let holdout = scissors_held_by(&known, giver);
            let hand = giver_solids(&holdout);
            let found = search(&holdout, &alone, 1);
            let Some((left, is_any_met)) = left(entry, &hand) else {
                assert_eq!(found.grasp, None, "giver {giver}, grip {index}");
                continue;
            };
            let Some(grasp) = found.grasp else {
                // The rest does not hold, or blocked fingers have no room.
                rejected += usize::from(is_any_met);
                continue;
            };
            assert_is_valid(&grasp, &holdout, &hand);
            if !is_any_met {
                assert_eq!(found.report.source, Some(GraspSource::Atlas(0)));
                assert_eq!(grasp.pose, entry.grip.pose);
                continue;
            }
            assert_eq!(found.report.source, Some(GraspSource::FingerSubset(0)));
            subsets += 1;
            let fingers: Vec<usize> = (1..5).filter(|&finger| left[finger]).collect();
            let holds = entry.grip.bend_ratios.map(|ratio| ratio.is_some());
            let leaves_a_gap = fingers.windows(2).any(|pair| pair[1] != pair[0] + 1);
            assert!(
                left == holds || !leaves_a_gap,
                "giver {giver}, grip {index}: {left:?}"
            );
            assert!(entry.finger_subsets.contains(left), "giver {giver}, grip {index}");
            // The remaining digits stay in place, with their contacts.
            let touching = grasp.bend_ratios.map(|ratio| ratio.is_some());
            let of_left = |contact: &&Contact| contact.part.digit().is_none_or(|digit| left[digit.index()]);
            let kept: Vec<Contact> = entry.contacts.iter().filter(of_left).copied().collect();
            assert_eq!(grasp.contacts, kept);
            assert!(
                Digit::ALL
                    .iter()
                    .all(|digit| !touching[digit.index()] || left[digit.index()])
            );
            assert_eq!(
                pose_of_digits(&grasp.pose, left),
                pose_of_digits(&entry.grip.pose, left)
            );
            idle_only += usize::from(left == entry.grip.bend_ratios.map(|ratio| ratio.is_some()));
        }
    }
    assert!(
        subsets >= 20,
        "{subsets} grips hold by a subset, {rejected} do not"
    );
    assert!(
        (1..subsets).contains(&idle_only),
        "of {subsets}, {idle_only} lift idle fingers only"
    );
}

#[test]
fn subsets_answer_where_no_whole_grip_is_left_and_are_reproducible() {
    let known = complete_atlas("scissors");
    let few = sparse(&known);
    let mut answered = 0;
    for giver in (0..known.entries().len()).step_by(4) {
        let holdout = scissors_held_by(&known, giver);
        let found = search(&holdout, &few, 1);
        let Some(grasp) = found.grasp else { continue };
        let index = match found.report.source {
            Some(GraspSource::FingerSubset(index)) => index,
            Some(GraspSource::Atlas(_)) => continue,
            source => panic!("no attempt was allowed: {source:?}"),
        };
        assert_ne!(grasp.pose, few.entries()[usize::from(index)].grip.pose);
        answered += 1;
        assert_is_valid(&grasp, &holdout, &giver_solids(&holdout));
        for workers in [1, 3] {
            let again = search(&holdout, &few, workers);
            assert_eq!(
                (again.grasp.as_ref(), again.report.source),
                (Some(&grasp), Some(GraspSource::FingerSubset(index)))
            );
        }
    }
    assert!(answered >= 3, "{answered} are answered by subsets alone");
}
