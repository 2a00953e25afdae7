//! Learned grips: a grasp that a search found is found again where it still holds and nothing else does, and only there.

use grasp_synthesis::{
    base::stop::Stopped,
    known::seeds::{Seed, Seeds},
};

use crate::prelude::*;

/// A search that may use earlier grasps, and nothing else.
fn of_learned<'a>(holdout: &'a Holdout, grasps: &[Grasp]) -> Search<'a> {
    guided(holdout).learned(learned(grasps)).reproducible(false)
}

#[test]
fn lists_oldest_first_and_drops_the_oldest() {
    const MOST: usize = 32;
    let known = complete_atlas("scissors");
    let grips = known.entries();
    let learn = |learned: Atlas, grip: &Entry| learned.with(right(), grip.clone(), MOST);
    let learned = grips[..40].iter().fold(Atlas::default(), learn);
    assert_eq!(learned.entries(), &grips[8..40]);
    // The data that screen them follow.
    assert_eq!(learned.grips(), &Grips::new(right(), grips[8..40].to_vec()));
    // A grip that is found again becomes the newest, and drops no other.
    let again = learn(learned.clone(), &grips[20]);
    let others = grips[8..40].iter().filter(|&grip| grip != &grips[20]);
    assert!(again.entries().iter().eq(others.chain([&grips[20]])));
    assert_ne!(learned.stamp(), again.stamp());
    // The same grips in the same order have the same stamp.
    let from_the_start = grips[8..40].iter().fold(Atlas::default(), learn);
    assert_eq!(from_the_start.stamp(), learned.stamp());
    assert!(learned.with(right(), grips[0].clone(), 0).is_empty());
}

#[test]
fn the_newest_valid_one_of_several_is_the_answer() {
    let known = shipped_atlas("scissors");
    let givers = (0..known.entries().len()).step_by(13);
    let holdouts: Vec<Holdout> = givers.map(|grip| scissors_held_by(&known, grip)).collect();
    // A grasp of each holdout by its atlas, learned one after the other.
    let by_atlas = holdouts.iter().map(|holdout| guided(holdout).atlas(&known));
    let grasps: Vec<Grasp> = by_atlas.filter_map(|search| search.grasp()).collect();
    let (mut answered, mut passed_over) = (0, 0);
    for holdout in &holdouts {
        let is_valid = |grasp: &Grasp| of_learned(holdout, std::slice::from_ref(grasp)).grasp().is_some();
        let outcome = of_learned(holdout, &grasps).run();
        let newest = learned(&grasps).entries().iter().rposition(|entry| {
            let mut of_entry = grasps.iter().filter(|grasp| grasp.pose == entry.grip.pose);
            of_entry.next().is_some_and(is_valid)
        });
        let found = newest.map(|index| GraspSource::Learned(index as u16));
        assert_eq!(outcome.report.source, found);
        answered += usize::from(newest.is_some());
        passed_over += newest.map_or(0, |index| learned(&grasps).entries().len() - 1 - index);
    }
    assert!(answered > 10 && passed_over > 10, "{answered} and {passed_over}");
}

#[test]
fn a_learned_grip_is_found_again_only_where_it_holds_and_may_be_used() {
    let holdout = held_by("remote", &complete_atlas("remote").entries()[700].grip.pose);
    let grasp = guided(&holdout).max_attempts(2_000).grasp();
    let grasp = [grasp.expect("there is a grasp")];
    let again = of_learned(&holdout, &grasp);
    for choice in [Choice::FirstValid, Choice::BestWithinBudget] {
        let outcome = again.clone().choice(choice).run();
        assert_eq!(outcome.report.source, Some(GraspSource::Learned(0)));
        assert_eq!(outcome.report.candidates, 1);
        assert_eq!(outcome.grasp.as_ref(), grasp.first());
    }
    // A giver whose hand is where the receiver's would be.
    let in_the_way = held_by("remote", &grasp[0].pose);
    let within = |share: f32| {
        again.clone().requirements(Requirements {
            worst_comfort: Some(share * grasp[0].comfort),
            ..Requirements::default()
        })
    };
    for (search, source) in [
        (of_learned(&in_the_way, &grasp), None),
        (again.clone().reproducible(true), None),
        (within(0.9), None),
        (within(1.1), Some(GraspSource::Learned(0))),
    ] {
        assert_eq!(search.run().report.source, source);
    }
}

