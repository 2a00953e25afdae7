//! Holding on to the grasp of an earlier answer.

use crate::{
    call::{assert_contains, grasp},
    files::{empty_folder, file},
    servers::real_server,
};

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
    let [first, again] = [first, again].map(|answer| answer["grasps"][0]["hand"].clone());
    for field in [
        "thumb",
        "index",
        "middle",
        "ring",
        "little",
        "objectFromWrist",
        "handedness",
    ] {
        assert_eq!(again[field], first[field], "{field}");
        assert!(!first[field].is_null(), "{field}");
    }
    let table = find.run().stdout;
    assert_contains(&table, &["current grasp", "kept"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_without_a_grasp_cannot_be_held_on_to() {
    grasp("find --holdout remote-hold1 --print-request --current -")
        .input(r#"{"outcome": "OUTCOME_BUDGET_EXHAUSTED"}"#)
        .complains(2, "has no grasp");
}
