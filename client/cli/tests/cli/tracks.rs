//! Givers who move, at a real server.

use crate::{
    commands::{code, empty_folder, json, run, run_with_input, text},
    real_server::real_server,
};

/// A motion of half a second. Unoptimised builds search longer than a frame.
const WALK: [&str; 9] = [
    "track",
    "--holdout",
    "remote-hold1",
    "--moving",
    "walk",
    "--length",
    "500ms",
    "--budget",
    "5s",
];

#[tokio::test(flavor = "multi_thread")]
async fn a_track_is_a_line_per_answer_and_a_summary() {
    let url = real_server().await;
    let output = run(&[&WALK[..], &["--server", &url, "--json"]].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let lines: Vec<serde_json::Value> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("each line is JSON"))
        .collect();
    let (summary, answers) = lines.split_last().unwrap();
    assert_eq!(summary["frames"], 45);
    assert_eq!(summary["answered"], answers.len());
    let sequences: Vec<u64> = answers
        .iter()
        .map(|line| line["sequence"].as_u64().unwrap())
        .collect();
    assert!(sequences.is_sorted_by(|a, b| a < b) && sequences.last() == Some(&44));
    assert_eq!(answers[0]["standing"]["status"], "replanned");
    let table = run(&[&WALK[..], &["--server", &url]].concat());
    let table = text(&table.stdout);
    assert!(
        table.contains("frames") && table.contains("round trip"),
        "{table}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_printed_motion_can_be_played() {
    let url = real_server().await;
    let motion = run(&[&WALK[..], &["--print-motion"]].concat());
    assert_eq!(code(&motion), 0);
    let parsed = json(&motion.stdout);
    assert_eq!(parsed["frames"].as_array().unwrap().len(), 45);
    let file = empty_folder("a_motion").join("motion.json");
    std::fs::write(&file, &motion.stdout).unwrap();
    let play = ["track", "--server", &url, "--predict-ahead", "20ms", "--motion"];
    let played = run(&[&play[..], &[file.to_str().unwrap()]].concat());
    assert_eq!(code(&played), 0, "{}", text(&played.stderr));
    assert!(text(&played.stdout).contains("predicted"));
    // A file that is no motion, and a frame that is wrong.
    let output = run_with_input(&["track", "--server", &url, "--motion", "-"], "{\"frames\": []}");
    assert_eq!(code(&output), 2);
    assert!(text(&output.stderr).contains("setup"));
    let mut wrong = parsed;
    wrong["frames"][3]["sequence"] = 1.into();
    let output = run_with_input(&["track", "--server", &url, "--motion", "-"], &wrong.to_string());
    assert_eq!(code(&output), 4, "{}", text(&output.stderr));
    assert!(
        text(&output.stderr).contains("frame.sequence"),
        "{}",
        text(&output.stderr)
    );
}
