//! Givers who move, at a real server.

use crate::harness::{assert_contains, assert_scene, empty_folder, file, grasp, real_server};

/// A motion of half a second. Unoptimised builds search longer than a frame.
const WALK: &str = "track --holdout remote-hold1 --moving walk --length 500ms --budget 5s";

#[tokio::test(flavor = "multi_thread")]
async fn a_track_is_a_line_per_answer_and_a_summary_and_drawn() {
    let walk = grasp(WALK).at(&real_server().await);
    let glb = empty_folder("a_drawn_track").join("track.glb");
    let lines = walk.with("--json --glb").arg(&glb).ends_with(0).lines();
    assert_scene(glb, &["object", "giver_wrist", "receiver_wrist"]);
    let (summary, answers) = lines.split_last().unwrap();
    assert_eq!(summary["frames"], 45);
    assert_eq!(summary["answered"], answers.len());
    // That of the first frame is 0, which is not written.
    let sequence = |line: &serde_json::Value| line["sequence"].as_str().unwrap_or("0").parse().unwrap();
    let sequences: Vec<u64> = answers.iter().map(sequence).collect();
    assert!(sequences.is_sorted_by(|a, b| a < b) && sequences.last() == Some(&44));
    assert_eq!(answers[0]["current"]["status"], "CURRENT_GRASP_STATUS_REPLANNED");
    assert_contains(&walk.run().stdout, &["frames", "round trip"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_printed_motion_can_be_played() {
    let mut motion = grasp(WALK).with("--print-motion").json();
    assert_eq!(motion["frames"].as_array().unwrap().len(), 45);
    let printed = file(&empty_folder("a_motion"), "motion.json", motion.to_string());
    let play = grasp("track").at(&real_server().await).with("--motion");
    let played = play.arg(printed).with("--prediction-horizon 20ms").text();
    assert_contains(&played, &["predicted"]);
    // A file that is no motion, and a frame that is wrong, which is answered.
    let play = play.with("-");
    play.input("{\"frames\": []}").complains(2, "track");
    motion["frames"][3]["sequence"] = 1.into();
    let played = play.input(motion.to_string()).text();
    assert_contains(&played, &["1, first: sequence is 1"]);
}
