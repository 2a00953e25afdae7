//! Which grips an atlas keeps, and in which order they are tried.

use crate::prelude::*;
use grasp_synthesis::{
    known::{codec::encode, entry::SLIPS, gravity::DIRECTIONS, growth::CHOSEN},
    model::regions::suits_owner,
    physical::receiver::SUITABLE,
};

/// All that grew on the scissors, and what is kept of it.
static SCISSORS: LazyLock<(Grown, Grown)> = LazyLock::new(|| {
    let growth = grown_enough(object("scissors"));
    (growth.grown(), growth.kept())
});

fn grown_enough(object: &Arc<GraspObject>) -> Growth<'static> {
    let mut growth = growth(object, right());
    let mut gripper = Gripper::default();
    while !growth.is_enough() {
        growth.round(&mut gripper);
    }
    growth
}

/// Of givers and directions of gravity, how many leave one of the grips free that holds.
fn served(givers: &Atlas, grips: &[Entry]) -> usize {
    let of_giver = |giver: usize| {
        let holdout = scissors_held_by(givers, giver);
        let giver = Presented::of(&holdout).giver.expect("there is a giver");
        let is_clear = |grip: &&Entry| {
            giver
                .clearance(&grip.tracked_solids(right()), GIVER_CLEARANCE)
                .is_some()
        };
        let clear: Vec<&Entry> = grips.iter().filter(is_clear).collect();
        let is_served = |up: &usize| clear.iter().any(|grip| grip.scores[*up] != SLIPS);
        (0..DIRECTIONS).step_by(3).filter(is_served).count()
    };
    (0..givers.entries().len()).step_by(11).map(of_giver).sum()
}

#[test]
fn few_grips_serve_nearly_all_givers_that_all_serve() {
    let (all, kept) = &*SCISSORS;
    let (few, many) = (kept.atlas.entries(), all.atlas.entries());
    assert!(kept.atlas.is_complete() && few.len() == CHOSEN && many.len() > 2 * CHOSEN);
    assert!(few.iter().all(|grip| many.contains(grip)));
    let sum = |grip: &Entry| grip.scores.iter().map(|&score| u32::from(score)).sum::<u32>();
    assert!(few.is_sorted_by(|a, b| sum(a) >= sum(b)));
    let of_all = served(&all.atlas, many);
    let of_kept = served(&all.atlas, few);
    assert!(100 * of_kept >= 95 * of_all, "{of_kept} of {of_all}");
    // As many that were found first serve fewer.
    let of_first = served(&all.atlas, &many[..CHOSEN]);
    assert!(
        of_all - of_kept < (of_all - of_first) / 2,
        "{of_kept} and {of_first} of {of_all}"
    );
}

#[test]
fn what_is_kept_takes_less_than_300_kilobytes_and_is_read_as_it_was() {
    let (_, kept) = &*SCISSORS;
    assert!(kept.bytes() < 300_000, "{}", kept.bytes());
    let (object, rig) = (object("scissors"), right());
    let bytes = encode(kept, object, rig);
    assert_eq!(decode(&bytes, object, rig).as_ref(), Ok(kept));
}

#[test]
fn a_growth_that_is_not_enough_keeps_all() {
    let growth = grown_to(object("remote"), right(), 20);
    let (grown, kept) = (growth.grown(), growth.kept());
    assert_eq!(kept.atlas.entries(), grown.atlas.entries());
    assert!(!kept.atlas.is_complete() && kept.proposed() == grown.proposed());
}

#[test]
fn half_of_what_is_kept_holds_where_the_owner_wants_hands() {
    let end = Region {
        wish: Wish::Prefer,
        weight: 1.0,
        triangles: Vec::new(),
        zones: vec![half_space(Vec3::Y * 0.05, Vec3::Y)],
    };
    let plain = Arc::new(bar());
    let triangles = plain.mesh.triangles().len();
    let with_end = Arc::new(changed(&bar(), |plain| {
        plain.with_regions(Regions::new(&[end], triangles))
    }));
    let at_end = |object| {
        let kept = grown_enough(object).kept();
        let suits = |grip: &&Entry| suits_owner(&with_end.regions().values(&grip.contacts));
        kept.atlas.entries().iter().filter(suits).count()
    };
    let [chance, wanted] = [&plain, &with_end].map(at_end);
    assert!(wanted >= CHOSEN / 2 && 2 * chance < wanted, "{chance} {wanted}");
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
