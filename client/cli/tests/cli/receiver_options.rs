//! Options for the receiver's body, the receiving hand and the improvement.

use std::process::Output;

use serde_json::Value;

use crate::commands::{code, json, run_with_input, text};

/// The request that options make of a file.
fn printed(options: &[&str], file: &str) -> Output {
    let common = ["find", "--request", "-", "--print-request"];
    run_with_input(&[&common[..], options].concat(), file)
}

#[tokio::test(flavor = "multi_thread")]
async fn options_describe_the_receivers_body_and_the_improvement() {
    let file = r#"{"holdout": {"object": "objects/remote"}, "search": {"refinementTime": "0.01s"},
        "receiver": {"handedness": "HANDEDNESS_LEFT", "client_shoulder": {"y": 1}, "forearmLength": 0.25}}"#;
    let kept = json(&printed(&[], file).stdout);
    assert_eq!(kept["receiver"]["clientShoulder"]["y"], 1.0);
    assert_eq!(kept["search"]["refinementTime"], "0.010s");
    let options = [
        "--receiver-root",
        "-1,0,0.5,90",
        "--receiver-height",
        "1.75",
        "--upper-arm",
        "0.5",
        "--receiving-hand",
        "either",
        "--improvement",
        "0",
    ];
    let output = printed(&options, file);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let request = json(&output.stdout);
    let receiver = &request["receiver"];
    assert_eq!(receiver["clientShoulder"], Value::Null);
    assert_eq!(receiver["height"], 1.75);
    assert_eq!(
        receiver["clientFromRoot"]["position"],
        serde_json::json!({"x": -1.0, "z": 0.5})
    );
    let turn = receiver["clientFromRoot"]["orientation"]["y"].as_f64().unwrap();
    assert!((turn - std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-6);
    assert_eq!(
        (&receiver["upperArmLength"], &receiver["forearmLength"]),
        (&0.5.into(), &0.25.into())
    );
    assert_eq!(receiver["handedness"], Value::Null);
    assert_eq!(request["search"]["refinementTime"], "0s");
    let shoulder = printed(
        &["--receiver-shoulder", "-0.5,1.5,0"],
        r#"{"holdout": {"object": "objects/remote"}}"#,
    );
    let shoulder = json(&shoulder.stdout);
    assert_eq!(
        shoulder["receiver"]["clientShoulder"],
        serde_json::json!({"x": -0.5, "y": 1.5})
    );
    let any = printed(
        &["--receiver-stance", "any", "--receiving-rig", "adult"],
        r#"{"holdout": {"object": "objects/remote"}}"#,
    );
    assert_eq!(
        json(&any.stdout)["receiver"],
        serde_json::json!({"anywhere": true, "rig": "rigs/adult"})
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_options_that_make_no_body() {
    let bare = r#"{"holdout": {"object": "objects/remote"}}"#;
    let unreal =
        r#"{"holdout": {"object": "objects/remote"}, "output": {"convention": "CONVENTION_UNREAL"}}"#;
    let root = ["--receiver-root", "0,0,1,0", "--receiver-height", "1.7"];
    let cases: [(&[&str], &str, &str); 6] = [
        (&["--upper-arm", "0.3"], bare, "require a body"),
        (&["--receiver-height", "1.7"], bare, "--receiver-root"),
        (
            &["--receiver-root", "0,0,1", "--receiver-height", "1.7"],
            bare,
            "0,0,-1,180",
        ),
        (&root, unreal, "openxr"),
        (
            &["--receiver-shoulder", "0,1,0", "--receiver-stance", "any"],
            bare,
            "cannot be used with",
        ),
        (&["--improvement=-1s"], bare, "2ms, 1s or 0"),
    ];
    for (options, file, expected) in cases {
        let output = printed(options, file);
        assert_eq!(code(&output), 2, "{options:?}");
        let message = text(&output.stderr);
        assert!(message.contains(expected), "{options:?}: {message}");
    }
}
