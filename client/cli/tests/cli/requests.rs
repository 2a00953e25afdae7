//! Requests that options, files and built-in holdouts make.

use serde_json::json;

use crate::call::{Call, grasp};

const BARE: &str = r#"{"holdout": {"object": "objects/remote"}}"#;

/// Prints the request that options make of a file.
fn print(options: &str, file: &str) -> Call {
    grasp("find --request - --print-request")
        .with(options)
        .input(file)
}

#[tokio::test(flavor = "multi_thread")]
async fn malformed_request_exits_with_2_and_names_the_place() {
    for (request, expected) in [
        (
            "{\n  \"holdout\": {\n    \"objekt\": \"objects/remote\"\n  }\n}",
            "holdout: unrecognized field name 'objekt'",
        ),
        ("{\n  \"holdout\": {},\n}", "line 3"),
    ] {
        grasp("find --request -").input(request).complains(2, expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn printed_request_can_be_read_again() {
    let printed = print("--seed 7", BARE).ends_with(0);
    assert_eq!(printed.json()["search"]["seed"], "7");
    assert_eq!(print("", &printed.stdout).text(), printed.stdout);
}

#[tokio::test(flavor = "multi_thread")]
async fn options_override_the_file_and_keep_the_rest() {
    let file = r#"{"holdout": {"object": "objects/remote"},
        "search": {"choice": "GRASP_CHOICE_FIRST_VALID", "refinementTime": "0.01s"},
        "receiver": {"handedness": "HANDEDNESS_LEFT", "client_shoulder": {"y": 1}, "forearmLength": 0.25},
        "requirements": {"excludedGraspTypes": ["GRASP_TYPE_STICK"], "must_not_touch": ["DIGIT_MIDDLE"],
        "thesis": {"max_comfort": 0.5, "strategy": "STRATEGY_A"}}}"#;
    let kept = print("", file).json();
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
