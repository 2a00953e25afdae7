//! Known grips as seeds of attempts, for givers that no known grip keeps clear of.

use grasp_synthesis::known::seeds::{Seed, Seeds};

use crate::prelude::*;

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
        let holding = known.holding_under(UP);
        let of = |order: &[u16], barriers, is_over: bool| {
            Seeds::of(known.grips(), rig, order.iter().copied(), barriers, || is_over)
        };
        let seeds = of(holding, presented.barriers(), false).expect("not interrupted");
        let mut clearances: Vec<f32> = holding
            .iter()
            .map(|&entry| farthest_clearance(&known.entries()[usize::from(entry)], &giver))
            .collect();
        clearances.sort_by(|a, b| b.total_cmp(a));
        // Without a giver, as many of the best.
        let without_giver = of(holding, Barriers::NONE, false).expect("not interrupted");
        let best = entries_of(&without_giver);
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
        assert_eq!(of(holding, presented.barriers(), true), None);
        assert!(of(&[], presented.barriers(), false).is_some_and(|none| none.all().is_empty()));
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
        let holding = known.holding_under(UP).iter().copied();
        let seeds = Seeds::of(known.grips(), rig, holding, presented.barriers(), || false);
        let seeds = seeds.expect("not interrupted");
        let pairs = prepared(scissors)
            .surface_pairs()
            .free_of(Barriers::of_giver(giver));
        let place = ProposalContext {
            surface: &pairs,
            barriers: Barriers::of_giver(giver),
            ..place(scissors, rig)
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
        perturbed += count(&|stream| seeds.propose(known.entries(), &place, stream));
        fresh += count(&|stream| propose(&place, stream, &|| false));
    }
    assert!(perturbed >= 10 && perturbed > 4 * fresh, "{perturbed} {fresh}");
}

fn search(holdout: &Holdout, seeds: SeedSource, attempts: std::ops::Range<u64>) -> Search<'_> {
    guided(holdout)
        .seeds(seeds)
        .first_attempt(attempts.start)
        .max_attempts(attempts.end - attempts.start)
}

#[test]
fn attempts_seeded_by_known_grips_are_reproducible() {
    let known = complete_atlas("scissors");
    let grip = *tight_givers(&known, 30).first().expect("one giver is tight");
    let holdout = scissors_held_by(&known, grip);
    let seeds = || SeedSource::Atlas(Arc::clone(&known));
    // Early attempts use other seeds than later ones.
    for first in [0, 9] {
        let found = search(&holdout, seeds(), first..2000).run();
        let attempt = found.report.attempt.expect("a perturbed grip holds");
        // The same for any number of workers, and for that attempt alone.
        let by_three = search(&holdout, seeds(), first..2000).workers(3).run();
        assert_eq!(
            (&by_three.grasp, by_three.report.attempt),
            (&found.grasp, Some(attempt))
        );
        let replayed = search(&holdout, seeds(), attempt..attempt + 1).grasp();
        assert_eq!(replayed, found.grasp);
        // Without seeds, no earlier attempt holds.
        let nothing_known = search(&holdout, SeedSource::Nothing, first..2000)
            .workers(2)
            .run();
        assert!(nothing_known.report.attempt.is_none_or(|first| first >= attempt));
        // No known grip is itself an answer.
        assert_eq!(found.report.candidates, 1);
    }
}
