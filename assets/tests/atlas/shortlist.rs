//! The grips that are tried first, against comparing hands one by one.

use std::sync::{Arc, atomic::AtomicBool};

use grasp_assets::atlases::atlas as built_in_atlas;
use grasp_synthesis::{
    known::{
        atlas::{Atlas, Listed},
        codec::decode,
        gravity::direction,
        grips::Grips,
        growth::Growth,
        recheck::Recheck,
        subset_grasps::subset_grasp,
    },
    model::{
        constraints::Constraints,
        hand::{Handedness, joints::HandJoints},
        holdout::Holdout,
        strategy::{Choice, Validity},
    },
    physical::{
        grip::{GIVER_CLEARANCE, Gripper},
        scene::{ObjectScene, Presented},
        solids::{PreparedHand, TrackedSolids},
    },
    rating::assessment::Surroundings,
    search::{GraspSource, SearchOutcome, find_grasp, settings::SearchSettings},
};

use crate::support::{NoClock, UP, adult, grown, held_out, known, object, reproducible, scissors};

/// Givers of an object that are asked: with 40, chance decides what is told.
const GIVERS: usize = 240;

/// Of which direction gravity comes.
const DIRECTION: usize = 20;

#[test]
fn more_givers_leave_one_of_the_shortlist_than_of_as_many_that_score_most() {
    let rig = adult(Handedness::Right);
    for name in ["remote", "scalpel", "scissors"] {
        let object = object(name);
        let bytes = built_in_atlas(name, rig).expect("it comes with the server");
        let atlas = decode(bytes, object, rig).expect("it is of today").atlas;
        let entries = atlas.entries();
        let up = direction(DIRECTION);
        let score = |&entry: &u16| entries[usize::from(entry)].scores[DIRECTION];
        let listed = |listed: &Listed| listed.entry;
        let list: Vec<u16> = atlas.shortlist(up).iter().map(listed).collect();
        assert!(list.is_sorted_by(|a, b| score(a) >= score(b)), "{name}");
        let holding = atlas.holding_under(up);
        assert!(list.iter().all(|entry| holding.contains(entry)), "{name}");

        // Other grips than those that the list was made with, which are every sixteenth.
        let (mut by_list, mut by_score, mut by_any) = (0, 0, 0);
        let (mut listed_scores, mut best_scores) = (0, 0);
        for giver in entries.iter().skip(7).step_by(entries.len() / GIVERS) {
            let joints = HandJoints::of_pose(rig, &giver.grip.pose);
            let hand = PreparedHand::new(&TrackedSolids::of_joints(&joints));
            let keeps_clear = |entry: &&u16| {
                let solids = entries[usize::from(**entry)].solids(rig);
                !hand.is_neared_by(solids.iter(), GIVER_CLEARANCE)
            };
            let listed = list.iter().find(keeps_clear);
            let best = holding.iter().find(keeps_clear);
            by_list += usize::from(listed.is_some());
            by_score += usize::from(holding[..list.len()].iter().any(|entry| keeps_clear(&entry)));
            by_any += usize::from(best.is_some());
            if let (Some(listed), Some(best)) = (listed, best) {
                listed_scores += u32::from(score(listed));
                best_scores += u32::from(score(best));
            }
        }
        // Of the givers that leave anything, those that leave none of the list are few beside those that leave none of the best.
        assert!(
            3 * (by_any - by_list) <= by_any - by_score,
            "{name}: {by_list} and {by_score} of {by_any}"
        );
        assert!(
            5 * by_list >= 4 * by_any,
            "{name}: {by_list} of {by_any} leave one of the list"
        );
        // What is found first must be nearly as good as what would be found in the end.
        assert!(
            listed_scores >= best_scores * 19 / 20,
            "{name}: {listed_scores} instead of {best_scores}"
        );
    }
}

#[test]
fn a_growing_atlas_has_a_shortlist_of_its_own() {
    let rig = adult(Handedness::Right);
    let object = object("remote");
    let atlas = grown(Growth::new(object, rig), 40).atlas;
    let up = direction(DIRECTION);
    let list = atlas.shortlist(up);
    assert!(!list.is_empty());
    let mut once: Vec<u16> = list.iter().map(|listed| listed.entry).collect();
    once.sort_unstable();
    once.dedup();
    assert_eq!(once.len(), list.len(), "a grip is listed once");
    let empty = Atlas::new(object, rig, Grips::default(), false);
    for atlas in [empty, Atlas::default()] {
        assert!(atlas.shortlist(up).is_empty());
    }
}

