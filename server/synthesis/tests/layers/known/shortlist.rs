//! The shortlist of grips tried first, against comparing hands one by one.

use std::sync::Arc;

use grasp_synthesis::{
    known::{
        atlas::{Atlas, Listed},
        gravity::direction,
        grips::Grips,
        recheck::GripChecker,
    },
    model::{hand::joints::HandJoints, holdout::Holdout, strategy::Choice},
    physical::{
        grip::{GIVER_CLEARANCE, Gripper},
        receiver::SUITABLE,
        scene::Presented,
        solids::{PreparedHand, TrackedSolids},
    },
    search::{GraspSource, SearchOutcome},
};

use crate::fixtures::{
    atlases::{complete_atlas, grown, growth, scissors_held_by},
    hands::right,
    holdouts::{UP, floating},
    objects::{OBJECT_NAMES, object},
    proposals::object_scene,
    searches::Search,
};

/// Givers per object; with 40, chance decides the result.
const GIVERS: usize = 240;

/// Index of the direction against gravity.
const DIRECTION: usize = 20;

#[test]
fn the_shortlist_serves_more_givers_than_the_best_scored_grips() {
    let rig = right();
    for name in OBJECT_NAMES {
        let atlas = complete_atlas(name);
        let entries = atlas.entries();
        let up = direction(DIRECTION);
        let score = |&entry: &u16| entries[usize::from(entry)].scores[DIRECTION];
        let listed = |listed: &Listed| listed.entry;
        let list: Vec<u16> = atlas.shortlist(up).iter().map(listed).collect();
        assert!(list.is_sorted_by(|a, b| score(a) >= score(b)), "{name}");
        let holding = atlas.holding_under(up);
        assert!(list.iter().all(|entry| holding.contains(entry)), "{name}");

        // The list was made with every sixteenth grip; these are others.
        let (mut by_list, mut by_score, mut by_any) = (0, 0, 0);
        let (mut listed_scores, mut best_scores) = (0, 0);
        for giver in entries.iter().skip(7).step_by(entries.len() / GIVERS) {
            let joints = HandJoints::of_pose(rig, &giver.grip.pose);
            let hand = PreparedHand::new(&TrackedSolids::of_joints(&joints));
            let keeps_clear = |entry: &&u16| {
                let solids = entries[usize::from(**entry)].solids(rig);
                !hand.comes_within(solids.iter(), GIVER_CLEARANCE)
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
        // Of the givers that leave any grip, far fewer leave none of the list than none of the best.
        assert!(
            3 * (by_any - by_list) <= by_any - by_score,
            "{name}: {by_list} and {by_score} of {by_any}"
        );
        assert!(
            5 * by_list >= 4 * by_any,
            "{name}: {by_list} of {by_any} leave one of the list"
        );
        // The first grip found must be nearly as good as the best one.
        assert!(
            listed_scores >= best_scores * 19 / 20,
            "{name}: {listed_scores} instead of {best_scores}"
        );
    }
}

#[test]
fn a_growing_atlas_has_its_own_shortlist() {
    let rig = right();
    let object = object("remote");
    let atlas = grown(growth(object, rig), 40).atlas;
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

/// The outcome of trying the known grips alone.
fn of_known_grips(holdout: &Holdout, known: &Arc<Atlas>, choice: Choice) -> SearchOutcome {
    let search = Search {
        choice,
        atlas: Some(Arc::clone(known)),
        reproducible: choice == Choice::FirstValid,
        ..Search::guided(holdout, right())
    };
    search.run()
}

/// For each known grip, whether it holds.
fn which_hold(holdout: &Holdout, known: &Atlas) -> Vec<bool> {
    let rig = right();
    let scene = object_scene(&holdout.object);
    let presented = Presented::of(holdout);
    let checker = GripChecker::new(&scene, rig, &presented);
    let mut gripper = Gripper::default();
    let entries = known.entries().iter();
    entries
        .map(|entry| {
            let grasp = checker.check(entry, &entry.tracked_solids(rig), &mut gripper);
            grasp.is_some()
        })
        .collect()
}

#[test]
fn the_first_answer_suits_the_receiver_and_is_the_first_such_of_the_shortlist() {
    let known = complete_atlas("scissors");
    let by_score = known.by_score(UP);
    let shortlist = known.shortlist(UP);
    let (mut on_list, mut beyond, mut unsuitable) = (0, 0, 0);
    for giver in (0..known.entries().len()).step_by(120) {
        let holdout = scissors_held_by(&known, giver);
        let receiver = Presented::of(&holdout).receiver;
        let suits = |entry: &u16, least: f32| {
            let forearm = known.entries()[usize::from(*entry)].forearm();
            receiver.suits_forearm(forearm) >= least
        };
        let listed: Vec<u16> = shortlist
            .by_value(|forearm| receiver.suits_forearm(forearm))
            .into_iter()
            .map(|place| shortlist.at(usize::from(place)).0)
            .collect();
        let holds = which_hold(&holdout, &known);
        let holds = |entry: &&u16| holds[usize::from(**entry)];
        let first = listed
            .iter()
            .chain(by_score)
            .find(|entry| holds(entry) && suits(entry, SUITABLE));
        let roughly = || by_score.iter().find(|entry| holds(entry) && suits(entry, 1e-9));
        let first = first
            .or_else(roughly)
            .or_else(|| by_score.iter().find(holds))
            .copied();
        let found = of_known_grips(&holdout, &known, Choice::FirstValid);
        assert_eq!(
            found.report.source,
            first.map(GraspSource::Atlas),
            "giver {giver}"
        );
        let Some(first) = first else { continue };
        // Where both orders begin alike, they cannot be distinguished.
        if Some(&first) != by_score.iter().find(holds) {
            on_list += 1;
        }
        beyond += usize::from(!listed.contains(&first));
        unsuitable += usize::from(!suits(&first, SUITABLE));
    }
    assert!(on_list >= 3, "{on_list} differ from the first by score");
    assert!(beyond >= 1, "none needs more than the list");
    assert!(unsuitable >= 1, "every giver leaves one that suits");
}

#[test]
fn without_a_giver_grips_are_tried_by_score_and_the_best_counts_each_once() {
    let known = complete_atlas("scissors");
    let afloat = floating(Arc::clone(object("scissors")));
    let holds = which_hold(&afloat, &known);
    let first = known
        .by_score(UP)
        .iter()
        .find(|&&entry| holds[usize::from(entry)]);
    let found = of_known_grips(&afloat, &known, Choice::FirstValid);
    assert_eq!(found.report.source, first.copied().map(GraspSource::Atlas));

    let holdout = scissors_held_by(&known, 450);
    let holds = which_hold(&holdout, &known);
    let best = of_known_grips(&holdout, &known, Choice::BestWithinBudget);
    let holding = holds.iter().filter(|holds| **holds).count();
    assert!(holding > 0, "the giver leaves none");
    assert_eq!(
        best.report.candidates, holding as u64,
        "each valid grip counts once"
    );
}
