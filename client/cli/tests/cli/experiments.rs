//! `grasp experiment`: its output, and replays of its grasps by a real server.

use std::{collections::HashMap, path::Path};

use crate::{
    commands::{code, empty_folder, json, run, text},
    real_server::real_server,
};

/// A run of a few seconds into this folder.
fn small_run(folder: &Path, more: &[&str]) -> std::process::Output {
    let mut arguments = vec![
        "experiment",
        "--json",
        "--set",
        "d",
        "--set",
        "F",
        "--holdout",
        "scissors-hold1",
        "--holdout",
        "scalpel-hold2",
        "--valid",
        "2",
        "--invalid",
        "10",
        "--threads",
        "1",
        "--out",
        folder.to_str().unwrap(),
    ];
    arguments.extend(more);
    run(&arguments)
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
    let output = small_run(&folder, &["--set", "guided", "--set", "PHYSICAL"]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "", "no bar where there is no terminal");
    let url = real_server().await;
    let grasps = rows(&folder.join("grasps.csv"));
    // Four sets and the five further columns of Figure 5.20, on two holdouts.
    assert_eq!(grasps.len(), 2 * 2 * (4 + 5));
    for row in &grasps {
        let answer = run(&[
            "find",
            "--json",
            "--server",
            &url,
            "--holdout",
            &row["holdout"],
            "--validity",
            &row["validity"],
            "--strategy",
            &row["strategy"],
            "--bend-ratios",
            &row["bend_ratios"],
            "--seed",
            &row["seed"],
            "--only-attempt",
            &row["attempt"],
            "--receiving-hand",
            "right",
        ]);
        assert_eq!(code(&answer), 0, "{row:?}: {}", text(&answer.stderr));
        let answer = json(&answer.stdout);
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
    let folder = empty_folder("experiment_again");
    let first = small_run(&folder, &[]);
    assert_eq!(code(&first), 0, "{}", text(&first.stderr));
    let results = json(&first.stdout);
    let sets: Vec<_> = results["ladder"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| &row["set"])
        .collect();
    assert_eq!(sets, ["D", "F"]);
    assert!(results["claims"].as_array().unwrap().len() > 5);
    assert!(Path::new(results["report"].as_str().unwrap()).exists());
    // Nothing is missing: the same grasps with the same measured times.
    let again = small_run(&folder, &[]);
    assert_eq!(json(&again.stdout), results);
    let other = small_run(&folder, &["--seed", "2"]);
    assert_eq!(code(&other), 1);
    let message = json(&other.stderr)["error"]["message"]
        .as_str()
        .unwrap()
        .to_owned();
    assert!(message.contains("its seed is 1, now it is 2"), "{message}");
    let fresh = small_run(&folder, &["--seed", "2", "--fresh"]);
    assert_eq!(code(&fresh), 0, "{}", text(&fresh.stderr));
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_invalid_runs_before_they_start() {
    let folder = empty_folder("experiment_refused");
    for (wrong, named) in [
        (["--valid", "0"], "--valid"),
        (["--invalid", "1000000"], "--invalid"),
        (["--threads", "65"], "--threads"),
        (["--holdout", "spoon-hold1"], "spoon-hold1"),
        (["--set", "G"], "--set"),
    ] {
        let output = small_run(&folder, &wrong);
        assert_eq!(code(&output), 2, "{wrong:?}");
        let message = json(&output.stderr)["error"]["message"]
            .as_str()
            .unwrap()
            .to_owned();
        assert!(message.contains(named), "{message}");
    }
    assert!(!folder.join("records.jsonl").exists());
}
