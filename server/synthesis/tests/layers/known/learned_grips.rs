//! Learned grips: a grasp that a search found is found again where it still holds and nothing else does, and only there.

use crate::prelude::*;

/// The remote, held out by the hand of a known grip.
fn remote_held_out() -> Holdout {
    held_by("remote", &complete_atlas("remote").entries()[700].grip.pose)
}

/// The grasp of a search without known grips.
fn found_by_attempts(holdout: &Holdout) -> Grasp {
    guided(holdout)
        .max_attempts(2_000)
        .grasp()
        .expect("there is a grasp")
}

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
    // What screens them follows.
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
    let holdouts: Vec<Holdout> = (0..known.entries().len())
        .step_by(13)
        .map(|grip| scissors_held_by(&known, grip))
        .collect();
    // A grasp of each holdout by its atlas, learned one after the other.
    let grasps: Vec<Grasp> = holdouts
        .iter()
        .filter_map(|holdout| guided(holdout).atlas(&known).grasp())
        .collect();
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
fn a_learned_grip_is_found_again_with_the_same_forces_and_score() {
    let holdout = remote_held_out();
    let grasp = found_by_attempts(&holdout);
    for choice in [Choice::FirstValid, Choice::BestWithinBudget] {
        let again = of_learned(&holdout, std::slice::from_ref(&grasp))
            .choice(choice)
            .run();
        assert_eq!(again.report.source, Some(GraspSource::Learned(0)));
        assert_eq!(again.report.candidates, 1);
        assert_eq!(again.grasp.as_ref(), Some(&grasp));
    }
}

#[test]
fn a_learned_grip_is_no_answer_where_it_does_not_hold_or_may_not_be_used() {
    let holdout = remote_held_out();
    let grasp = found_by_attempts(&holdout);
    // A giver whose hand is where the receiver's would be.
    let in_the_way = held_by("remote", &grasp.pose);
    let within = |share: f32| {
        of_learned(&holdout, std::slice::from_ref(&grasp)).requirements(Requirements {
            worst_comfort: Some(share * grasp.comfort),
            ..Requirements::default()
        })
    };
    for (search, source) in [
        (of_learned(&in_the_way, std::slice::from_ref(&grasp)), None),
        (
            of_learned(&holdout, std::slice::from_ref(&grasp)).reproducible(true),
            None,
        ),
        (within(0.9), None),
        (within(1.1), Some(GraspSource::Learned(0))),
    ] {
        assert_eq!(search.run().report.source, source);
    }
}

#[test]
fn what_the_atlas_answers_does_not_change_with_what_is_learned() {
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
