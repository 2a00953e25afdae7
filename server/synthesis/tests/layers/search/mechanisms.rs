//! Mechanisms that are switched off make searches slower, never wrong.

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use grasp_assets::{atlases, objects, primitives::held_primitives};
use grasp_synthesis::{
    known::{
        atlas::Atlas, codec::decode, grips::Grips, seed_source::SeedSource,
        transferred_grips::TransferredGrips,
    },
    mechanisms::{Mechanism, Mechanisms},
    model::{
        hand::{Handedness, joints::HandJoints},
        holdout::{Holdout, PresentingHand},
        object::GraspObject,
    },
    physical::{grip::GIVER_CLEARANCE, scene::Presented, solids::TrackedSolids},
    search::{LookUp, SearchOutcome, find_grasp, find_known_grasp, settings::SearchSettings},
};

use crate::{
    sparing::assert_is_valid,
    support::{NoClock, UP, adult, reproducible},
};

/// Attempts that suffice for an easy holdout, whatever is switched off.
const ATTEMPTS: u64 = 20_000;

/// Searches as the server does: a look at known grips, then a race.
fn search(holdout: &Holdout, settings: &SearchSettings) -> SearchOutcome {
    let rig = adult(Handedness::Right);
    let mut settings = SearchSettings {
        reproducible: false,
        max_attempts: ATTEMPTS,
        ..settings.clone()
    };
    match find_known_grasp(holdout, rig, &settings, &NoClock, Duration::from_secs(1)) {
        LookUp::Found(outcome) => *outcome,
        LookUp::NotFound { tried } => {
            settings.known_tried = tried;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
            let stop = AtomicBool::new(false);
            find_grasp(&pool.expect("a thread"), holdout, rig, &settings, &NoClock, &stop)
        }
    }
}

fn remote() -> Arc<GraspObject> {
    Arc::clone(&objects::object("remote").expect("it is built in").object)
}

/// What comes with the server for the built-in remote, and some of it.
fn known() -> [Arc<Atlas>; 2] {
    let (rig, remote) = (adult(Handedness::Right), remote());
    let bytes = atlases::atlas("remote", rig).expect("it is shipped");
    let known = decode(bytes, &remote, rig).expect("it is today's").atlas;
    let few = known.entries().iter().step_by(90).cloned().collect();
    let few = Atlas::new(&remote, rig, Grips::new(rig, few), true);
    [known, Arc::new(few)]
}

/// The remote in the hand of a known grip: the one of some that most others keep clear of.
fn held_out(known: &Atlas) -> (Holdout, TrackedSolids) {
    let rig = adult(Handedness::Right);
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

/// A holdout with a giver, and what a search may know: all of an atlas, little of it, or grips of boxes alone.
fn asked() -> (Holdout, TrackedSolids, [(&'static str, SearchSettings); 3]) {
    let [known, few] = known();
    let (holdout, giver) = held_out(&known);
    let (_, held) = held_primitives()
        .iter()
        .find(|(hand, _)| hand.rig.handedness == Handedness::Right)
        .expect("the right hand knows boxes");
    let of_atlas = |atlas: &Arc<Atlas>| SearchSettings {
        starts: SeedSource::Atlas(Arc::clone(atlas)),
        atlas: Some(Arc::clone(atlas)),
        ..reproducible(&holdout)
    };
    let of_boxes = SearchSettings {
        starts: SeedSource::Transferred(Arc::new(TransferredGrips::of(&remote(), held))),
        ..reproducible(&holdout)
    };
    let settings = [
        ("all known", of_atlas(&known)),
        ("few known", of_atlas(&few)),
        ("boxes", of_boxes),
    ];
    (holdout, giver, settings)
}

#[test]
fn a_search_without_any_one_mechanism_answers_with_a_valid_grasp() {
    let (holdout, giver, settings) = asked();
    for (what, settings) in settings {
        for off in Mechanism::ALL {
            let settings = SearchSettings {
                mechanisms: Mechanisms::ALL.without(off),
                ..settings.clone()
            };
            let grasp = search(&holdout, &settings).grasp;
            let grasp = grasp.unwrap_or_else(|| panic!("{what}, without {off}: no grasp"));
            assert_is_valid(&grasp, &holdout, &giver);
        }
    }
}

#[test]
fn a_search_by_default_runs_every_mechanism() {
    let (holdout, _, settings) = asked();
    for (what, settings) in settings {
        let default = SearchSettings {
            mechanisms: Mechanisms::default(),
            ..settings.clone()
        };
        let [all, default] = [settings, default].map(|settings| search(&holdout, &settings));
        assert_eq!(all.grasp, default.grasp, "{what}");
        assert_eq!(all.report.source, default.report.source, "{what}");
    }
}

#[test]
fn a_search_without_the_atlas_look_up_answers_from_an_attempt() {
    let [known, _] = known();
    let (holdout, _) = held_out(&known);
    let settings = SearchSettings {
        atlas: Some(known),
        mechanisms: Mechanisms::ALL.without(Mechanism::AtlasLookUp),
        ..reproducible(&holdout)
    };
    let outcome = search(&holdout, &settings);
    assert!(outcome.report.attempt.is_some(), "{:?}", outcome.report.source);
}