#[test]
fn answers_of_the_atlas_do_not_change_with_learned_grips() {
    let known = complete_atlas("scissors");
    let (few, all) = (every(12, "scissors"), shipped_atlas("scissors"));
    let (mut by_atlas, mut by_learned) = (0, 0);
    for grip in (0..known.entries().len()).step_by(97) {
        let holdout = scissors_held_by(&known, grip);
        for atlas in [&few, &all] {
            let without = guided(&holdout).atlas(atlas).reproducible(false);
            let before = without.run();
            // Grips that are valid here, if any of the complete atlas are.
            let valid = without.clone().atlas(&known);
            let Some(valid) = valid.grasp() else { continue };
            let with = without.learned(learned([&valid]));
            let after = with.run();
            if before.grasp.is_some() {
                by_atlas += 1;
                assert_eq!((after.grasp, after.report), (before.grasp, before.report));
            } else {
                by_learned += 1;
                assert_eq!(after.report.source, Some(GraspSource::Learned(0)));
            }
        }
    }
    assert!(by_atlas > 20 && by_learned > 0, "{by_atlas} and {by_learned}");
}

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
    seeds.0.iter().map(|seed| seed.entry).collect()
}

#[test]
fn seeds_are_the_grips_nearest_to_clear_of_the_giver() {
    let (known, rig) = (complete_atlas("scissors"), right());
    for grip in [700, 0, 1400].into_iter().take(cases(3) as usize) {
        let holdout = scissors_held_by(&known, grip);
        let giver = giver_solids(&holdout);
        let presented = Presented::of(&holdout);
        let holding = &*known.holding_under(UP);
        let of = |order: &[u16], barriers, is_over: bool| {
            Seeds::of(
                known.grips(),
                rig,
                order.iter().copied(),
                barriers,
                Stop::when(&|| is_over),
            )
        };
        let seeds = of(holding, presented.barriers(), false).expect("nothing stops it");
        let mut clearances: Vec<f32> = holding
            .iter()
            .map(|&entry| farthest_clearance(&known.entries()[usize::from(entry)], &giver))
            .collect();
        clearances.sort_by(|a, b| b.total_cmp(a));
        // Without a giver, the same number of the best grips.
        let without_giver = of(holding, Barriers::NONE, false).expect("nothing stops it");
        let best = entries_of(&without_giver);
        assert!(best.len() >= 32 && holding.starts_with(&best));
        assert_eq!(seeds.0.len(), best.len());
        let distinct: HashSet<u16> = entries_of(&seeds).into_iter().collect();
        assert_eq!(distinct.len(), seeds.0.len());
        for (&Seed { entry, kept }, expected) in seeds.0.iter().zip(clearances) {
            let known = &known.entries()[usize::from(entry)];
            assert!(known.finger_subsets.contains(kept), "giver {grip}, {entry}");
            let found = clearance(known, kept, &giver);
            assert!(
                (found - expected).abs() < 1e-6,
                "giver {grip}, {entry}: {found}, not {expected}"
            );
        }
        assert_eq!(of(holding, presented.barriers(), true), Err(Stopped));
        assert!(of(&[], presented.barriers(), false).is_ok_and(|none| none.0.is_empty()));
    }
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
        let attempt = found.report.attempt().expect("a perturbed grip holds");
        // The grasp is the same for any number of workers, and for that attempt alone.
        let by_three = search(&holdout, seeds(), first..2000).workers(3).run();
        assert_eq!(
            (&by_three.grasp, by_three.report.attempt()),
            (&found.grasp, Some(attempt))
        );
        let replayed = search(&holdout, seeds(), attempt..attempt + 1).grasp();
        assert_eq!(replayed, found.grasp);
        // Without seeds, no earlier attempt holds.
        let nothing_known = search(&holdout, SeedSource::Nothing, first..2000)
            .workers(2)
            .run();
        assert!(
            nothing_known
                .report
                .attempt()
                .is_none_or(|first| first >= attempt)
        );
        // No known grip is itself an answer.
        assert_eq!(found.report.candidates, 1);
    }
}
