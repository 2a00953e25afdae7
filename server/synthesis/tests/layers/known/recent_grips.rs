//! Recent grips: a grasp that was found once is found again where it still holds, and only there.

use std::sync::Arc;

use grasp_synthesis::{
    known::{entry::Entry, recent_grips::RecentGrips},
    model::{constraints::Constraints, grasp::Grasp, holdout::Holdout, strategy::Choice},
    search::{GraspSource, SearchOutcome},
};

use crate::fixtures::{atlases::complete_atlas, hands::right, holdouts::held_by, searches::Search};

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

/// The outcome of trying an earlier grasp, and nothing else.
fn of_recent(holdout: &Holdout, grasp: &Grasp, adapt: impl FnOnce(&mut Search<'_>)) -> SearchOutcome {
    let recent = Entry::of_grasp(grasp).expect("it is physically valid");
    let mut search = Search {
        recent: RecentGrips::default().with(recent),
        reproducible: false,
        ..Search::guided(holdout, right())
    };
    adapt(&mut search);
    search.run()
}

#[test]
fn lists_newest_first_and_evicts_the_oldest() {
    let known = complete_atlas("scissors");
    let grips = known.entries();
    let mut recent = RecentGrips::default();
    assert!(recent.is_empty() && recent.without_oldest().is_empty());
    for grip in &grips[..40] {
        recent = recent.with(grip.clone());
    }
    let is_kept = |kept: &[Arc<Entry>], newest_first: &mut dyn Iterator<Item = &Entry>| {
        kept.iter().map(AsRef::as_ref).eq(newest_first)
    };
    assert!(is_kept(recent.entries(), &mut grips[8..40].iter().rev()));
    assert!(is_kept(
        recent.without_oldest().entries(),
        &mut grips[9..40].iter().rev()
    ));
    // A grip that is found again becomes the newest, and evicts no other.
    let again = recent.with(grips[20].clone());
    let others = grips[8..40].iter().rev().filter(|&grip| grip != &grips[20]);
    assert!(is_kept(
        again.entries(),
        &mut std::iter::once(&grips[20]).chain(others)
    ));
}

#[test]
fn a_recent_grip_is_found_again_with_the_same_forces_and_score() {
    let holdout = remote_held_out();
    let grasp = found_by_attempts(&holdout);
    for choice in [Choice::FirstValid, Choice::BestWithinBudget] {
        let again = of_recent(&holdout, &grasp, |search| search.choice = choice);
        assert_eq!(again.report.source, Some(GraspSource::Recent));
        assert_eq!((again.report.candidates, again.report.known_grips), (1, 0));
        assert_eq!(again.grasp.as_ref(), Some(&grasp));
    }
    // Grips of the atlas come first.
    let with_atlas = of_recent(&holdout, &grasp, |search| {
        search.atlas = Some(complete_atlas("remote"));
    });
    assert!(matches!(with_atlas.report.source, Some(GraspSource::Atlas(_))));
}

#[test]
fn a_recent_grip_is_no_answer_where_it_does_not_hold_or_is_excluded() {
    let holdout = remote_held_out();
    let grasp = found_by_attempts(&holdout);
    // A giver whose hand is where the receiver's would be.
    let in_the_way = held_by("remote", &grasp.pose);
    assert_eq!(of_recent(&in_the_way, &grasp, |_| {}).report.source, None);

    let reproducible = of_recent(&holdout, &grasp, |search| search.reproducible = true);
    assert_eq!(reproducible.report.source, None);
    for (share, source) in [(0.9, None), (1.1, Some(GraspSource::Recent))] {
        let found = of_recent(&holdout, &grasp, |search| {
            search.constraints = Constraints {
                worst_comfort: Some(share * grasp.comfort),
                ..Constraints::default()
            };
        });
        assert_eq!(found.report.source, source);
    }
}
