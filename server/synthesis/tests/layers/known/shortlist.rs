//! The shortlist of grips tried first, against comparing hands one by one.

use grasp_synthesis::{
    known::{atlas::Listed, gravity::direction},
    physical::receiver::SUITABLE,
};

use crate::prelude::*;

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
        assert!(5 * by_list >= 4 * by_any, "{name} {by_list} {by_any}");
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
    guided(holdout)
        .choice(choice)
        .atlas(known)
        .reproducible(choice == Choice::FirstValid)
        .run()
}

/// True if a grip is firm, off what is sharp, and on the handle, or nothing has one.
fn is_firm(entry: &Entry) -> bool {
    let firm = [
        (Term::Steadiness, 0.3),
        (Term::OffSharp, 1.0),
        (Term::OnHandle, 0.8),
    ];
    reaches(entry, &firm)
}

/// What people would not choose differently in a grip, as far as hand and object tell.
fn is_chosen(entry: &Entry) -> bool {
    entry.classification.is_clear()
        && is_firm(entry)
        && reaches(entry, &[(Term::EnoughDigits, 0.65), (Term::AcrossLongAxis, 0.5)])
}

fn reaches(entry: &Entry, least: &[(Term, f32)]) -> bool {
    least
        .iter()
        .all(|&(term, least)| entry.grip_values[term as usize] >= least)
}

#[test]
fn the_first_answer_is_the_first_of_the_best_grade_of_the_shortlist_and_beyond() {
    let known = complete_atlas("scissors");
    let by_score = known.by_score(UP);
    let shortlist = known.shortlist(UP);
    let (mut on_list, mut beyond, mut lesser) = (0, 0, 0);
    for giver in (0..known.entries().len()).step_by(120) {
        let holdout = scissors_held_by(&known, giver);
        let receiver = Presented::of(&holdout).receiver;
        let grade = |entry: u16| {
            let entry = &known.entries()[usize::from(entry)];
            match receiver.suits(right(), entry.grip.pose.frame_from_wrist) {
                suits if suits <= 0.0 => 0,
                suits if suits < SUITABLE => 1,
                _ => 2 + usize::from(is_firm(entry)) + usize::from(is_chosen(entry)),
            }
        };
        let listed: Vec<u16> = shortlist
            .by_value(|forearm| receiver.suits_forearm(forearm))
            .into_iter()
            .map(|place| shortlist.at(usize::from(place)).0)
            .collect();
        let holds = valid_grips(&holdout, &known);
        let holding = |entry: &u16| holds[usize::from(*entry)].is_some();
        let best = by_score.iter().copied().filter(holding).map(grade).max();
        let is_best = |entry: &u16| holding(entry) && Some(grade(*entry)) == best;
        // Of the list, only the best grade is tried.
        let of_list = listed
            .iter()
            .copied()
            .find(|entry| holding(entry) && grade(*entry) == 4);
        let first = of_list.or_else(|| by_score.iter().copied().find(is_best));
        let found = of_known_grips(&holdout, &known, Choice::FirstValid).report.source;
        assert_eq!(found, first.map(GraspSource::Atlas), "giver {giver}");
        let Some(first) = first else { continue };
        // Where both orders begin alike, they cannot be distinguished.
        if Some(first) != by_score.iter().copied().find(holding) {
            on_list += 1;
        }
        beyond += usize::from(!listed.contains(&first));
        lesser += usize::from(best < Some(4));
    }
    assert!(on_list >= 3, "{on_list} differ from the first by score");
    assert!(beyond >= 1, "none needs more than the list");
    assert!(lesser >= 1, "every giver leaves one that people choose");
}

#[test]
fn without_a_giver_grips_are_tried_by_score_and_the_best_counts_each_once() {
    let known = complete_atlas("scissors");
    let afloat = floating(Arc::clone(object("scissors")));
    let holds = valid_grips(&afloat, &known);
    let mut by_score = known.by_score(UP).iter();
    let first = by_score.find(|&&entry| holds[usize::from(entry)].is_some());
    let found = of_known_grips(&afloat, &known, Choice::FirstValid);
    assert_eq!(found.report.source, first.copied().map(GraspSource::Atlas));

    let holdout = scissors_held_by(&known, 450);
    let best = of_known_grips(&holdout, &known, Choice::BestWithinBudget);
    let holding = valid_grips(&holdout, &known).iter().flatten().count();
    assert!(holding > 0, "the giver leaves none");
    assert_eq!(best.report.candidates, holding as u64, "each counts once");
}
