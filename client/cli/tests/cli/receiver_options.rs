//! Options for the receiver's body, the receiving hand and the improvement.

use serde_json::{Value, json};

use crate::call::{Call, grasp};

const BARE: &str = r#"{"holdout": {"object": "objects/remote"}}"#;

/// Prints the request that options make of a file.
fn print(options: &str, file: &str) -> Call {
    grasp("find --request - --print-request")
        .with(options)
        .input(file)
}

#[tokio::test(flavor = "multi_thread")]
async fn options_describe_the_receivers_body_and_the_improvement() {
    let file = r#"{"holdout": {"object": "objects/remote"}, "search": {"refinementTime": "0.01s"},
        "receiver": {"handedness": "HANDEDNESS_LEFT", "client_shoulder": {"y": 1}, "forearmLength": 0.25}}"#;
    let kept = print("", file).json();
    assert_eq!(kept["receiver"]["clientShoulder"]["y"], 1.0);
    assert_eq!(kept["search"]["refinementTime"], "0.010s");
    let options = "--receiver-root -1,0,0.5,90 --receiver-height 1.75 --upper-arm 0.5 --receiving-hand either \
                   --improvement 0";
    let request = print(options, file).json();
    assert_eq!(request["search"]["refinementTime"], "0s");
    let mut receiver = request["receiver"].clone();
    let orientation = receiver["clientFromRoot"]["orientation"].take();
    let turn = orientation["y"].as_f64().unwrap();
    assert!((turn - std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-6);
    assert_eq!(
        receiver,
        json!({
            "clientFromRoot": {"position": {"x": -1.0, "z": 0.5}, "orientation": Value::Null},
            "height": 1.75,
            "upperArmLength": 0.5,
            "forearmLength": 0.25,
        })
    );
    for (options, receiver) in [
        (
            "--receiver-shoulder -0.5,1.5,0",
            json!({"clientShoulder": {"x": -0.5, "y": 1.5}}),
        ),
        (
            "--receiver-stance any --receiving-rig adult",
            json!({"anywhere": true, "rig": "rigs/adult"}),
        ),
    ] {
        assert_eq!(print(options, BARE).json()["receiver"], receiver);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_options_that_make_no_body() {
    let unreal =
        r#"{"holdout": {"object": "objects/remote"}, "output": {"convention": "CONVENTION_UNREAL"}}"#;
    for (options, file, expected) in [
        ("--upper-arm 0.3", BARE, "require a body"),
        ("--receiver-height 1.7", BARE, "--receiver-root"),
        ("--receiver-root 0,0,1 --receiver-height 1.7", BARE, "0,0,-1,180"),
        ("--receiver-root 0,0,1,0 --receiver-height 1.7", unreal, "openxr"),
        (
            "--receiver-shoulder 0,1,0 --receiver-stance any",
            BARE,
            "cannot be used with",
        ),
        ("--improvement=-1s", BARE, "2ms, 1s or 0"),
    ] {
        print(options, file).complains(2, expected);
    }
}
