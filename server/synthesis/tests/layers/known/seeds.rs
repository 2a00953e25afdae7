//! Known grips as seeds of attempts, for givers that no known grip keeps clear of.

use std::{collections::HashSet, sync::Arc};

use grasp_cases::cases;
use grasp_synthesis::{
    base::{
        random::AttemptStream,
        stop::{Stop, Stopped},
        stopwatch::Stopwatch,
    },
    known::{
        atlas::Atlas,
        entry::Entry,
        seed_source::SeedSource,
        seeds::{Seed, Seeds},
    },
    model::holdout::Holdout,
    physical::{
        barriers::Barriers,
        grip::GIVER_CLEARANCE,
        scene::Presented,
        shape::Proposal,
        solids::{HandSolids, TrackedSolids},
    },
    propose::proposal::propose,
    search::{SearchOutcome, physical_attempt::PhysicalAttempt},
};

use crate::fixtures::{
    atlases::{complete_atlas, scissors_held_by, tight_givers},
    hands::right,
    holdouts::{UP, giver_solids},
    proposals::{pairs_free_of, place_near_giver, surroundings},
    searches::Search,
};

/// Distance of palm, forearm, thumb and some fingers from the giver, pair by pair.
fn clearance(entry: &Entry, kept: [bool; 5], giver: &TrackedSolids) -> f32 {
    let solids = HandSolids::of_pose(right(), &entry.grip.pose);
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

/// [`clearance`] of the holding finger subset that is farthest from the giver.
fn farthest_clearance(entry: &Entry, giver: &TrackedSolids) -> f32 {
    (1_u8..16)
        .map(|set| std::array::from_fn(|digit| digit == 0 || set >> (digit - 1) & 1 == 1))
        .filter(|kept| entry.finger_subsets.contains(*kept))
        .map(|kept| clearance(entry, kept, giver))
        .fold(f32::NEG_INFINITY, f32::max)
}

fn entries_of(seeds: &Seeds) -> Vec<u16> {
    seeds.all().iter().map(|seed| seed.entry).collect()
}

#[test]
fn seeds_are_the_grips_nearest_to_clear_of_the_giver() {
    let (known, rig) = (complete_atlas("scissors"), right());
    for grip in [700, 0, 1400].into_iter().take(cases(3) as usize) {
        let holdout = scissors_held_by(&known, grip);
        let giver = giver_solids(&holdout);
        let presented = Presented::of(&holdout);
        let holding = &*known.holding_under(UP);
        let of = |order: &[u16]| {
            Seeds::of(
                known.grips(),
                rig,
                order.iter().copied(),
                presented.barriers(),
                Stop::NEVER,
            )
        };
        let seeds = of(holding).expect("nothing stops it");
        let mut clearances: Vec<f32> = holding
            .iter()
            .map(|&entry| farthest_clearance(&known.entries()[usize::from(entry)], &giver))
            .collect();
        clearances.sort_by(|a, b| b.total_cmp(a));
        // Without a giver, as many of the best.
        let without_giver = Seeds::of(
            known.grips(),
            rig,
            holding.iter().copied(),
            Barriers::NONE,
            Stop::NEVER,
        );
        let best = entries_of(&without_giver.expect("nothing stops it"));
        assert!(best.len() >= 32 && holding.starts_with(&best));
        assert_eq!(seeds.all().len(), best.len());
        let distinct: HashSet<u16> = entries_of(&seeds).into_iter().collect();
        assert_eq!(distinct.len(), seeds.all().len());
        for (&Seed { entry, kept }, expected) in seeds.all().iter().zip(clearances) {
            let known = &known.entries()[usize::from(entry)];
            assert!(known.finger_subsets.contains(kept), "giver {grip}, {entry}");
            let found = clearance(known, kept, &giver);
            assert!(
                (found - expected).abs() < 1e-6,
                "giver {grip}, {entry}: {found}, not {expected}"
            );
        }
        let stopped = Seeds::of(
            known.grips(),
            rig,
            holding.iter().copied(),
            presented.barriers(),
            Stop::when(&|| true),
        );
        assert_eq!(stopped, Err(Stopped));
        assert!(of(&[]).is_ok_and(|none| none.all().is_empty()));
    }
}

#[test]
fn perturbed_grips_hold_more_often_near_tight_givers() {
    const PROPOSALS: u64 = 150;
    let known = complete_atlas("scissors");
    let rig = right();
    let givers = tight_givers(&known, 60);
    assert!(givers.len() >= 3, "only {} givers are tight", givers.len());
    let (mut perturbed, mut fresh) = (0, 0);
    for grip in givers.into_iter().take(10) {
        let holdout = scissors_held_by(&known, grip);
        let presented = Presented::of(&holdout);
        let giver = presented.giver.as_ref().expect("there is a giver");
        let scissors = &holdout.object;
        let around = surroundings(scissors, &presented, rig);
        let holding = known.holding_under(UP).into_iter();
        let seeds = Seeds::of(known.grips(), rig, holding, presented.barriers(), Stop::NEVER);
        let seeds = seeds.expect("nothing stops it");
        let pairs = pairs_free_of(scissors, giver);
        let place = place_near_giver(scissors, rig, giver, &pairs);
        let mut attempt = PhysicalAttempt::default();
        let mut count = |propose: &dyn Fn(&mut AttemptStream) -> Option<Proposal>| {
            (0..PROPOSALS)
                .filter(|&index| {
                    let mut stream = AttemptStream::new(29, index);
                    let proposal = propose(&mut stream);
                    proposal.is_some_and(|proposal| {
                        let end = attempt.hold(&around, &proposal, &mut Stopwatch::off(), Stop::NEVER);
                        let clearance = end.ok().and_then(|grasp| grasp.margins?.giver_clearance);
                        assert!(clearance.is_none_or(|distance| distance >= GIVER_CLEARANCE));
                        clearance.is_some()
                    })
                })
                .count()
        };
        perturbed += count(&|stream| seeds.propose(known.entries(), &place, stream));
        fresh += count(&|stream| propose(&place, stream, Stop::NEVER));
    }
    assert!(perturbed >= 10, "only {perturbed} perturbed grips hold");
    assert!(
        perturbed > 4 * fresh,
        "{perturbed} perturbed and {fresh} fresh hands hold"
    );
}

fn search(
    holdout: &Holdout,
    seeds: Option<&Arc<Atlas>>,
    attempts: std::ops::Range<u64>,
    workers: usize,
) -> SearchOutcome {
    let search = Search {
        seeds: seeds.cloned().map_or(SeedSource::Nothing, SeedSource::Atlas),
        first_attempt: attempts.start,
        max_attempts: attempts.end - attempts.start,
        workers,
        ..Search::guided(holdout, right())
    };
    search.run()
}

#[test]
fn attempts_seeded_by_known_grips_are_reproducible() {
    let known = complete_atlas("scissors");
    let grip = *tight_givers(&known, 30).first().expect("one giver is tight");
    let holdout = scissors_held_by(&known, grip);
    // Early attempts use other seeds than later ones.
    for first in [0, 9] {
        let found = search(&holdout, Some(&known), first..2000, 1);
        let grasp = found.grasp.as_ref().expect("a perturbed grip holds");
        let attempt = found.report.attempt.expect("an attempt gave it");
        // The same for any number of workers, and for that attempt alone.
        let by_three = search(&holdout, Some(&known), first..2000, 3);
        assert_eq!(
            (by_three.grasp.as_ref(), by_three.report.attempt),
            (Some(grasp), Some(attempt))
        );
        let replayed = search(&holdout, Some(&known), attempt..attempt + 1, 1);
        assert_eq!(replayed.grasp.as_ref(), Some(grasp));
        // Without seeds, no earlier attempt holds.
        let nothing_known = search(&holdout, None, first..2000, 2);
        assert!(nothing_known.report.attempt.is_none_or(|first| first >= attempt));
        // No known grip is itself an answer.
        assert_eq!(found.report.candidates, 1);
    }
}
