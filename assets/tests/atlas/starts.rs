//! Hands beside known grips, for givers of whom no known grip keeps clear.

use std::{
    collections::HashSet,
    sync::{Arc, atomic::AtomicBool},
};

use grasp_synthesis::{
    base::{random::AttemptStream, stopwatch::NoStopwatch},
    known::{
        atlas::Atlas,
        entry::Entry,
        seed_source::SeedSource,
        seeds::{Start, Starts},
    },
    base::mechanisms::Mechanisms,
    model::{constraints::Constraints, hand::Handedness, holdout::Holdout, strategy::Validity},
    physical::{
        grip::GIVER_CLEARANCE,
        scene::{ObjectScene, Presented},
        shape::Proposal,
        solids::{HandSolids, TrackedSolids},
    },
    propose::proposal::{Place, propose},
    rating::assessment::Surroundings,
    search::{SearchOutcome, find_grasp, physical_attempt::PhysicalAttempt, settings::SearchSettings},
};

use crate::support::{NoClock, UP, adult, held_out, known, reproducible, tight_givers};

/// How far palm, forearm, thumb and some fingers are from the giver's, pair by pair.
fn clearance(entry: &Entry, kept: [bool; 5], giver: &TrackedSolids) -> f32 {
    let solids = HandSolids::of_pose(adult(Handedness::Right), &entry.grip.pose);
    let of_digits = (0..5)
        .filter(|&digit| kept[digit])
        .flat_map(|digit| solids.phalanges[digit]);
    let still = solids.palm.into_iter().chain(solids.thenar).chain(solids.forearm);
    of_digits
        .chain(still)
        .flat_map(|ours| giver.iter().map(move |theirs| ours.distance(theirs)))
        .fold(f32::INFINITY, f32::min)
        .min(GIVER_CLEARANCE)
}

/// The same of those fingers that are farthest, of all that hold without the others.
fn farthest(entry: &Entry, giver: &TrackedSolids) -> f32 {
    (1_u8..16)
        .map(|set| std::array::from_fn(|digit| digit == 0 || set >> (digit - 1) & 1 == 1))
        .filter(|kept| entry.finger_subsets.contains(*kept))
        .map(|kept| clearance(entry, kept, giver))
        .fold(f32::NEG_INFINITY, f32::max)
}

fn entries_of(starts: &Starts) -> Vec<u16> {
    starts.all().iter().map(|start| start.entry).collect()
}

#[test]
fn starts_are_what_is_least_in_the_givers_way() {
    let (known, rig) = (known(), adult(Handedness::Right));
    for grip in [0, 700, 1400] {
        let holdout = held_out(&known, grip);
        let hand = holdout.presenting_hand.as_ref().expect("there is a giver");
        let giver = TrackedSolids::of_joints(&hand.joints);
        let presented = Presented::of(&holdout);
        let holding = known.holding_under(UP);
        let of = |order: &[u16]| {
            Starts::of(
                known.grips(),
                rig,
                order.iter().copied(),
                presented.giver.as_ref(),
                || false,
            )
        };
        let starts = of(holding).expect("nobody interrupts");
        let mut clearances: Vec<f32> = holding
            .iter()
            .map(|&entry| farthest(&known.entries()[usize::from(entry)], &giver))
            .collect();
        clearances.sort_by(|a, b| b.total_cmp(a));
        // Nobody in the way: the best ones, as many.
        let nobody = Starts::of(known.grips(), rig, holding.iter().copied(), None, || false);
        let best = entries_of(&nobody.expect("nobody interrupts"));
        assert!(best.len() >= 32 && holding.starts_with(&best));
        assert_eq!(starts.all().len(), best.len());
        let distinct: HashSet<u16> = entries_of(&starts).into_iter().collect();
        assert_eq!(distinct.len(), starts.all().len());
        for (&Start { entry, kept }, expected) in starts.all().iter().zip(clearances) {
            let known = &known.entries()[usize::from(entry)];
            assert!(known.finger_subsets.contains(kept), "giver {grip}, {entry}");
            let found = clearance(known, kept, &giver);
            assert!(
                (found - expected).abs() < 1e-6,
                "giver {grip}, {entry}: {found}, not {expected}"
            );
        }
        let interrupted = Starts::of(
            known.grips(),
            rig,
            holding.iter().copied(),
            presented.giver.as_ref(),
            || true,
        );
        assert_eq!(interrupted, None);
        assert!(of(&[]).is_some_and(|none| none.all().is_empty()));
    }
}

