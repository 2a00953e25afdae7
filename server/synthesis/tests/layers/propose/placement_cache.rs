//! The placement cache: where a hand has room at an object.

use grasp_synthesis::propose::{
    placement_cache::{PlacementCache, ROWS},
    proposal::Candidate,
};

use crate::prelude::*;

/// How deep a digit may reach into a thin part, in metres; a palm less.
const DEEPEST: f32 = 0.0075;

/// A candidate's hand in the object's frame, with opposed pads.
fn solids_of(rig: &PreparedRig, candidate: &Candidate<'_>) -> HandSolids {
    let pose = hand_pose(
        candidate.object_from_wrist,
        Digit::ALL.map(|digit| {
            let closed = candidate.opposition.closed[usize::from(digit != Digit::Thumb)];
            candidate.opposition.shape.flexing(rig, digit).closed_by(closed)
        }),
    );
    HandSolids::of_pose(rig, &pose)
}

#[test]
fn cached_placements_leave_the_hand_room() {
    let rig = adult(Handedness::Left);
    for name in OBJECT_NAMES {
        let object = object(name);
        let cache = prepared(object).placement_cache(rig);
        let mut count = 0;
        for row in 0..ROWS {
            for candidate in cache.row(row, rig) {
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
                        let is_deep = is_deep(solid.at(0.6), solid.radius_at(0.6));
                        assert!(!is_deep, "{name}: {candidate:?}");
                    }
                }
                // Its pads are about as far apart as the object is thick there.
                let apart = candidate.opposition.width() - candidate.pair.thickness;
                assert!((-0.006..=0.012).contains(&apart), "{name}: {apart}");
            }
        }
        assert!(count > 8 * ROWS, "{name}: only {count}");
        assert_eq!(cache.row(ROWS, rig).count(), 0);
    }
}

#[test]
fn placements_are_drawn_once_per_object_and_hand() {
    let scissors = object("scissors");
    let (right, left) = (right(), adult(Handedness::Left));
    let cache = |rig: &PreparedRig| prepared(scissors).placement_cache(rig);
    let first = cache(right);
    assert!(Arc::ptr_eq(&first, &cache(right)));
    // Also for copies of the hand.
    assert!(Arc::ptr_eq(&first, &cache(&right.clone())));
    assert_eq!(*first, PlacementCache::of(prepared(scissors), right));
    assert_ne!(*first, *cache(left));
}

#[test]
fn evicts_the_first_of_too_many_hands() {
    // Other tests use the shared one with other hands.
    let remote = PreparedObject::new(Arc::clone(object("remote")));
    let scales = [1.0, 1.01, 1.02, 1.03, 1.04];
    let hands = scales.map(|scale| PreparedRig::new(adult(Handedness::Left).mirrored().scaled(scale)));
    let first = remote.placement_cache(&hands[0]);
    for hand in &hands[1..4] {
        remote.placement_cache(hand);
    }
    assert!(Arc::ptr_eq(&first, &remote.placement_cache(&hands[0])));
    remote.placement_cache(&hands[4]);
    let again = remote.placement_cache(&hands[0]);
    assert!(!Arc::ptr_eq(&first, &again));
    assert_eq!(first, again);
}

#[test]
fn attempts_beyond_the_cache_draw_as_without_it() {
    let scalpel = object("scalpel");
    let cache = prepared(scalpel).placement_cache(right());
    let proposed = |placements, attempt| {
        let place = ProposalContext {
            placements,
            ..place(scalpel, right())
        };
        propose(&place, &mut AttemptStream::new(3, attempt), Stop::NEVER)
    };
    let (mut cached, mut fresh) = (0, 0);
    for attempt in 0..2 * ROWS {
        let same = proposed(Some(&*cache), attempt) == proposed(None, attempt);
        if attempt < ROWS {
            cached += usize::from(!same);
        } else {
            fresh += usize::from(same);
        }
    }
    assert_eq!(fresh, ROWS as usize);
    // The others lay the palm on the object, or have no preference.
    assert!(cached > ROWS as usize / 2, "{cached}");
}
