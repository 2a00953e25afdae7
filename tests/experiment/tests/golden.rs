//! A tiny run against its recorded rows, from which the report's own tests start as well.

use std::{fs, path::Path};

use grasp_assets::holdouts::holdouts;
use grasp_experiment::{
    plan::{SETS, Settings},
    run::run,
};

/// The command of the recorded run.
const COMMAND: &str = "grasp-experiment --valid 2 --invalid 5";

/// An easy holdout of each object.
const HOLDOUTS: [&str; 3] = ["remote-genhold3", "scalpel-hold2", "scissors-hold1"];

/// The rows of a CSV file as column and value, without times.
fn rows(path: &Path) -> Vec<Vec<(String, String)>> {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let columns: Vec<_> = lines.next().expect("a header").collect();
    let is_kept =
        |(column, _): &(String, String)| !column.ends_with("nanoseconds") && !column.ends_with("_ns");
    lines
        .map(|values| columns.iter().cloned().zip(values).filter(is_kept).collect())
        .collect()
}

#[test]
fn rows_match_the_recorded_ones_for_any_number_of_threads() {
    let settings = Settings {
        seed: 1,
        valid: 2,
        invalid: 5,
        sets: SETS.to_vec(),
        holdouts: HOLDOUTS
            .map(|name| holdouts().iter().position(|holdout| holdout.name == name))
            .map(|index| index.expect("it is built in"))
            .to_vec(),
        threads: 2,
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("tiny");
    let mut done = Vec::new();
    run(&settings, COMMAND, &folder, |now| {
        done.push((now.done, now.total));
    })
    .expect("a run");
    let total = settings.valid * settings.cells().len() as u64;
    assert_eq!(done.last(), Some(&(total, total)));

    let recorded = Path::new(env!("CARGO_MANIFEST_DIR")).join("tiny");
    for file in ["searches.csv", "attempts.csv"] {
        let (made, recorded) = (rows(&folder.join(file)), rows(&recorded.join(file)));
        assert_eq!(made.len(), recorded.len(), "{file}");
        for (made, recorded) in made.iter().zip(&recorded) {
            assert_eq!(
                made,
                recorded,
                "if this is meant, copy {} over it",
                folder.display()
            );
        }
    }
    assert!(folder.join("run.json").exists());

    // Effort and grasp are the same on two threads as on one.
    let searches = rows(&folder.join("searches.csv"));
    let on = |threads: &str| {
        let is_on = |row: &&Vec<(String, String)>| row.contains(&("threads".to_owned(), threads.to_owned()));
        let without_threads = |row: &Vec<(String, String)>| {
            let kept = row.iter().filter(|(column, _)| column != "threads");
            kept.cloned().collect::<Vec<_>>()
        };
        let own = searches.iter().filter(is_on).map(without_threads);
        own.filter(|row| !row[0].1.contains('/')).collect::<Vec<_>>()
    };
    assert_eq!(on("1").len(), 7 * HOLDOUTS.len() * 2);
    assert_eq!(on("1"), on("2"));
}
