//! `grasp experiment`: its output, and replays of its grasps by a real server.

use std::{collections::HashMap, path::Path};

use crate::{
    call::{Call, grasp},
    files::empty_folder,
    servers::real_server,
};

/// A run of a few seconds into this folder.
fn small_run(folder: &Path) -> Call {
    grasp("experiment --json --set d --set F --holdout scissors-hold1 --holdout scalpel-hold2")
        .with("--valid 2 --invalid 10 --threads 1 --out")
        .arg(folder)
}

/// The rows of a CSV file without quotes, by column.
fn rows(path: &Path) -> Vec<HashMap<String, String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let header: Vec<_> = lines.next().unwrap().collect();
    lines
        .map(|row| header.iter().cloned().zip(row).collect())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn server_reproduces_every_recorded_grasp() {
    let folder = empty_folder("experiment_rows");
    let output = small_run(&folder)
        .with("--set guided --set PHYSICAL")
        .ends_with(0);
    assert_eq!(output.stderr, "", "no bar where there is no terminal");
    let find = grasp("find --receiving-hand right").at(&real_server().await);
    let grasps = rows(&folder.join("grasps.csv"));
    // Four sets and the five further columns of Figure 5.20, on two holdouts.
    assert_eq!(grasps.len(), 2 * 2 * (4 + 5));
    for row in &grasps {
        let mut find = find.with("--replay-attempt").arg(&row["attempt"]);
        for column in ["holdout", "validity", "strategy", "bend_ratios", "seed"] {
            let option = format!("--{}", column.replace('_', "-"));
            find = find.arg(option).arg(&row[column]);
        }
        let answer = find.json();
        let expected: f64 = row["comfort"].parse().unwrap();
        let grasp = &answer["grasps"][0];
        let comfort = grasp["thesis"]["comfort"].as_f64().unwrap_or(0.0);
        assert!(
            (comfort - expected).abs() <= 1e-5 * expected.max(1e-3),
            "{comfort}, not {expected}"
        );
        let contacts = grasp["contacts"].as_array().unwrap().len();
        assert_eq!(contacts.to_string(), row["contacts"]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn reports_ladder_and_resumes() {
    let run = small_run(&empty_folder("experiment_again"));
    let results = run.ends_with(0).json();
    let ladder = results["ladder"].as_array().unwrap();
    let sets: Vec<_> = ladder.iter().map(|row| &row["set"]).collect();
    assert_eq!(sets, ["D", "F"]);
    assert!(results["claims"].as_array().unwrap().len() > 5);
    assert!(Path::new(results["report"].as_str().unwrap()).exists());
    // Nothing is missing: the same grasps with the same measured times.
    assert_eq!(run.ends_with(0).json(), results);
    let other = run.with("--seed 2");
    other.complains(1, "its seed is 1, now it is 2");
    other.with("--fresh").ends_with(0);
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_invalid_runs_before_they_start() {
    let folder = empty_folder("experiment_refused");
    for (wrong, named) in [
        ("--valid 0", "--valid"),
        ("--invalid 1000000", "--invalid"),
        ("--threads 65", "--threads"),
        ("--holdout spoon-hold1", "spoon-hold1"),
        ("--set G", "--set"),
    ] {
        small_run(&folder).with(wrong).complains(2, named);
    }
    assert!(!folder.join("records.jsonl").exists());
}
