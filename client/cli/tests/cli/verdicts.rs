//! `grasp validate` and `grasp evaluate` with a real server.

use crate::{
    commands::{code, empty_folder, json, run, run_with_input, text},
    real_server::real_server,
};

#[tokio::test(flavor = "multi_thread")]
async fn found_grasps_are_valid_and_moved_ones_are_not() {
    let url = real_server().await;
    let found = run(&[
        "find",
        "--holdout",
        "remote-hold1",
        "--seed",
        "1",
        "--json",
        "--server",
        &url,
    ]);
    assert_eq!(code(&found), 0, "{}", text(&found.stderr));
    let file = empty_folder("validated").join("found.json");
    std::fs::write(&file, &found.stdout).unwrap();
    let file = file.to_str().unwrap();
    let validate = [
        "validate",
        "--holdout",
        "remote-hold1",
        "--server",
        &url,
        "--grasp",
    ];
    let valid = run(&[&validate[..], &[file]].concat());
    assert_eq!(code(&valid), 0, "{}{}", text(&valid.stdout), text(&valid.stderr));
    let table = text(&valid.stdout);
    assert!(
        table.contains("✓") && !table.contains("✗") && table.contains("giver clearance"),
        "{table}"
    );

    // The grasp alone, 5 cm away, from standard input.
    let mut grasp = json(&found.stdout)["grasps"][0].clone();
    let x = &mut grasp["hand"]["objectFromWrist"]["position"]["x"];
    *x = (x.as_f64().unwrap() + 0.05).into();
    let moved = run_with_input(&[&validate[..], &["-"]].concat(), &grasp.to_string());
    assert_eq!(code(&moved), 3, "{}", text(&moved.stderr));
    assert!(text(&moved.stdout).contains("✗"));
    let options = ["-", "--json", "--find-nearest", "--budget", "500ms"];
    let answer = run_with_input(&[&validate[..], &options].concat(), &grasp.to_string());
    assert_eq!(code(&answer), 3);
    let answer = json(&answer.stdout);
    // False is not written.
    assert_eq!(answer.get("valid"), None);
    let verdicts = answer["verdicts"].as_array().unwrap();
    assert_eq!(verdicts.len(), 12);
    assert!(
        verdicts
            .iter()
            .any(|verdict| verdict.get("passed").is_none() && verdict["value"].is_number())
    );
    assert_eq!(answer["nearest"].is_null(), answer["nearestMotion"].is_null());

    let nothing = run_with_input(
        &[&validate[..], &["-"]].concat(),
        r#"{"outcome": "OUTCOME_BUDGET_EXHAUSTED"}"#,
    );
    assert_eq!(code(&nothing), 2);
    assert!(
        text(&nothing.stderr).contains("no grasp"),
        "{}",
        text(&nothing.stderr)
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn givers_are_ranked() {
    let url = real_server().await;
    let evaluate = [
        "evaluate",
        "--holdout",
        "remote-hold1",
        "--holdout",
        "remote-hold2",
        "--budget",
        "2s",
        "--server",
        &url,
    ];
    let people = run(&evaluate);
    assert_eq!(code(&people), 0, "{}", text(&people.stderr));
    let table = text(&people.stdout);
    assert!(
        table.contains("remote-hold1") && table.contains("remote-hold2"),
        "{table}"
    );
    let scripts = run(&[&evaluate[..], &["--json"]].concat());
    let answer = json(&scripts.stdout);
    assert_eq!(answer["ratings"].as_array().map(Vec::len), Some(2));
    let ranking = [0, 1].map(|place| answer["ratings"][place]["presentingHand"].as_u64().unwrap_or(0));
    assert!(ranking == [0, 1] || ranking == [1, 0], "{ranking:?}");
    let other = run(&[
        "evaluate",
        "--holdout",
        "remote-hold1",
        "--holdout",
        "scissors-hold1",
        "--server",
        &url,
    ]);
    assert_eq!(code(&other), 2);
    assert!(
        text(&other.stderr).contains("objects/scissors"),
        "{}",
        text(&other.stderr)
    );
}
