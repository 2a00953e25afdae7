//! The order in which known grips are tried, against comparing hands one by one.

use grasp_synthesis::physical::receiver::SUITABLE;

use crate::prelude::*;

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
    reaches(
        entry,
        &[
            (Term::Steadiness, 0.3),
            (Term::OffSharp, 1.0),
            (Term::OnHandle, 0.8),
        ],
    )
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
fn the_first_answer_is_the_first_of_the_best_grade() {
    let known = complete_atlas("scissors");
    let by_score = known.by_score(UP);
    let (mut by_value, mut lesser) = (0, 0);
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
        let listed = known.by_value(UP, |forearm| receiver.suits_forearm(forearm));
        let holds = valid_grips(&holdout, &known);
        let holding = |entry: &u16| holds[usize::from(*entry)].is_some();
        let best = by_score.iter().copied().filter(holding).map(grade).max();
        let is_best = |entry: &u16| holding(entry) && Some(grade(*entry)) == best;
        // By value, only the best grade is tried.
        let of_list = listed
            .iter()
            .copied()
            .find(|entry| holding(entry) && grade(*entry) == 4);
        let first = of_list.or_else(|| by_score.iter().copied().find(is_best));
        let found = of_known_grips(&holdout, &known, Choice::FirstValid);
        assert_eq!(
            found.report.source,
            first.map(GraspSource::Atlas),
            "giver {giver}"
        );
        let Some(first) = first else { continue };
        // Where both orders begin alike, they cannot be distinguished.
        if Some(first) != by_score.iter().copied().find(holding) {
            by_value += 1;
        }
        lesser += usize::from(best < Some(4));
    }
    assert!(by_value >= 3, "{by_value} differ from the first by score");
    assert!(lesser >= 1, "every giver leaves one that people choose");
}

#[test]
fn without_a_giver_grips_are_tried_by_score_and_the_best_counts_each_once() {
    let known = complete_atlas("scissors");
    let afloat = floating(Arc::clone(object("scissors")));
    let holds = valid_grips(&afloat, &known);
    let first = known
        .by_score(UP)
        .into_iter()
        .find(|&entry| holds[usize::from(entry)].is_some());
    let found = of_known_grips(&afloat, &known, Choice::FirstValid);
    assert_eq!(found.report.source, first.map(GraspSource::Atlas));

    let holdout = scissors_held_by(&known, 450);
    let holds = valid_grips(&holdout, &known);
    let best = of_known_grips(&holdout, &known, Choice::BestWithinBudget);
    let holding = holds.iter().flatten().count();
    assert!(holding > 0, "the giver leaves none");
    assert_eq!(
        best.report.candidates, holding as u64,
        "each valid grip counts once"
    );
}
