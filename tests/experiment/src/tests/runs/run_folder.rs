//! The folder of a run: resumed, extended and rejected.

use std::{
    fs,
    io::Write as _,
    sync::atomic::{AtomicBool, Ordering},
};

use crate::{
    folder::{Folder, FolderError, Manifest},
    plan::{Set, Settings},
    record::{Record, Source},
    run::{RunEnd, run},
};
use grasp_synthesis::model::strategy::Strategy;

use crate::tests::fixtures::small_runs::{Scratch, complete, maker, open, small, timeless};

fn records(folder: &Folder) -> Vec<Record> {
    folder.records().iter().map(timeless).collect()
}

#[test]
fn an_interrupted_run_resumes() {
    let settings = small();
    let whole = Scratch::new();
    let expected = records(&complete(whole.path(), &settings));

    let cut = Scratch::new();
    let maker = maker(&settings, &open(cut.path(), &settings));
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
    assert!(runs > 2, "the run was never interrupted");
}

#[test]
fn extending_a_run_makes_only_missing_records() {
    let scratch = Scratch::new();
    let fewer = small();
    let first = complete(scratch.path(), &fewer).records().to_vec();
    let more = Settings {
        valid: 5,
        invalid: 30,
        ..fewer
    };
    let folder = complete(scratch.path(), &more);
    // Even the measured times are the same, so they were not made again.
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
fn a_folder_of_another_run_is_rejected_and_kept() {
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

/// Changes the format in the manifest.
fn set_format(scratch: &Scratch, format: u32) {
    let path = scratch.path().join("manifest.json");
    let text = fs::read_to_string(&path).expect("a manifest");
    let other = text.replace(r#""format": 2"#, &format!(r#""format": {format}"#));
    assert_ne!(text, other);
    fs::write(&path, other).expect("a file");
}

#[test]
fn a_folder_of_the_earlier_format_is_upgraded() {
    let scratch = Scratch::new();
    let settings = small();
    let before = complete(scratch.path(), &settings).records().to_vec();
    set_format(&scratch, 1);
    let folder = complete(scratch.path(), &settings);
    assert_eq!(folder.records(), &before[..]);
    // An earlier version would misread new records, so it must reject the folder.
    let manifest = fs::read_to_string(scratch.path().join("manifest.json")).expect("a manifest");
    assert!(manifest.contains(r#""format": 2"#), "{manifest}");
}

#[test]
fn a_folder_of_a_later_format_is_rejected() {
    let scratch = Scratch::new();
    let settings = small();
    drop(complete(scratch.path(), &settings));
    set_format(&scratch, 3);
    let error = Folder::open(scratch.path(), Manifest::new(7), false).expect_err("another format");
    assert!(
        matches!(&error, FolderError::OtherRun { differences, .. } if differences == &["its format is 3, now it is 2"]),
        "{error}"
    );
}

/// As version 1 wrote them.
#[test]
fn records_of_the_earlier_format_are_read() {
    let valid = r#"{"strategy":"F","bend_ratios":"one_random","threads":1,"holdout":"scissors-hold1","number":0,
        "seed":13000001,"attempt":208,"rejection":null,"search":{"attempts":209,"pruned_placements":10233,
        "rejections":[0,0,150,20,10,5,0,23],"nanoseconds":1000000},"details":{"measures":{"wrist_distance_cm":8.5,
        "palm_distance_cm":4.5,"upward_degrees":100.0,"forward_degrees":90.0,"palm_com_palm_degrees":null},"digits":[],
        "step_nanoseconds":[1,2,3,4,5],"grasp":{"wrench_angle_degrees":4.5,"comfort":0.25,"sufficient_distributions":3,
        "comfort_again":[0.5]}}}"#;
    let record: Record = serde_json::from_str(valid).expect("a record");
    assert_eq!(record.cell.set, Set::ladder(Strategy::F));
    assert_eq!(record.source, Source::Attempt(208));
    assert_eq!(record.search.expect("a search").atlas, None);
    let details = record.details.as_ref().expect("details");
    assert_eq!(details.step_nanoseconds, Some([1, 2, 3, 4, 5]));
    assert_eq!(record.grasp().expect("figures").sufficient_distributions, Some(3));
    // Sets A to F are written as before.
    let written = serde_json::to_value(&record).expect("a record");
    assert_eq!(
        written,
        serde_json::from_str::<serde_json::Value>(valid).expect("JSON")
    );
}

#[test]
fn records_without_a_manifest_are_kept() {
    let scratch = Scratch::new();
    fs::create_dir_all(scratch.path()).expect("a folder");
    fs::write(scratch.path().join("records.jsonl"), "somebody's\n").expect("a file");
    let error = Folder::open(scratch.path(), Manifest::new(7), false).expect_err("no manifest");
    assert!(matches!(error, FolderError::NoManifest(_)), "{error}");
    let text = fs::read_to_string(scratch.path().join("records.jsonl")).expect("the file");
    assert_eq!(text, "somebody's\n");
}

#[test]
fn a_broken_line_is_reported_by_number() {
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
fn a_second_run_cannot_open_the_folder() {
    let scratch = Scratch::new();
    let settings = small();
    let folder = open(scratch.path(), &settings);
    let error = Folder::open(scratch.path(), Manifest::new(7), false).expect_err("a second run");
    assert!(matches!(error, FolderError::Busy(_)), "{error}");
    drop(folder);
    drop(open(scratch.path(), &settings));
}

#[test]
fn records_of_another_algorithm_are_rejected() {
    let scratch = Scratch::new();
    let settings = small();
    drop(complete(scratch.path(), &settings));
    let path = scratch.path().join("records.jsonl");
    let text = fs::read_to_string(&path).expect("records");
    // The first record is a failed attempt; another algorithm would place it differently.
    let (first, rest) = text.split_once('\n').expect("lines");
    let mut record: Record = serde_json::from_str(first).expect("a record");
    let details = record.details.as_mut().expect("details");
    details.measures.as_mut().expect("measures").palm_distance_cm += 1.0;
    let changed = serde_json::to_string(&record).expect("a record");
    fs::write(&path, format!("{changed}\n{rest}")).expect("a file");
    let mut folder = open(scratch.path(), &settings);
    let maker = maker(&settings, &folder);
    let error =
        run(&settings, &maker, &mut folder, &AtomicBool::new(false), |_| ()).expect_err("outdated records");
    assert!(
        matches!(&error, FolderError::Outdated { holdout, hand, .. }
            if *holdout == record.cell.built_in().name && *hand == record.source),
        "{error}"
    );
}