#[test]
fn hands_beside_known_grips_hold_more_often_where_a_giver_leaves_little() {
    const PROPOSALS: u64 = 150;
    let known = known();
    let rig = adult(Handedness::Right);
    let givers = tight_givers(&known, 30);
    assert!(givers.len() >= 3, "only {} givers are tight", givers.len());
    let (mut beside, mut beside_open, mut anew) = (0, 0, 0);
    for grip in givers.into_iter().take(10) {
        let holdout = held_out(&known, grip);
        let presented = Presented::of(&holdout);
        let giver = presented.giver.as_ref().expect("there is one");
        let scissors = &holdout.object;
        let around = Surroundings {
            object: ObjectScene::new(scissors, scissors.friction_under(Validity::Physical)),
            presented: &presented,
            rig,
            constraints: &Constraints::default(),
        };
        let holding = known.holding_under(UP).iter().copied();
        let excluded = known.excluded_by(giver);
        let mut open = holding.clone().filter(|&entry| !excluded.contains(entry));
        let starts = |of: &mut dyn Iterator<Item = u16>| {
            Starts::of(known.grips(), rig, of, Some(giver), || false).expect("nobody interrupts")
        };
        let (starts, open_starts) = (starts(&mut holding.clone()), starts(&mut open));
        let surface = scissors.surface_pairs.free_of(giver);
        let place = Place {
            object: scissors,
            surface: &surface,
            giver: Some(giver),
            rig,
            repertoire: None,
            mechanisms: Mechanisms::ALL,
        };
        let mut attempt = PhysicalAttempt::default();
        let mut count = |propose: &dyn Fn(&mut AttemptStream) -> Option<Proposal>| {
            (0..PROPOSALS)
                .filter(|&index| {
                    let mut stream = AttemptStream::new(29, index);
                    let proposal = propose(&mut stream);
                    proposal.is_some_and(|proposal| {
                        let end = attempt.hold(&around, &proposal, &mut NoStopwatch, &|| false);
                        let clearance = end.ok().and_then(|grasp| grasp.margins?.giver_clearance);
                        assert!(clearance.is_none_or(|distance| distance >= GIVER_CLEARANCE));
                        clearance.is_some()
                    })
                })
                .count()
        };
        beside += count(&|stream| starts.propose(known.entries(), &place, stream));
        beside_open += count(&|stream| open_starts.propose(known.entries(), &place, stream));
        anew += count(&|stream| propose(&place, stream, &|| false));
    }
    for (of, count) in [("known grips", beside), ("those that may be open", beside_open)] {
        assert!(count >= 10, "only {count} hold beside {of}");
        assert!(count > 4 * anew, "{count} hold beside {of} and {anew} others");
    }
}

fn search(
    holdout: &Holdout,
    starts: Option<&Arc<Atlas>>,
    attempts: std::ops::Range<u64>,
    workers: usize,
) -> SearchOutcome {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(workers)
        .build()
        .expect("threads");
    let settings = SearchSettings {
        starts: starts.cloned().map_or(SeedSource::Nothing, SeedSource::Atlas),
        first_attempt: attempts.start,
        max_attempts: attempts.end - attempts.start,
        workers,
        ..reproducible(holdout)
    };
    let rig = adult(Handedness::Right);
    find_grasp(&pool, holdout, rig, &settings, &NoClock, &AtomicBool::new(false))
}

#[test]
fn attempts_that_start_from_known_grips_are_as_reproducible_as_others() {
    let known = known();
    let grip = *tight_givers(&known, 30).first().expect("one giver is tight");
    let holdout = held_out(&known, grip);
    // The first attempts start from other known grips than later ones.
    for first in [0, 9] {
        let found = search(&holdout, Some(&known), first..2000, 1);
        let grasp = found.grasp.as_ref().expect("something beside a known grip holds");
        let attempt = found.report.attempt.expect("an attempt gave it");
        // However many look, and if that attempt alone is run.
        let by_three = search(&holdout, Some(&known), first..2000, 3);
        assert_eq!(
            (by_three.grasp.as_ref(), by_three.report.attempt),
            (Some(grasp), Some(attempt))
        );
        let replayed = search(&holdout, Some(&known), attempt..attempt + 1, 1);
        assert_eq!(replayed.grasp.as_ref(), Some(grasp));
        // Attempts that hold by themselves are the same with known grips and without.
        let nothing_known = search(&holdout, None, first..2000, 2);
        assert!(nothing_known.report.attempt.is_none_or(|first| first >= attempt));
        // No known grip is an answer itself.
        assert_eq!((found.report.known_grips, found.report.candidates), (0, 1));
    }
}
