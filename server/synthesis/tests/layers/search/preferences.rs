//! Of attempts close together, one that a person would choose wins, or else the one with the highest score.

use std::sync::Arc;

use grasp_synthesis::{
    model::{grasp::Grasp, holdout::Holdout, score::Term},
    search::SearchOutcome,
};

use crate::fixtures::{
    hands::right,
    holdouts::{floating, tracked_holdouts},
    objects::object,
    searches::{Search, pool},
};

/// Attempts after the first valid one of which another is preferred if a person would choose it.
const WINDOW: u64 = 16;

const SEEDS: u64 = 12;

fn search(holdout: &Holdout, seed: u64) -> Search<'_> {
    Search {
        seed,
        max_attempts: 1000,
        ..Search::guided(holdout, right())
    }
}

/// The outcome of one attempt.
fn outcome_of(holdout: &Holdout, seed: u64, attempt: u64) -> SearchOutcome {
    let one = Search {
        first_attempt: attempt,
        max_attempts: 1,
        ..search(holdout, seed)
    };
    one.run()
}

fn total(grasp: &Grasp) -> f32 {
    grasp.score.expect("it is rated").total()
}

/// The winner by its definition, from attempts run one by one: index and grasp.
fn expected(holdout: &Holdout, seed: u64) -> (u64, Grasp) {
    let mut others: Vec<(u64, Grasp)> = Vec::new();
    for attempt in 0.. {
        if others.first().is_some_and(|(first, _)| attempt > first + WINDOW) {
            break;
        }
        let outcome = outcome_of(holdout, seed, attempt);
        let Some(grasp) = outcome.grasp else { continue };
        if outcome.replaceable_until.is_none() {
            return (attempt, grasp);
        }
        others.push((attempt, grasp));
    }
    let best = others.into_iter().reduce(|best, other| {
        if total(&other.1) > total(&best.1) {
            other
        } else {
            best
        }
    });
    best.expect("some attempt is valid")
}

#[test]
fn a_grasp_that_people_would_choose_replaces_another_within_some_attempts() {
    let mut replaced = 0;
    let held = tracked_holdouts().nth(3).expect("there are fifteen");
    let floating = ["remote", "scissors"].map(|name| floating(Arc::clone(object(name))));
    for holdout in [&floating[0], &floating[1], &held] {
        for seed in 0..SEEDS {
            let (index, grasp) = expected(holdout, seed);
            let earlier = (0..index).any(|attempt| outcome_of(holdout, seed, attempt).grasp.is_some());
            replaced += usize::from(earlier);
            let one = search(holdout, seed).run();
            assert_eq!(
                (one.report.attempt, one.grasp),
                (Some(index), Some(grasp)),
                "{seed}"
            );
            for (workers, threads) in [(2, 2), (4, 3)] {
                let many = Search {
                    workers,
                    ..search(holdout, seed)
                };
                let many = many.run_on(&pool(threads));
                assert_eq!(
                    (many.report.attempt, many.report.attempts),
                    (Some(index), one.report.attempts),
                    "{seed}, {workers} workers"
                );
            }
        }
    }
    assert!(replaced > 3, "only {replaced} grasps were replaced");
}

#[test]
fn without_reproducible_what_people_would_choose_is_nearly_always_found() {
    let pool = pool(2);
    for holdout in [
        floating(Arc::clone(object("scissors"))),
        floating(Arc::clone(object("remote"))),
    ] {
        let racing = |seed: u64| Search {
            workers: 2,
            reproducible: false,
            ..search(&holdout, seed)
        };
        let chosen = (0..2 * SEEDS).filter(|&seed| {
            let outcome = racing(seed).run_on(&pool);
            let grasp = outcome.grasp.expect("it is found");
            let values = grasp.score.expect("it is rated").values;
            outcome.replaceable_until.is_none()
                && grasp.classification.is_clear()
                && values[Term::FromSideOrAbove as usize] > 0.0
        });
        let chosen = chosen.count() as u64;
        assert!(chosen >= 2 * SEEDS - 2, "{chosen} of {}", 2 * SEEDS);
    }
}
