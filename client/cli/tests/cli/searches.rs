//! Searches from the command line: streams, current grasps, verdicts, request files, givers who move.

use crate::harness::{Call, assert_contains, assert_scene, empty_folder, file, grasp, real_server};
use serde_json::json;

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_a_line_per_better_grasp_and_a_summary() {
    let url = real_server().await;
    let find = grasp("find --holdout remote-hold1 --budget 300ms --stream").at(&url);
    let lines = find.with("--json").ends_with(0).lines();
    let (summary, grasps) = lines.split_last().unwrap();
    assert_eq!(summary["outcome"], "OUTCOME_FOUND");
    assert_eq!(summary.get("grasps"), None);
    let score = |line: &serde_json::Value| line["grasps"][0]["score"].as_f64().unwrap();
    let scores: Vec<f64> = grasps.iter().map(score).collect();
    assert!(
        !scores.is_empty() && scores.is_sorted_by(|a, b| a < b),
        "{scores:?}"
    );
    let table = find.run().stdout;
    assert!(table.lines().count() >= 3, "{table}");
    assert_contains(&table, &["valid grasps"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn alternatives_are_drawn_into_numbered_files() {
    let url = real_server().await;
    let folder = empty_folder("alternatives");
    let glb = folder.join("scene.glb");
    let find = grasp("find --holdout remote-hold1 --budget 500ms --alternatives 2 --differ-by approach,type");
    let drawn = find.with("--json --glb").arg(&glb).at(&url).ends_with(0);
    assert_eq!(drawn.lines().len(), 3);
    for number in [1, 2] {
        assert_scene(folder.join(format!("scene-{number}.glb")), &[]);
    }
    assert!(!glb.exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn an_earlier_answer_is_held_on_to() {
    let url = real_server().await;
    let find = grasp("find --holdout remote-hold1 --receiving-hand right --budget 10s").at(&url);
    let first = find.json();
    let answer = file(
        &empty_folder("the_current_answer"),
        "answer.json",
        first.to_string(),
    );
    let find = find.with("--current").arg(answer);
    let again = find.json();
    assert_eq!(again["current"]["status"], "CURRENT_GRASP_STATUS_KEPT");
    assert_eq!(again["origin"]["source"], "GRASP_SOURCE_CURRENT");
    let wrists = [first, again].map(|answer| answer["grasps"][0]["hand"]["objectFromWrist"].clone());
    assert!(wrists[0] == wrists[1] && wrists[0].is_object());
    let table = find.run().stdout;
    assert_contains(&table, &["current grasp", "kept"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn found_grasps_are_valid_and_moved_ones_are_not() {
    let url = real_server().await;
    let found = grasp("find --holdout remote-hold1 --seed 1").at(&url).json();
    let answer = file(&empty_folder("validated"), "found.json", found.to_string());
    let validate = grasp("validate --holdout remote-hold1").at(&url).with("--grasp");
    let table = validate.arg(answer).text();
    assert_contains(&table, &["✓", "giver clearance"]);
    assert!(!table.contains('✗'), "{table}");

    // The grasp alone, 5 cm away, from standard input.
    let mut grasp = found["grasps"][0].clone();
    let x = &mut grasp["hand"]["objectFromWrist"]["position"]["x"];
    *x = (x.as_f64().unwrap() + 0.05).into();
    let moved = validate.with("-").input(grasp.to_string());
    assert_contains(&moved.ends_with(3).stdout, &["✗"]);
    let nearest = moved.with("--json --find-nearest --budget 500ms");
    let answer = nearest.ends_with(3).json();
    // False is not written.
    assert_eq!(answer.get("valid"), None);
    assert_eq!(answer["nearest"].is_null(), answer["nearestMotion"].is_null());

    let nothing = r#"{"outcome": "OUTCOME_BUDGET_EXHAUSTED"}"#;
    validate.with("-").input(nothing).complains(2, "no grasp");
}

#[tokio::test(flavor = "multi_thread")]
async fn givers_are_ranked() {
    let evaluate = grasp("evaluate --holdout remote-hold1").at(&real_server().await);
    let both = evaluate.with("--holdout remote-hold2 --budget 2s");
    assert_contains(&both.text(), &["remote-hold1", "remote-hold2"]);
    let answer = both.with("--json").run().json();
    assert_eq!(answer["ratings"].as_array().map(Vec::len), Some(2));
    let ranking = [0, 1].map(|place| answer["ratings"][place]["presentingHand"].as_u64().unwrap_or(0));
    assert!(ranking == [0, 1] || ranking == [1, 0], "{ranking:?}");
    let other = evaluate.with("--holdout scissors-hold1");
    other.complains(2, "objects/scissors");
}

/// Prints the request that options make of a file.
fn print(options: &str, file: &str) -> Call {
    grasp("find --request - --print-request")
        .with(options)
        .input(file)
}

#[tokio::test(flavor = "multi_thread")]
async fn options_override_the_file_and_keep_the_rest() {
    let file = r#"{"holdout": {"object": "objects/remote"},
        "search": {"choice": "GRASP_CHOICE_FIRST_VALID", "refinementTime": "0.01s"},
        "receiver": {"handedness": "HANDEDNESS_LEFT", "client_shoulder": {"y": 1}, "forearmLength": 0.25},
        "requirements": {"excludedGraspTypes": ["GRASP_TYPE_STICK"], "must_not_touch": ["DIGIT_MIDDLE"],
        "thesis": {"max_comfort": 0.5, "strategy": "STRATEGY_A"}}}"#;
    let kept = print("", file).json();
    assert_eq!(print("", &kept.to_string()).json(), kept, "it can be read again");
    assert_eq!(kept["receiver"]["clientShoulder"]["y"], 1.0);
    assert_eq!(kept["search"]["refinementTime"], "0.010s");
    let options = "--choice best --strategy f --validity physical --bend-ratios all --receiving-hand right --receiving-rig adult";
    let request = print(options, file).json();
    assert_eq!(
        request["search"],
        json!({"choice": "GRASP_CHOICE_BEST_WITHIN_BUDGET", "refinementTime": "0.010s"})
    );
    assert_eq!(
        request["receiver"],
        json!({
            "rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "clientShoulder": {"y": 1.0}, "forearmLength": 0.25,
        })
    );
    assert_eq!(
        request["requirements"],
        json!({
            "excludedGraspTypes": ["GRASP_TYPE_STICK"],
            "mustNotTouch": ["DIGIT_MIDDLE"],
            "thesis": {"maxComfort": 0.5, "strategy": "STRATEGY_F", "bendRatios": "BEND_RATIOS_ALL"},
        })
    );
}

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
