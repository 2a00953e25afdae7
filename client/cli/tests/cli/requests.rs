//! Requests that options, files and built-in holdouts make.

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
async fn obstacles_come_from_a_file() {
    let print = grasp("find --holdout remote-hold1 --obstacles - --print-request");
    let table = r#"[{"box": {"pose": {"position": {"y": -2}}, "halfExtents": {"x": 1, "y": 0.5, "z": 1}}}]"#;
    let holdout = &print.input(table).json()["holdout"];
    assert_eq!(holdout["obstacles"][0]["box"]["halfExtents"]["y"], 0.5);
    assert!(holdout["presentingHand"].is_object());
    let wrong = print.input(r#"[{"sphere": {}}]"#);
    wrong.complains(2, "obstacles -: [0]: unrecognized field name 'sphere'");
}

#[tokio::test(flavor = "multi_thread")]
async fn options_override_requirements_of_the_file() {
    let file = r#"{"holdout": {"object": "objects/remote"}, "search": {"choice": "GRASP_CHOICE_FIRST_VALID"},
        "requirements": {"excludedGraspTypes": ["GRASP_TYPE_STICK"], "mustTouch": ["DIGIT_RING"],
        "must_not_touch": ["DIGIT_MIDDLE"], "thesis": {"max_comfort": 0.5}}}"#;
    let request = grasp("find --request - --print-request --shoulder -0.5,1.25,0 --reach 0.75")
        .with("--approach -1,0,0,180 --grasp-type Medium-Wrap --grasp-type")
        .arg("sphere 3 finger,tip_pinch")
        .with("--must-touch thumb,index --max-comfort 0.25 --choice best --key-frames")
        .input(file)
        .json();
    assert_eq!(request["search"]["choice"], "GRASP_CHOICE_BEST_WITHIN_BUDGET");
    assert_eq!(request["output"]["keyFrames"], true);
    assert_eq!(
        request["receiver"],
        json!({"clientShoulder": {"x": -0.5, "y": 1.25}, "maxReach": 0.75})
    );
    let mut requirements = request["requirements"].clone();
    let angle = requirements["maxApproachAngle"].take().as_f64().unwrap();
    assert_eq!(angle as f32, std::f32::consts::PI);
    assert_eq!(
        requirements,
        json!({
            "clientApproach": {"x": -1.0},
            "maxApproachAngle": null,
            "allowedGraspTypes": ["GRASP_TYPE_MEDIUM_WRAP", "GRASP_TYPE_SPHERE_3_FINGER", "GRASP_TYPE_TIP_PINCH"],
            "excludedGraspTypes": ["GRASP_TYPE_STICK"],
            "mustTouch": ["DIGIT_THUMB", "DIGIT_INDEX"],
            "mustNotTouch": ["DIGIT_MIDDLE"],
            "thesis": {"maxComfort": 0.25},
        })
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn several_grasp_types_can_be_excluded() {
    let print = grasp("find --holdout remote-hold1 --print-request");
    let excluding = print.with("--not-grasp-type tripod --not-grasp-type ring");
    assert_eq!(
        excluding.json()["requirements"],
        json!({"excludedGraspTypes": ["GRASP_TYPE_TRIPOD", "GRASP_TYPE_RING"]})
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn options_describe_the_receivers_body_and_the_improvement() {
    let file = r#"{"holdout": {"object": "objects/remote"}, "search": {"refinementTime": "0.01s"},
        "receiver": {"handedness": "HANDEDNESS_LEFT", "client_shoulder": {"y": 1}, "forearmLength": 0.25}}"#;
    let kept = print("", file).json();
    assert_eq!(kept["receiver"]["clientShoulder"]["y"], 1.0);
    assert_eq!(kept["search"]["refinementTime"], "0.010s");
    let options = "--receiver-root -1,0,0.5,90 --receiver-height 1.75 --upper-arm 0.5 --receiving-hand either \
                   --refinement 0";
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
async fn a_body_at_its_root_needs_the_convention_of_the_option() {
    let unreal =
        r#"{"holdout": {"object": "objects/remote"}, "output": {"convention": "CONVENTION_UNREAL"}}"#;
    print("--receiver-root 0,0,1,0 --receiver-height 1.7", unreal).complains(2, "openxr");
}
