//! Holding on to the grasp of an earlier answer.

use crate::{
    commands::{code, empty_folder, json, run, run_with_input, text},
    real_server::real_server,
};

#[tokio::test(flavor = "multi_thread")]
async fn an_earlier_answer_is_held_on_to() {
    let url = real_server().await;
    let find = [
        "find",
        "--holdout",
        "remote-hold1",
        "--receiving-hand",
        "right",
        "--budget",
        "10s",
        "--server",
        &url,
    ];
    let first = run(&[&find[..], &["--json"]].concat());
    assert_eq!(code(&first), 0, "{}", text(&first.stderr));
    let file = empty_folder("the_current_answer").join("answer.json");
    std::fs::write(&file, &first.stdout).unwrap();
    let file = file.to_str().unwrap();
    let again = run(&[&find[..], &["--json", "--current", file]].concat());
    assert_eq!(code(&again), 0, "{}", text(&again.stderr));
    let (first, again) = (json(&first.stdout), json(&again.stdout));
    assert_eq!(again["current"]["status"], "CURRENT_GRASP_STATUS_KEPT");
    assert_eq!(again["origin"]["source"], "GRASP_SOURCE_CURRENT");
    for field in [
        "objectFromWrist",
        "thumb",
        "index",
        "middle",
        "ring",
        "little",
        "handedness",
    ] {
        let of = |answer: &serde_json::Value| answer["grasps"][0]["hand"][field].clone();
        assert_eq!(of(&again), of(&first), "{field}");
        assert!(!of(&first).is_null(), "{field}");
    }
    let people = run(&[&find[..], &["--current", file, "--committed"]].concat());
    let table = text(&people.stdout);
    assert!(
        table.contains("current grasp") && table.contains("kept"),
        "{table}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_held_on_to_is_a_usage_error() {
    let printed = ["find", "--holdout", "remote-hold1", "--print-request"];
    let without = run_with_input(
        &[&printed[..], &["--current", "-"]].concat(),
        r#"{"outcome": "OUTCOME_BUDGET_EXHAUSTED"}"#,
    );
    assert_eq!(code(&without), 2);
    assert!(
        text(&without.stderr).contains("has no grasp"),
        "{}",
        text(&without.stderr)
    );
    let nothing = run(&[&printed[..], &["--committed"]].concat());
    assert_eq!(code(&nothing), 2);
    assert!(
        text(&nothing.stderr).contains("--current"),
        "{}",
        text(&nothing.stderr)
    );
}