/// What comes of trying the known grips alone.
fn of_known_grips(holdout: &Holdout, known: &Arc<Atlas>, choice: Choice) -> SearchOutcome {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let settings = SearchSettings {
        choice,
        atlas: Some(Arc::clone(known)),
        reproducible: choice == Choice::FirstValid,
        ..reproducible(holdout)
    };
    let rig = adult(Handedness::Right);
    find_grasp(
        &pool.expect("a thread"),
        holdout,
        rig,
        &settings,
        &NoClock,
        &AtomicBool::new(false),
    )
}

/// For each known grip, whether it holds what is held out, and whether it does without the fingers that the giver is in the
/// way of.
fn which_hold(holdout: &Holdout, known: &Atlas) -> Vec<[bool; 2]> {
    let rig = adult(Handedness::Right);
    let scene = ObjectScene::new(&holdout.object, holdout.object.friction_under(Validity::Physical));
    let presented = Presented::of(holdout);
    let asked = Recheck::new(&scene, rig, &presented);
    let around = Surroundings {
        object: scene,
        presented: &presented,
        rig,
        constraints: &Constraints::default(),
    };
    let mut gripper = Gripper::default();
    let entries = known.entries().iter();
    entries
        .map(|entry| {
            let whole = asked.hold(entry, &entry.tracked_solids(rig), &mut gripper);
            let giver = presented.giver.as_ref();
            let sparing = giver.and_then(|giver| subset_grasp(entry, &around, giver, &mut gripper));
            [whole.is_some(), sparing.is_some()]
        })
        .collect()
}

#[test]
fn the_first_answer_beside_a_giver_is_the_first_of_the_shortlist_that_holds() {
    let known = known();
    let by_score = known.by_score(UP);
    let listed: Vec<u16> = known.shortlist(UP).iter().map(|listed| listed.entry).collect();
    let (mut on_list, mut beyond) = (0, 0);
    for giver in (0..known.entries().len()).step_by(450) {
        let holdout = held_out(&known, giver);
        let holds = which_hold(&holdout, &known);
        let holds_whole = |entry: &&u16| holds[usize::from(**entry)][0];
        let holds_sparing = |entry: &&u16| holds[usize::from(**entry)][1];
        let first = listed.iter().chain(by_score).find(holds_whole).copied();
        let Some(first) = first else {
            // Only then are fingers spared.
            let first = by_score.iter().find(holds_sparing);
            let found = of_known_grips(&holdout, &known, Choice::FirstValid);
            assert_eq!(
                found.report.source,
                first.copied().map(GraspSource::Atlas),
                "giver {giver}"
            );
            continue;
        };
        let found = of_known_grips(&holdout, &known, Choice::FirstValid);
        assert_eq!(
            found.report.source,
            Some(GraspSource::Atlas(first)),
            "giver {giver}"
        );
        // Where both orders begin alike, nothing is told of which it was.
        if Some(&first) != by_score.iter().find(holds_whole) {
            on_list += 1;
        }
        beyond += usize::from(!listed.contains(&first));
    }
    assert!(on_list >= 3, "{on_list} differ from the first by score");
    assert!(beyond >= 1, "none needs more than the list");
}

#[test]
fn without_a_giver_and_for_the_best_grips_are_tried_by_score_and_once() {
    let known = known();
    let afloat = scissors(None);
    let holds = which_hold(&afloat, &known);
    let first = known
        .by_score(UP)
        .iter()
        .find(|&&entry| holds[usize::from(entry)][0]);
    let found = of_known_grips(&afloat, &known, Choice::FirstValid);
    assert_eq!(found.report.source, first.copied().map(GraspSource::Atlas));

    let holdout = held_out(&known, 450);
    let holds = which_hold(&holdout, &known);
    let best = of_known_grips(&holdout, &known, Choice::BestWithinBudget);
    let count = |which: [bool; 2]| holds.iter().filter(|holds| **holds == which).count();
    let (whole, sparing) = (count([true, false]), count([false, true]));
    assert!(whole > 0 && sparing > 0, "the giver leaves {whole} and {sparing}");
    assert_eq!(count([true, true]), 0, "nothing is subset_grasp of what holds");
    assert_eq!(
        best.report.candidates,
        (whole + sparing) as u64,
        "each valid grip counts once"
    );
}
