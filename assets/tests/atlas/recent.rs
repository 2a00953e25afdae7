//! What searches found lately: a grasp that was found once is found again where it still holds, and only there.

use std::sync::{Arc, atomic::AtomicBool};

use grasp_assets::{atlases, objects};
use grasp_synthesis::{
    known::{atlas::Atlas, codec::decode, entry::Entry, recent_grips::RecentGrips},
    model::{
        constraints::Constraints,
        grasp::Grasp,
        hand::{HandPose, Handedness, joints::HandJoints},
        holdout::{Holdout, PresentingHand},
        strategy::Choice,
    },
    search::{GraspSource, SearchOutcome, find_grasp, settings::SearchSettings},
};

use crate::support::{NoClock, UP, adult, known, object, reproducible};

/// What comes with the server for the built-in remote.
fn known_of_remote() -> Arc<Atlas> {
    let rig = adult(Handedness::Right);
    let bytes = atlases::atlas("remote", rig).expect("it is shipped");
    decode(bytes, object("remote"), rig).expect("it is today's").atlas
}

/// The built-in remote in a hand.
fn remote_in(giver: &HandPose) -> Holdout {
    let remote = Arc::clone(&objects::object("remote").expect("it is built in").object);
    let giver = HandJoints::of_pose(adult(Handedness::Right), giver);
    Holdout::new(remote, Some(PresentingHand::of_joints(giver)), UP).expect("up is a unit vector")
}

/// The same in a hand that holds it by a grip of its atlas.
fn remote_held_out() -> Holdout {
    remote_in(&known_of_remote().entries()[700].grip.pose)
}

fn search(holdout: &Holdout, settings: &SearchSettings) -> SearchOutcome {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    find_grasp(
        &pool.expect("a thread"),
        holdout,
        adult(Handedness::Right),
        settings,
        &NoClock,
        &AtomicBool::new(false),
    )
}

/// What a search without any known grip finds.
fn found_afresh(holdout: &Holdout) -> Grasp {
    let settings = SearchSettings {
        max_attempts: 2_000,
        ..reproducible(holdout)
    };
    search(holdout, &settings).grasp.expect("there is a grasp")
}

/// What comes of trying a grasp that was found before, and nothing else.
fn of_recent(holdout: &Holdout, grasp: &Grasp, adapt: impl FnOnce(&mut SearchSettings)) -> SearchOutcome {
    let recent = Entry::of_grasp(grasp).expect("it is physically valid");
    let mut settings = SearchSettings {
        recent: RecentGrips::default().with(recent),
        reproducible: false,
        ..reproducible(holdout)
    };
    adapt(&mut settings);
    search(holdout, &settings)
}

#[test]
fn the_newest_come_first_and_the_oldest_go() {
    let known = known();
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
    // What is found again is the newest, and nothing else goes for it.
    let again = recent.with(grips[20].clone());
    let others = grips[8..40].iter().rev().filter(|&grip| grip != &grips[20]);
    assert!(is_kept(
        again.entries(),
        &mut std::iter::once(&grips[20]).chain(others)
    ));
}

#[test]
fn what_was_found_is_found_again_with_the_same_forces_and_score() {
    let holdout = remote_held_out();
    let grasp = found_afresh(&holdout);
    for choice in [Choice::FirstValid, Choice::BestWithinBudget] {
        let again = of_recent(&holdout, &grasp, |settings| settings.choice = choice);
        assert_eq!(again.report.source, Some(GraspSource::Recent));
        assert_eq!((again.report.candidates, again.report.known_grips), (1, 0));
        assert_eq!(again.grasp.as_ref(), Some(&grasp));
    }
    // The atlas' own, which were chosen from, come first.
    let with_atlas = of_recent(&holdout, &grasp, |settings| {
        settings.atlas = Some(known_of_remote());
    });
    assert!(matches!(with_atlas.report.source, Some(GraspSource::Atlas(_))));
}

#[test]
fn what_was_found_is_no_answer_where_it_does_not_hold_or_is_not_wanted() {
    let holdout = remote_held_out();
    let grasp = found_afresh(&holdout);
    // A giver whose hand is where the receiver's would be.
    let in_the_way = remote_in(&grasp.pose);
    assert_eq!(of_recent(&in_the_way, &grasp, |_| {}).report.source, None);

    let reproducible = of_recent(&holdout, &grasp, |settings| settings.reproducible = true);
    assert_eq!(reproducible.report.source, None);
    for (share, source) in [(0.9, None), (1.1, Some(GraspSource::Recent))] {
        let found = of_recent(&holdout, &grasp, |settings| {
            settings.constraints = Constraints {
                worst_comfort: Some(share * grasp.comfort),
                ..Constraints::default()
            };
        });
        assert_eq!(found.report.source, source);
    }
}
