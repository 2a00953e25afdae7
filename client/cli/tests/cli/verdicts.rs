//! `grasp validate` and `grasp evaluate` with a real server.

use crate::{
    call::{assert_contains, grasp},
    files::{empty_folder, file},
    servers::real_server,
};

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
    let verdicts = answer["verdicts"].as_array().unwrap();
    assert_eq!(verdicts.len(), 12);
    let failed =
        |verdict: &serde_json::Value| verdict.get("passed").is_none() && verdict["value"].is_number();
    assert!(verdicts.iter().any(failed));
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
