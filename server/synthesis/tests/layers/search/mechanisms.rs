//! Mechanisms that are switched off make searches slower, never wrong.

use std::{sync::Arc, time::Duration};

use grasp_assets::primitives::held_primitives;
use grasp_synthesis::{
    base::mechanisms::{Mechanism, Mechanisms},
    known::{atlas::Atlas, grips::Grips, seed_source::SeedSource, transferred_grips::TransferredGrips},
    model::{
        hand::{Handedness, joints::HandJoints},
        holdout::{Holdout, PresentingHand},
        object::GraspObject,
    },
    physical::{grip::GIVER_CLEARANCE, scene::Presented, solids::TrackedSolids},
    search::{LookUp, SearchOutcome},
};

use crate::fixtures::{
    atlases::complete_atlas, clocks::FakeClock, grasps::assert_is_valid, hands::right, holdouts::UP,
    objects::object, searches::Search,
};

/// Attempts that suffice for an easy holdout, whatever is switched off.
const ATTEMPTS: u64 = 20_000;

/// Searches as the server does: a look at known grips, then a race.
fn search(search: &Search<'_>) -> SearchOutcome {
    let search = Search {
        reproducible: false,
        max_attempts: ATTEMPTS,
        ..search.clone()
    };
    match search.look_up(&FakeClock::default(), Duration::from_secs(1)) {
        LookUp::Found(outcome) => *outcome,
        LookUp::NotFound { tried } => Search {
            known_tried: tried,
            ..search
        }
        .run(),
    }
}

fn remote() -> Arc<GraspObject> {
    Arc::clone(object("remote"))
}

/// The complete atlas of the built-in remote, and some of it.
fn known() -> [Arc<Atlas>; 2] {
    let (rig, remote) = (right(), remote());
    let known = complete_atlas("remote");
    let few = known.entries().iter().step_by(90).cloned().collect();
    let few = Atlas::new(&remote, rig, Grips::new(rig, few), true);
    [known, Arc::new(few)]
}

/// The remote in the hand of a known grip: the one of some that most others keep clear of.
fn held_out(known: &Atlas) -> (Holdout, TrackedSolids) {
    let rig = right();
    let holdouts = known.entries().iter().step_by(300).map(|entry| {
        let joints = HandJoints::of_pose(rig, &entry.grip.pose);
        let solids = TrackedSolids::of_joints(&joints);
        let giver = PresentingHand::of_joints(joints);
        let holdout = Holdout::new(remote(), Some(giver), UP).expect("up is a unit vector");
        (holdout, solids)
    });
    let left = |holdout: &Holdout| {
        let giver = Presented::of(holdout).giver.expect("there is one");
        let others = known.entries().iter().step_by(20);
        others
            .filter(|other| {
                giver
                    .clearance(&other.tracked_solids(rig), GIVER_CLEARANCE)
                    .is_some()
            })
            .count()
    };
    let easiest = holdouts.max_by_key(|(holdout, _)| left(holdout));
    easiest.expect("there are grips")
}

/// What a search may know: all of an atlas, little of it, or grips of boxes alone.
fn searches(holdout: &Holdout) -> [(&'static str, Search<'_>); 3] {
    let [known, few] = known();
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig.handedness == Handedness::Right)
        .expect("there are grips of boxes for the right hand");
    let of_atlas = |atlas: &Arc<Atlas>| Search {
        seeds: SeedSource::Atlas(Arc::clone(atlas)),
        atlas: Some(Arc::clone(atlas)),
        ..Search::guided(holdout, right())
    };
    let of_boxes = Search {
        seeds: SeedSource::Transferred(Arc::new(TransferredGrips::of(&remote(), held))),
        ..Search::guided(holdout, right())
    };
    [
        ("all known", of_atlas(&known)),
        ("few known", of_atlas(&few)),
        ("boxes", of_boxes),
    ]
}

#[test]
fn a_search_without_any_one_mechanism_answers_with_a_valid_grasp() {
    let (holdout, giver) = held_out(&known()[0]);
    for (what, known) in searches(&holdout) {
        for off in Mechanism::ALL {
            let outcome = search(&Search {
                mechanisms: Mechanisms::ALL.without(off),
                ..known.clone()
            });
            let grasp = outcome
                .grasp
                .unwrap_or_else(|| panic!("{what}, without {off}: no grasp"));
            assert_is_valid(&grasp, &holdout, &giver);
        }
    }
}

#[test]
fn a_search_by_default_runs_every_mechanism() {
    let (holdout, _) = held_out(&known()[0]);
    for (what, known) in searches(&holdout) {
        let default = Search {
            mechanisms: Mechanisms::default(),
            ..known.clone()
        };
        let [all, default] = [known, default].map(|settings| search(&settings));
        assert_eq!(all.grasp, default.grasp, "{what}");
        assert_eq!(all.report.source, default.report.source, "{what}");
    }
}

#[test]
fn a_search_without_the_atlas_look_up_answers_from_an_attempt() {
    let [known, _] = known();
    let (holdout, _) = held_out(&known);
    let outcome = search(&Search {
        atlas: Some(known),
        mechanisms: Mechanisms::ALL.without(Mechanism::AtlasLookUp),
        ..Search::guided(&holdout, right())
    });
    assert!(outcome.report.attempt.is_some(), "{:?}", outcome.report.source);
}
