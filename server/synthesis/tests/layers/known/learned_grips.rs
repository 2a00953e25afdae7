//! Learned grips: a grasp that a search found is found again where it still holds and nothing else does, and only there.

use std::sync::Arc;

use grasp_synthesis::{
    known::{atlas::Atlas, entry::Entry, grips::Grips},
    model::{grasp::Grasp, holdout::Holdout, requirements::Requirements, strategy::Choice},
    search::{GraspSource, SearchOutcome},
};

use crate::fixtures::{
    atlases::{complete_atlas, every, scissors_held_by, shipped_atlas},
    grasps::assert_is_valid,
    hands::right,
    holdouts::{giver_solids, held_by},
    searches::Search,
};

/// The remote, held out by the hand of a known grip.
fn remote_held_out() -> Holdout {
    held_by("remote", &complete_atlas("remote").entries()[700].grip.pose)
}

/// The grasp of a search without known grips.
fn found_by_attempts(holdout: &Holdout) -> Grasp {
    let search = Search {
        max_attempts: 2_000,
        ..Search::guided(holdout, right())
    };
    search.run().grasp.expect("there is a grasp")
}

fn learned(grasps: &[&Grasp]) -> Arc<Atlas> {
    let learn = |learned: Atlas, grasp: &&Grasp| {
        let entry = Entry::of_grasp(grasp).expect("it is physically valid");
        learned.with(right(), entry, grasps.len())
    };
    Arc::new(grasps.iter().fold(Atlas::default(), learn))
}

/// The outcome of trying an earlier grasp, and nothing else.
fn of_learned(holdout: &Holdout, grasp: &Grasp, adapt: impl FnOnce(&mut Search<'_>)) -> SearchOutcome {
    let mut search = Search {
        learned: Some(learned(&[grasp])),
        reproducible: false,
        ..Search::guided(holdout, right())
    };
    adapt(&mut search);
    search.run()
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
fn the_newest_valid_one_of_several_is_the_answer_and_passes_every_check() {
    let known = shipped_atlas("scissors");
    let holdouts = (0..known.entries().len())
        .step_by(13)
        .map(|grip| scissors_held_by(&known, grip));
    // A grasp of each holdout by its atlas, learned one after the other.
    let grasps: Vec<Grasp> = holdouts
        .clone()
        .filter_map(|holdout| {
            let search = Search {
                atlas: Some(Arc::clone(&known)),
                ..Search::guided(&holdout, right())
            };
            search.run().grasp
        })
        .collect();
    let all = learned(&grasps.iter().collect::<Vec<_>>());
    let (mut answered, mut passed_over) = (0, 0);
    for holdout in holdouts {
        let outcome = Search {
            learned: Some(Arc::clone(&all)),
            reproducible: false,
            ..Search::guided(&holdout, right())
        }
        .run();
        let Some(grasp) = outcome.grasp else { continue };
        let Some(GraspSource::Learned(index)) = outcome.report.source else {
            panic!("{:?}", outcome.report)
        };
        answered += 1;
        assert_is_valid(&grasp, &holdout, &giver_solids(&holdout));
        let newer = &all.entries()[usize::from(index) + 1..];
        for entry in newer {
            passed_over += 1;
            let alone = Atlas::default().with(right(), entry.clone(), 1);
            let search = Search {
                learned: Some(Arc::new(alone)),
                reproducible: false,
                ..Search::guided(&holdout, right())
            };
            assert!(search.run().grasp.is_none(), "a newer grip is valid");
        }
    }
    assert!(answered > 10 && passed_over > 10, "{answered} and {passed_over}");
}

#[test]
fn a_learned_grip_is_found_again_with_the_same_forces_and_score() {
    let holdout = remote_held_out();
    let grasp = found_by_attempts(&holdout);
    for choice in [Choice::FirstValid, Choice::BestWithinBudget] {
        let again = of_learned(&holdout, &grasp, |search| search.choice = choice);
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
    assert_eq!(of_learned(&in_the_way, &grasp, |_| {}).report.source, None);

    let reproducible = of_learned(&holdout, &grasp, |search| search.reproducible = true);
    assert_eq!(reproducible.report.source, None);
    for (share, source) in [(0.9, None), (1.1, Some(GraspSource::Learned(0)))] {
        let found = of_learned(&holdout, &grasp, |search| {
            search.requirements = Requirements {
                worst_comfort: Some(share * grasp.comfort),
                ..Requirements::default()
            };
        });
        assert_eq!(found.report.source, source);
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
            let without = Search {
                atlas: Some(Arc::clone(atlas)),
                reproducible: false,
                ..Search::guided(&holdout, right())
            };
            let before = without.run();
            // Grips that are valid here, if any of the complete atlas are.
            let valid = Search {
                atlas: Some(Arc::clone(&known)),
                ..without.clone()
            };
            let Some(valid) = valid.run().grasp else { continue };
            let with = Search {
                learned: Some(learned(&[&valid])),
                ..without
            };
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
