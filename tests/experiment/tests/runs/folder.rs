//! The folder of a run: going on, asking for more, and what is refused.

use std::{
    fs,
    io::Write as _,
    sync::atomic::{AtomicBool, Ordering},
};

use grasp_experiment::{
    folder::{Folder, FolderError, Manifest},
    make::Maker,
    plan::Settings,
    record::Record,
    run::{RunEnd, run},
};

use crate::support::{Scratch, complete, open, small, timeless};

fn records(folder: &Folder) -> Vec<Record> {
    folder.records().iter().map(timeless).collect()
}

#[test]
fn a_run_that_was_cut_short_goes_on_where_it_was() {
    let settings = small();
    let whole = Scratch::new();
    let expected = records(&complete(whole.path(), &settings));

    let cut = Scratch::new();
    let maker = Maker::new(&settings).expect("built-in holdouts are sound");
    let mut runs = 0;
    loop {
        let mut folder = open(cut.path(), &settings);
        let before = folder.records().len();
        let stop = AtomicBool::new(false);
        let mut steps = 0;
        let end = run(&settings, &maker, &mut folder, &stop, |_| {
            steps += 1;
            stop.store(steps > 7, Ordering::Relaxed);
        });
        runs += 1;
        if end.expect("a run") == RunEnd::Complete {
            assert_eq!(records(&folder), expected);
            break;
        }
        assert!(folder.records().len() > before, "run {runs} made nothing");
        drop(folder);
        // As if the process had been killed while it wrote a line.
        let mut file = fs::OpenOptions::new()
            .append(true)
            .open(cut.path().join("records.jsonl"))
            .expect("records");
        file.write_all(br#"{"strategy":"C","bend_"#).expect("a cut line");
    }
    assert!(runs > 2, "the run was never cut short");
}

#[test]
fn asking_for_more_makes_only_what_is_missing() {
    let scratch = Scratch::new();
    let fewer = small();
    let first = complete(scratch.path(), &fewer).records().to_vec();
    let more = Settings {
        valid: 5,
        invalid: 30,
        ..fewer
    };
    let folder = complete(scratch.path(), &more);
    // Not only the same grasps: the same measured times, so they were not made again.
    assert_eq!(&folder.records()[..first.len()], &first[..]);
    let count = |is_valid: bool| {
        folder
            .records()
            .iter()
            .filter(|record| record.rejection.is_none() == is_valid)
            .count()
    };
    let cells = more.cells();
    assert_eq!(count(true), 5 * cells.len());
    assert_eq!(count(false), 30 * 4);

    let fresh = Scratch::new();
    let mut at_once = records(&complete(fresh.path(), &more));
    let mut bit_by_bit = records(&folder);
    for list in [&mut at_once, &mut bit_by_bit] {
        list.sort_by_key(|record| {
            (
                format!("{:?}", record.cell),
                record.rejection.is_some(),
                record.number,
            )
        });
    }
    assert_eq!(at_once, bit_by_bit);
}

#[test]
fn a_folder_of_another_run_is_refused_and_kept() {
    let scratch = Scratch::new();
    let settings = small();
    drop(complete(scratch.path(), &settings));
    let before = fs::read(scratch.path().join("records.jsonl")).expect("records");
    let error = Folder::open(scratch.path(), Manifest::new(8), false).expect_err("another seed");
    assert!(
        matches!(&error, FolderError::OtherRun { differences, .. } if differences == &["its seed is 7, now it is 8"]),
        "{error}"
    );
    assert_eq!(
        fs::read(scratch.path().join("records.jsonl")).expect("records"),
        before
    );
    let fresh = Folder::open(scratch.path(), Manifest::new(8), true).expect("a fresh start");
    assert!(fresh.records().is_empty());
}

#[test]
fn records_without_a_manifest_are_not_thrown_away() {
    let scratch = Scratch::new();
    fs::create_dir_all(scratch.path()).expect("a folder");
    fs::write(scratch.path().join("records.jsonl"), "somebody's\n").expect("a file");
    let error = Folder::open(scratch.path(), Manifest::new(7), false).expect_err("no manifest");
    assert!(matches!(error, FolderError::NoManifest(_)), "{error}");
    let text = fs::read_to_string(scratch.path().join("records.jsonl")).expect("the file");
    assert_eq!(text, "somebody's\n");
}

#[test]
fn a_broken_line_is_named() {
    let scratch = Scratch::new();
    let settings = small();
    drop(complete(scratch.path(), &settings));
    let path = scratch.path().join("records.jsonl");
    let text = fs::read_to_string(&path).expect("records");
    let broken: Vec<_> = text
        .lines()
        .enumerate()
        .map(|(index, line)| if index == 4 { &line[1..] } else { line })
        .collect();
    fs::write(&path, broken.join("\n") + "\n").expect("a file");
    let error = Folder::open(scratch.path(), Manifest::new(7), false).expect_err("a broken line");
    assert!(matches!(error, FolderError::Malformed { line: 5, .. }), "{error}");
}

#[test]
fn two_runs_do_not_write_to_one_folder() {
    let scratch = Scratch::new();
    let settings = small();
    let folder = open(scratch.path(), &settings);
    let error = Folder::open(scratch.path(), Manifest::new(7), false).expect_err("a second run");
    assert!(matches!(error, FolderError::Busy(_)), "{error}");
    drop(folder);
    drop(open(scratch.path(), &settings));
}

#[test]
fn records_of_another_algorithm_are_not_mixed_in() {
    let scratch = Scratch::new();
    let settings = small();
    drop(complete(scratch.path(), &settings));
    let path = scratch.path().join("records.jsonl");
    let text = fs::read_to_string(&path).expect("records");
    // The first record is a failed attempt; another algorithm would have let it fail otherwise.
    let (first, rest) = text.split_once('\n').expect("lines");
    let mut record: Record = serde_json::from_str(first).expect("a record");
    let details = record.details.as_mut().expect("details");
    details.measures.palm_distance_cm += 1.0;
    let changed = serde_json::to_string(&record).expect("a record");
    fs::write(&path, format!("{changed}\n{rest}")).expect("a file");
    let mut folder = open(scratch.path(), &settings);
    let maker = Maker::new(&settings).expect("built-in holdouts are sound");
    let error =
        run(&settings, &maker, &mut folder, &AtomicBool::new(false), |_| ()).expect_err("outdated records");
    assert!(
        matches!(&error, FolderError::Outdated { holdout, attempt, .. }
            if *holdout == record.cell.built_in().name && *attempt == record.attempt),
        "{error}"
    );
}
