//! Records against independent searches and definitions.

use crate::{
    plan::{Set, Settings},
    record::Record,
};
use grasp_synthesis::{
    base::rejection::Rejection,
    model::{bend_ratios::BendRatioChoice, strategy::Strategy},
};

use crate::tests::fixtures::small_runs::{Scratch, complete, search, small};

/// The attempt of a record without an atlas.
fn attempt_of(record: &Record) -> u64 {
    record.source.attempt().expect("an attempt")
}

fn run() -> (Scratch, Vec<Record>) {
    let scratch = Scratch::new();
    let records = complete(scratch.path(), &small()).records().to_vec();
    (scratch, records)
}

#[test]
fn a_search_of_the_seed_finds_the_recorded_grasp_and_counts() {
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
                Rejection::THESIS.map(|kind| found.report.rejections[kind.index()]),
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
            // Whichever attempt won the race must be valid alone.
            let attempt = attempt_of(record);
            assert_eq!(search(record, attempt, 1).report.attempt, Some(attempt));
        }
        checked += 1;
    }
    // Two sets on one and two threads, and five columns that are not sets of the run, on two holdouts.
    assert_eq!(checked, 3 * 2 * (2 * 2 + 5));
}

#[test]
fn the_negative_set_has_the_first_failures_of_its_seed() {
    let (_scratch, records) = run();
    let failed: Vec<_> = records
        .iter()
        .filter(|record| record.rejection.is_some())
        .collect();
    assert_eq!(failed.len(), 20 * 2 * 2);
    for cell in failed.chunk_by(|a, b| a.cell == b.cell) {
        assert_eq!(cell.len(), 20);
        let last = attempt_of(cell[19]);
        // All skipped attempts are valid.
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
        for rejection in Rejection::THESIS {
            let recorded = cell
                .iter()
                .filter(|record| record.rejection == Some(rejection))
                .count();
            assert_eq!(counts[rejection.index()], recorded as u64, "{rejection:?}");
        }
    }
}

#[test]
fn digits_touch_with_their_ratio_and_with_none_tried_before() {
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
            assert!(touches[own], "the digit touches with its recorded ratio");
            if record.cell.set.bend_ratios == BendRatioChoice::All {
                // All are tried in turn: none before it touches.
                assert!(!touches[..own].contains(&true), "{touches:?} with {ratio}");
            }
            touching += 1;
        }
    }
    assert!(touching > 50, "{touching} touching digits");
}

#[test]
fn early_stops_pose_only_the_thumb() {
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
    // With the same seeds, C and D find the same valid grasps.
    let (_scratch, records) = run();
    let of = |strategy: Strategy| -> Vec<_> {
        let choice = Settings::default();
        records
            .iter()
            .filter(|record| record.cell.threads == 1 && record.rejection.is_none())
            .filter(|record| record.cell.set == Set::ladder(strategy))
            .filter(|record| choice.holdouts.contains(&record.cell.holdout))
            .map(|record| (record.cell.holdout, record.seed, record.source))
            .collect()
    };
    assert_eq!(of(Strategy::C), of(Strategy::D));
    assert_eq!(of(Strategy::C).len(), 6);
}
