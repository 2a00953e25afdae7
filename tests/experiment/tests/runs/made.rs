//! What is recorded, against searches and definitions of their own.

use std::{sync::atomic::AtomicBool, time::Duration};

use grasp_assets::hands::hand;
use grasp_experiment::{plan::Settings, record::Record};
use grasp_synthesis::{
    base::{clock::Clock, rejection::Rejection},
    known::{recent_grips::RecentGrips, seed_source::SeedSource},
    base::mechanisms::Mechanisms,
    model::{
        bend_ratios::BendRatioChoice,
        constraints::Constraints,
        hand::Handedness,
        strategy::{Choice, Strategy, Validity},
    },
    search::{SearchOutcome, find_grasp, settings::SearchSettings},
};

use crate::support::{Scratch, complete, small};

struct NoClock;

impl Clock for NoClock {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
}

/// Searches the attempts of a record's seed as the server would.
fn search(record: &Record, first_attempt: u64, max_attempts: u64) -> SearchOutcome {
    let holdout = record
        .cell
        .built_in()
        .to_holdout()
        .expect("built-in holdouts are sound");
    let rig = &hand("thesis", Handedness::Right).expect("a built-in hand").rig;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread");
    let settings = SearchSettings {
        seed: record.seed,
        strategy: record.cell.set.strategy,
        bend_ratios: record.cell.set.bend_ratios,
        validity: Validity::Thesis,
        friction: holdout.object.friction_under(Validity::Thesis),
        reproducible: true,
        first_attempt,
        max_attempts,
        deadline: None,
        workers: 1,
        record_step_times: false,
        mechanisms: Mechanisms::ALL,
        constraints: Constraints::default(),
        choice: Choice::FirstValid,
        atlas: None,
        starts: SeedSource::Nothing,
        recent: RecentGrips::default(),
        known_tried: 0,
    };
    find_grasp(&pool, &holdout, rig, &settings, &NoClock, &AtomicBool::new(false))
}

/// Of sets without an atlas.
fn attempt_of(record: &Record) -> u64 {
    record.source.attempt().expect("an attempt")
}

fn run() -> (Scratch, Vec<Record>) {
    let scratch = Scratch::new();
    let records = complete(scratch.path(), &small()).records().to_vec();
    (scratch, records)
}

#[test]
fn a_search_of_the_seed_finds_the_recorded_grasp_and_counts_the_same() {
    let (_scratch, records) = run();
    let mut checked = 0;
    for record in records.iter().filter(|record| record.rejection.is_none()) {
        if record.cell.threads == 1 {
            let found = search(record, 0, u64::MAX);
            let figures = record.search.expect("a valid record has a search");
            assert_eq!(found.report.attempt, record.source.attempt());
            assert_eq!(found.report.attempts, figures.attempts);
            assert_eq!(found.report.pruned_placements, figures.pruned_placements);
            assert_eq!(
                Rejection::OF_THESIS.map(|kind| found.report.rejections[kind.index()]),
                figures.rejections
            );
            assert_eq!(figures.attempts, figures.rejections.iter().sum::<u64>() + 1);
            let grasp = found.grasp.expect("a grasp");
            let recorded = record.grasp().expect("figures of a grasp");
            assert_eq!(recorded.comfort, grasp.comfort);
            let details = record.details.as_ref().expect("details");
            let touching: Vec<_> = details.digits.iter().map(|digit| digit.bend_ratio).collect();
            assert_eq!(touching, grasp.bend_ratios);
            let contacts: u32 = details.digits.iter().map(|digit| digit.contacts).sum();
            assert_eq!(contacts as usize, grasp.contacts.len());
        } else {
            // Whoever won the race: the attempt alone must be valid.
            let attempt = attempt_of(record);
            assert_eq!(search(record, attempt, 1).report.attempt, Some(attempt));
        }
        checked += 1;
    }
    // Two sets on one and two threads, and five columns that are no set of the run, on two holdouts.
    assert_eq!(checked, 3 * 2 * (2 * 2 + 5));
}

#[test]
fn the_negative_set_is_the_first_failures_of_its_seed() {
    let (_scratch, records) = run();
    let failed: Vec<_> = records
        .iter()
        .filter(|record| record.rejection.is_some())
        .collect();
    assert_eq!(failed.len(), 20 * 2 * 2);
    for cell in failed.chunk_by(|a, b| a.cell == b.cell) {
        assert_eq!(cell.len(), 20);
        let last = attempt_of(cell[19]);
        // As many attempts as were skipped are valid.
        let mut counts = [0; 8];
        let mut next = 0;
        while next <= last {
            let outcome = search(cell[0], next, last + 1 - next);
            for (sum, count) in counts.iter_mut().zip(outcome.report.rejections) {
                *sum += count;
            }
            match outcome.report.attempt {
                Some(valid) => {
                    assert!(cell.iter().all(|record| attempt_of(record) != valid));
                    next = valid + 1;
                }
                None => break,
            }
        }
        for rejection in Rejection::OF_THESIS {
            let recorded = cell
                .iter()
                .filter(|record| record.rejection == Some(rejection))
                .count();
            assert_eq!(counts[rejection.index()], recorded as u64, "{rejection:?}");
        }
    }
}

#[test]
fn a_digit_touches_with_its_own_ratio_and_with_none_that_was_tried_before() {
    let (_scratch, records) = run();
    let mut touching = 0;
    for record in &records {
        let Some(details) = record.details.as_ref().filter(|_| record.rejection.is_none()) else {
            continue;
        };
        assert_eq!(details.digits.len(), 5);
        for digit in &details.digits {
            assert_eq!(digit.bend_ratio.is_some(), digit.contacts > 0);
            let (Some(ratio), Some(touches)) = (digit.bend_ratio, digit.touches_with) else {
                assert!(digit.touches_with.is_none());
                continue;
            };
            let own = [0.7, 1.0, 1.42]
                .iter()
                .position(|known| *known == ratio)
                .expect("a known ratio");
            assert!(touches[own], "the digit touches with the ratio it touches with");
            if record.cell.set.bend_ratios == BendRatioChoice::All {
                // All were tried in turn: none before it can have touched.
                assert!(!touches[..own].contains(&true), "{touches:?} with {ratio}");
            }
            touching += 1;
        }
    }
    assert!(touching > 50, "{touching} touching digits");
}

#[test]
fn early_stops_pose_the_thumb_alone() {
    let (_scratch, records) = run();
    let mut early = 0;
    for record in &records {
        let Some(details) = &record.details else { continue };
        if record.rejection == Some(Rejection::NoThumbEarlyStop) {
            assert_eq!(details.digits.len(), 1);
            assert_eq!(record.cell.set.strategy, Strategy::D);
            early += 1;
        } else {
            assert_eq!(details.digits.len(), 5);
        }
    }
    assert!(early > 5, "{early} early stops");
}

#[test]
fn the_early_stop_changes_no_grasp() {
    // D skips work that cannot matter: with the same seeds the valid grasps of C and D are the same.
    let (_scratch, records) = run();
    let of = |strategy: Strategy| -> Vec<_> {
        let choice = Settings::default();
        records
            .iter()
            .filter(|record| record.cell.threads == 1 && record.rejection.is_none())
            .filter(|record| record.cell.set == grasp_experiment::plan::Set::ladder(strategy))
            .filter(|record| choice.holdouts.contains(&record.cell.holdout))
            .map(|record| (record.cell.holdout, record.seed, record.source))
            .collect()
    };
    assert_eq!(of(Strategy::C), of(Strategy::D));
    assert_eq!(of(Strategy::C).len(), 6);
}
