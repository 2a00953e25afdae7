//! Of attempts close together, one with a clear grasp type wins.

use std::sync::Arc;

use grasp_synthesis::model::{grasp::Grasp, holdout::Holdout};

use crate::fixtures::{
    hands::right,
    holdouts::floating,
    objects::object,
    searches::{Search, pool},
};

/// Attempts of which one with a clear type is preferred to an earlier valid one, in addition to as many as that took.
const WINDOW: u64 = 32;

const SEEDS: u64 = 12;

fn search(holdout: &Holdout, seed: u64) -> Search<'_> {
    Search {
        seed,
        max_attempts: 1000,
        ..Search::guided(holdout, right())
    }
}

/// The grasp of one attempt.
fn grasp_of(holdout: &Holdout, seed: u64, attempt: u64) -> Option<Grasp> {
    let one = Search {
        first_attempt: attempt,
        max_attempts: 1,
        ..search(holdout, seed)
    };
    one.run().grasp
}

/// The winner by its definition, from attempts run one by one: index and grasp.
fn expected(holdout: &Holdout, seed: u64) -> (u64, Grasp) {
    let mut unclear: Option<(u64, Grasp)> = None;
    for attempt in 0.. {
        if unclear
            .as_ref()
            .is_some_and(|(first, _)| attempt > 2 * first + WINDOW)
        {
            break;
        }
        let Some(grasp) = grasp_of(holdout, seed, attempt) else {
            continue;
        };
        if grasp.classification.grasp_type.is_some() && grasp.classification.confidence >= 0.5 {
            return (attempt, grasp);
        }
        unclear.get_or_insert((attempt, grasp));
    }
    unclear.expect("some attempt is valid")
}

#[test]
fn a_clear_type_replaces_an_unclear_one_within_some_attempts() {
    let mut replaced = 0;
    for name in ["remote", "scissors"] {
        let holdout = floating(Arc::clone(object(name)));
        for seed in 0..SEEDS {
            let (index, grasp) = expected(&holdout, seed);
            replaced += usize::from((0..index).any(|attempt| grasp_of(&holdout, seed, attempt).is_some()));
            let one = search(&holdout, seed).run();
            assert_eq!(
                (one.report.attempt, one.grasp),
                (Some(index), Some(grasp)),
                "{name}, {seed}"
            );
            for (workers, threads) in [(2, 2), (4, 3)] {
                let many = Search {
                    workers,
                    ..search(&holdout, seed)
                };
                let many = many.run_on(&pool(threads));
                assert_eq!(
                    (many.report.attempt, many.report.attempts),
                    (Some(index), one.report.attempts),
                    "{name}, {seed}, {workers} workers"
                );
            }
        }
    }
    assert!(replaced > 3, "only {replaced} grasps were replaced");
}

#[test]
fn without_reproducible_a_clear_type_is_nearly_always_found() {
    let holdout = floating(Arc::clone(object("scissors")));
    let pool = pool(2);
    let clear = (0..4 * SEEDS).filter(|&seed| {
        let racing = Search {
            workers: 2,
            reproducible: false,
            ..search(&holdout, seed)
        };
        let grasp = racing.run_on(&pool).grasp.expect("it is found");
        grasp.classification.is_clear()
    });
    let clear = clear.count() as u64;
    assert!(clear >= 4 * SEEDS - 4, "{clear} of {}", 4 * SEEDS);
}
