//! Of attempts close together, one that a person would choose wins, or else the one with the highest score.

use crate::prelude::*;

/// Attempts after the first valid one of which another is preferred if a person would choose it.
const WINDOW: u64 = 16;

const SEEDS: u64 = 12;

fn search(holdout: &Holdout, seed: u64) -> Search<'_> {
    guided(holdout).seed(seed).max_attempts(1000)
}

/// The outcome of one attempt.
fn outcome_of(holdout: &Holdout, seed: u64, attempt: u64) -> SearchOutcome {
    let one = search(holdout, seed).first_attempt(attempt).max_attempts(1);
    one.run()
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
    let better = |best: (u64, Grasp), other: (u64, Grasp)| {
        let is_better = score(&other.1) > score(&best.1);
        if is_better { other } else { best }
    };
    let best = others.into_iter().reduce(better);
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
                let many = search(holdout, seed).workers(workers).run_on(&pool(threads));
                assert_eq!(many.report.attempt, Some(index), "{seed}, {workers} workers");
                assert_eq!(many.report.attempts, one.report.attempts, "{seed}");
            }
        }
    }
    assert!(replaced > 3, "only {replaced} grasps were replaced");
}
