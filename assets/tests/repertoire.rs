//! Where a hand is known to have room at an object.

use std::sync::Arc;

use glam::Vec3;
use grasp_assets::{hands::hand, objects::object};
use grasp_synthesis::{
    base::{random::AttemptStream, stopwatch::NoStopwatch},
    base::mechanisms::Mechanisms,
    model::{
        constraints::Constraints,
        hand::{Digit, HandPose, Handedness, rig::Rig},
        object::GraspObject,
        strategy::Validity,
    },
    physical::{
        scene::{ObjectScene, Presented},
        solids::HandSolids,
    },
    propose::{
        placement_cache::{PlacementCache, ROWS},
        proposal::{Candidate, Place, propose},
    },
    rating::assessment::Surroundings,
    search::physical_attempt::PhysicalAttempt,
};

/// How deep a digit may be in what is thin, in metres; a palm, less.
const DEEPEST: f32 = 0.0075;

fn rig(side: Handedness) -> &'static Rig {
    &hand("adult", side).expect("the rig is built in").rig
}

fn built_in(name: &str) -> Arc<GraspObject> {
    Arc::clone(&object(name).expect("it is built in").object)
}

fn place<'a>(object: &'a GraspObject, repertoire: Option<&'a PlacementCache>) -> Place<'a> {
    Place {
        object,
        surface: &object.surface_pairs,
        giver: None,
        rig: rig(Handedness::Right),
        repertoire,
        mechanisms: Mechanisms::ALL,
    }
}

/// The hand of a candidate with its pads where they oppose each other, in the object's frame.
fn solids_of(rig: &Rig, candidate: &Candidate<'_>) -> HandSolids {
    let pose = HandPose {
        frame_from_wrist: candidate.object_from_wrist,
        digits: Digit::ALL.map(|digit| {
            let closed = candidate.opposition.closed[usize::from(digit != Digit::Thumb)];
            candidate.opposition.shape.flexing(rig, digit).closed_by(closed)
        }),
    };
    HandSolids::of_pose(rig, &pose)
}

#[test]
fn hands_have_room_at_the_object() {
    let rig = rig(Handedness::Left);
    for name in ["remote", "scalpel", "scissors"] {
        let object = built_in(name);
        let repertoire = object.repertoire(rig);
        let mut count = 0;
        for row in 0..ROWS {
            for candidate in repertoire.row(row, rig) {
                count += 1;
                let solids = solids_of(rig, &candidate);
                let closing = (0..5).filter(|&digit| candidate.opposition.shape.closing[digit]);
                let tips = closing.map(|digit| &solids.phalanges[digit][2]);
                for &vertex in object.surface.mesh().positions() {
                    let is_deep =
                        |middle: Vec3, radius: f32| middle.distance(vertex) < radius - DEEPEST - 1e-5;
                    for tip in tips.clone() {
                        assert!(!is_deep(tip.end, tip.radius_at(1.0)), "{name}: {candidate:?}");
                    }
                    for solid in solids.palm.iter().chain(&solids.forearm) {
                        assert!(
                            !is_deep(solid.at(0.6), solid.radius_at(0.6)),
                            "{name}: {candidate:?}"
                        );
                    }
                }
                // Its pads are where the object is as thick as they are apart, or nearly.
                let apart = candidate.opposition.width() - candidate.pair.thickness;
                assert!((-0.006..=0.012).contains(&apart), "{name}: {apart}");
            }
        }
        assert!(count > 8 * ROWS, "{name}: only {count}");
        assert_eq!(repertoire.row(ROWS, rig).count(), 0);
    }
}

#[test]
fn an_object_draws_for_each_hand_once() {
    let scissors = built_in("scissors");
    let (right, left) = (rig(Handedness::Right), rig(Handedness::Left));
    let first = scissors.repertoire(right);
    assert!(Arc::ptr_eq(&first, &scissors.repertoire(right)));
    // A copy of the object and one of the hand.
    assert!(Arc::ptr_eq(
        &first,
        &scissors.as_ref().clone().repertoire(&right.clone())
    ));
    assert_eq!(*first, PlacementCache::of(&scissors, right));
    assert_ne!(*first, *scissors.repertoire(left));
}

#[test]
fn of_many_hands_the_first_is_forgotten() {
    let remote = built_in("remote");
    let hands: Vec<Rig> = (0..5).map(|_| rig(Handedness::Left).mirrored()).collect();
    let first = remote.repertoire(&hands[0]);
    for hand in &hands[1..4] {
        remote.repertoire(hand);
    }
    assert!(Arc::ptr_eq(&first, &remote.repertoire(&hands[0])));
    remote.repertoire(&hands[4]);
    let again = remote.repertoire(&hands[0]);
    assert!(!Arc::ptr_eq(&first, &again));
    assert_eq!(first, again);
}

#[test]
fn later_attempts_draw_anew() {
    let scalpel = built_in("scalpel");
    let repertoire = scalpel.repertoire(rig(Handedness::Right));
    let proposed = |repertoire, attempt| {
        let mut stream = AttemptStream::new(3, attempt);
        propose(&place(&scalpel, repertoire), &mut stream, &|| false)
    };
    let (mut known, mut anew) = (0, 0);
    for attempt in 0..2 * ROWS {
        let same = proposed(Some(&*repertoire), attempt) == proposed(None, attempt);
        if attempt < ROWS {
            known += usize::from(!same);
        } else {
            anew += usize::from(same);
        }
    }
    assert_eq!(anew, ROWS as usize);
    // The others lay the palm on it, or prefer nothing.
    assert!(known > ROWS as usize / 2, "{known}");
}

#[test]
fn hands_that_are_known_to_have_room_hold_more_often() {
    // Of a remote there are many places where the hand has no room; a scalpel leaves it everywhere.
    for (name, more) in [("remote", 1.2), ("scalpel", 0.9)] {
        let object = built_in(name);
        let repertoire = object.repertoire(rig(Handedness::Right));
        let presented = Presented {
            giver: None,
            giver_palm: None,
            up: Vec3::Y,
        };
        let around = Surroundings {
            object: ObjectScene::new(&object, object.friction_under(Validity::Physical)),
            presented: &presented,
            rig: rig(Handedness::Right),
            constraints: &Constraints::default(),
        };
        let mut attempt = PhysicalAttempt::default();
        let mut held = |repertoire| {
            let place = place(&object, repertoire);
            (0..60 * ROWS)
                .filter(|index| {
                    let mut stream = AttemptStream::new(61 + index / ROWS, index % ROWS);
                    let proposal = propose(&place, &mut stream, &|| false);
                    proposal.is_some_and(|proposal| {
                        let end = attempt.hold(&around, &proposal, &mut NoStopwatch, &|| false);
                        end.is_ok()
                    })
                })
                .count()
        };
        let (known, anew) = (held(Some(&repertoire)), held(None));
        assert!(
            known as f32 > more * anew as f32,
            "{name}: {known} known to have room hold, {anew} anew"
        );
    }
}
