//! Standard output, standard error and exit codes of the binary.

use std::{
    io::Write as _,
    process::{Child, Command, Output, Stdio},
    time::Duration,
};

use serde_json::Value;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

use crate::scripted::{Act, Scripted};

/// A command that runs the binary, without variables of the environment that would affect it.
fn grasp(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grasp"));
    command
        .args(arguments)
        .env_remove("GRASP_SERVER")
        .env_remove("GRASP_LOG")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Runs the binary while the test's runtime serves.
pub(crate) fn run(arguments: &[&str]) -> Output {
    run_with_input(arguments, "")
}

pub(crate) fn run_with_input(arguments: &[&str], input: &str) -> Output {
    tokio::task::block_in_place(|| {
        let mut child = grasp(arguments).spawn().unwrap();
        // Fails if the command has closed its input.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait_with_output().unwrap()
    })
}

pub(crate) fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

pub(crate) fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

pub(crate) fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).unwrap_or_else(|error| panic!("{error} in {:?}", text(bytes)))
}

/// A URL at which no server listens.
fn closed_port() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    format!("http://{}", listener.local_addr().unwrap())
}

fn invalid() -> Act {
    let mut details =
        ErrorDetails::with_bad_request_violation("object.mass_kg", "is -1; it must be more than 0");
    details.add_bad_request_violation("mesh", "is empty");
    let status = Status::with_error_details(Code::InvalidArgument, "the object has 2 errors", details);
    Act::Fail(status)
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_objects_as_table_and_as_json() {
    // Three pages, of an object each, and the atlas of each object for the table.
    let service = Scripted::new((0..9).map(|_| Act::Answer));
    let url = service.serve().await;
    let people = run(&["objects", "list", "--server", &url]);
    assert_eq!(code(&people), 0, "{}", text(&people.stderr));
    let table = text(&people.stdout);
    assert!(
        table.contains("objects/b") && table.contains("objects/c"),
        "{table}"
    );
    let scripts = run(&["objects", "list", "--json", "--server", &url]);
    assert_eq!(json(&scripts.stdout)["objects"][2]["name"], "objects/c");
}

#[tokio::test(flavor = "multi_thread")]
async fn shows_object_by_short_name() {
    let service = Scripted::new([Act::Answer]);
    let url = service.serve().await;
    let output = run(&["objects", "get", "remote", "--json", "--server", &url]);
    assert_eq!(json(&output.stdout)["name"], "objects/remote");
}

#[tokio::test(flavor = "multi_thread")]
async fn names_created_object_after_its_file() {
    let service = Scripted::new([Act::Answer]);
    let url = service.serve().await;
    let folder = empty_folder("created_object");
    let mesh = folder.join("Coffee Mug.obj");
    std::fs::write(&mesh, "v 0 0 0\n").unwrap();
    let mesh = mesh.to_str().unwrap();
    let output = run(&[
        "objects", "create", "--mesh", mesh, "--mass", "0.2", "--json", "--server", &url,
    ]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    assert_eq!(json(&output.stdout)["name"], "objects/coffee-mug");
}

/// An empty folder for one test, in cargo's folder for integration tests.
pub(crate) fn empty_folder(name: &str) -> std::path::PathBuf {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_each_violation_on_its_own_line() {
    let service = Scripted::new([invalid(), invalid()]);
    let url = service.serve().await;
    let mesh = empty_folder("violations").join("empty.obj");
    std::fs::write(&mesh, "").unwrap();
    let mesh = mesh.to_str().unwrap();
    let people = run(&[
        "objects",
        "create",
        "x",
        "--mesh",
        mesh,
        "--mass=-1",
        "--server",
        &url,
    ]);
    assert_eq!(code(&people), 4);
    assert_eq!(
        text(&people.stderr),
        "error: the object has 2 errors\n  object.mass_kg: is -1; it must be more than 0\n  mesh: is empty\n"
    );
    assert!(people.stdout.is_empty());
    let scripts = run(&[
        "--json",
        "objects",
        "create",
        "x",
        "--mesh",
        mesh,
        "--mass=-1",
        "--server",
        &url,
    ]);
    assert_eq!(code(&scripts), 4);
    let error = &json(&scripts.stderr)["error"];
    assert_eq!(error["kind"], "invalid_argument");
    assert_eq!(error["code"], "INVALID_ARGUMENT");
    assert_eq!(error["field_violations"][1]["field"], "mesh");
}

#[tokio::test(flavor = "multi_thread")]
async fn does_not_repeat_single_violation() {
    let details = ErrorDetails::with_bad_request_violation("name", "is \"anvil/1\"");
    let message = "name: is \"anvil/1\"";
    let status = Status::with_error_details(Code::InvalidArgument, message, details);
    let url = Scripted::new([Act::Fail(status)]).serve().await;
    let output = run(&["objects", "get", "anvil/1", "--server", &url]);
    assert_eq!(
        text(&output.stderr),
        "error: the request has 1 field wrong\n  name: is \"anvil/1\"\n"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn not_found_exits_with_4() {
    let details =
        ErrorDetails::with_resource_info("grasp/GraspObject", "objects/anvil", "", "does not exist");
    let status = Status::with_error_details(Code::NotFound, "no object is called objects/anvil", details);
    let url = Scripted::new([Act::Fail(status)]).serve().await;
    let output = run(&["objects", "get", "anvil", "--server", &url]);
    assert_eq!(code(&output), 4);
    assert_eq!(text(&output.stderr), "error: no object is called objects/anvil\n");
}

#[tokio::test(flavor = "multi_thread")]
async fn unreachable_server_exits_with_5() {
    let people = run(&["health", "--server", &closed_port()]);
    assert_eq!(code(&people), 5);
    assert!(
        text(&people.stderr).starts_with("error: cannot connect to http://127.0.0.1:"),
        "{}",
        text(&people.stderr)
    );
    let scripts = run(&["health", "--json", "--server", &closed_port()]);
    assert_eq!(code(&scripts), 5);
    assert_eq!(json(&scripts.stderr)["error"]["kind"], "connect");
}

#[tokio::test(flavor = "multi_thread")]
async fn unavailable_server_exits_with_5() {
    let unavailable = (0..2).map(|_| Act::Fail(Status::unavailable("draining")));
    let service = Scripted::new(unavailable);
    let url = service.serve().await;
    let output = run(&["objects", "get", "remote", "--tries", "2", "--server", &url]);
    assert_eq!(code(&output), 5);
    assert_eq!(text(&output.stderr), "error: draining (tried 2 times)\n");
    assert_eq!(service.calls(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn health_exits_with_0_when_serving() {
    let url = Scripted::default().serve().await;
    let output = run(&["health", "--server", &url]);
    assert_eq!((code(&output), text(&output.stdout)), (0, "serving\n"));
    let output = run(&["health", "--json", "--server", &url]);
    assert_eq!(json(&output.stdout)["health"], "serving");
}

#[tokio::test(flavor = "multi_thread")]
async fn no_grasp_within_the_budget_exits_with_3() {
    let service = Scripted::new([Act::Answer, Act::Answer]);
    let url = service.serve().await;
    let request = r#"{"holdout": {"object": "objects/remote"}, "search": {"budget": "1s"}}"#;
    let arguments = ["find", "--request", "-", "--budget", "250ms", "--server", &url];
    let people = run_with_input(&arguments, request);
    assert_eq!(code(&people), 3, "{}", text(&people.stderr));
    assert!(text(&people.stdout).contains("no grasp within the budget"));
    assert!(
        text(&people.stdout).contains("limited by  mass: 80 kg\n"),
        "{}",
        text(&people.stdout)
    );
    let scripts = run_with_input(&[&arguments[..], &["--json"]].concat(), request);
    assert_eq!(code(&scripts), 3);
    let answer = json(&scripts.stdout);
    assert_eq!(answer["outcome"], "OUTCOME_BUDGET_EXHAUSTED");
    assert_eq!(answer.get("grasps"), None);
    let limit = &answer["report"]["limits"][0];
    assert_eq!(limit["check"], "CHECK_MASS");
    assert_eq!(limit["bound"], 70.0);
    // The option overrides the file.
    let printed = run_with_input(&[&arguments[..], &["--print-request"]].concat(), request);
    assert_eq!(json(&printed.stdout)["search"]["budget"], "0.250s");
}

#[tokio::test(flavor = "multi_thread")]
async fn usage_errors_exit_with_2_without_a_server() {
    let cases: [(&[&str], &str); 10] = [
        (&[], "Usage"),
        (&["find"], "--holdout"),
        (
            &["find", "--holdout", "a", "--request", "b"],
            "cannot be used with",
        ),
        (
            &["find", "--holdout", "teapot-hold1"],
            "\"teapot-hold1\" is not built in",
        ),
        (&["find", "--holdout", "remote-hold1", "--budget", "5"], "500ms"),
        (
            &["find", "--holdout", "remote-hold1", "--strategy", "G"],
            "[possible values: A, B, C, D, E, F, GUIDED]",
        ),
        (
            &["find", "--holdout", "remote-hold1", "--reach", "1"],
            "--shoulder",
        ),
        (
            &["find", "--holdout", "remote-hold1", "--approach", "0,0,1"],
            "0,0,-1,45",
        ),
        (
            &["find", "--holdout", "remote-hold1", "--must-touch", "thumb,toe"],
            "[possible values: thumb, index, middle, ring, little]",
        ),
        (&["health", "--server", "nowhere"], "is not a URL"),
    ];
    for (arguments, expected) in cases {
        let people = run(arguments);
        assert_eq!(code(&people), 2, "{arguments:?}");
        let message = text(&people.stderr);
        assert!(message.contains(expected), "{arguments:?}: {message}");
        let scripts = run(&[arguments, &["--json"]].concat());
        assert_eq!(code(&scripts), 2, "{arguments:?}");
        assert!(json(&scripts.stderr)["error"]["message"].is_string());
    }
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
        let output = run_with_input(&["find", "--request", "-"], request);
        assert_eq!(code(&output), 2);
        let message = text(&output.stderr);
        assert!(message.contains(expected), "{message}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn printed_request_can_be_read_again() {
    let printed = run_with_input(
        &["find", "--request", "-", "--print-request", "--seed", "7"],
        r#"{"holdout": {"object": "objects/remote"}}"#,
    );
    assert_eq!(code(&printed), 0);
    assert_eq!(json(&printed.stdout)["search"]["seed"], "7");
    let again = run_with_input(
        &["find", "--request", "-", "--print-request"],
        text(&printed.stdout),
    );
    assert_eq!(text(&again.stdout), text(&printed.stdout));
}

#[tokio::test(flavor = "multi_thread")]
async fn obstacles_come_from_a_file() {
    let arguments = [
        "find",
        "--holdout",
        "remote-hold1",
        "--obstacles",
        "-",
        "--print-request",
    ];
    let table = r#"[{"box": {"pose": {"position": {"y": -2}}, "halfExtents": {"x": 1, "y": 0.5, "z": 1}}}]"#;
    let printed = run_with_input(&arguments, table);
    assert_eq!(code(&printed), 0);
    let holdout = &json(&printed.stdout)["holdout"];
    assert_eq!(holdout["obstacles"][0]["box"]["halfExtents"]["y"], 0.5);
    assert!(holdout["presentingHand"].is_object());
    let wrong = run_with_input(&arguments, r#"[{"sphere": {}}]"#);
    assert_eq!(code(&wrong), 2);
    assert!(
        text(&wrong.stderr).contains("obstacles -: [0]: unrecognized field name 'sphere'"),
        "{}",
        text(&wrong.stderr)
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn options_override_requirements_of_the_file() {
    let file = r#"{"holdout": {"object": "objects/remote"}, "search": {"choice": "GRASP_CHOICE_FIRST_VALID"},
        "requirements": {"excludedGraspTypes": ["GRASP_TYPE_STICK"], "mustTouch": ["DIGIT_RING"],
        "must_not_touch": ["DIGIT_MIDDLE"], "thesis": {"max_comfort": 0.5}}}"#;
    let arguments = [
        "find",
        "--request",
        "-",
        "--print-request",
        "--shoulder",
        "-0.5,1.25,0",
        "--reach",
        "0.75",
        "--approach",
        "-1,0,0,180",
        "--grasp-type",
        "Medium-Wrap",
        "--grasp-type",
        "sphere 3 finger,tip_pinch",
        "--must-touch",
        "thumb,index",
        "--max-comfort-e",
        "0.25",
        "--choice",
        "best",
        "--key-frames",
    ];
    let printed = run_with_input(&arguments, file);
    assert_eq!(code(&printed), 0, "{}", text(&printed.stderr));
    let request = json(&printed.stdout);
    assert_eq!(request["search"]["choice"], "GRASP_CHOICE_BEST_WITHIN_BUDGET");
    assert_eq!(request["output"]["keyFrames"], true);
    let requirements = &request["requirements"];
    assert_eq!(requirements["clientApproach"], serde_json::json!({"x": -1.0}));
    assert_eq!(
        requirements["maxApproachAngle"]
            .as_f64()
            .map(|angle| angle as f32),
        Some(std::f32::consts::PI)
    );
    assert_eq!(
        request["receiver"],
        serde_json::json!({"clientShoulder": {"x": -0.5, "y": 1.25}, "maxReach": 0.75})
    );
    assert_eq!(
        requirements["allowedGraspTypes"],
        serde_json::json!([
            "GRASP_TYPE_MEDIUM_WRAP",
            "GRASP_TYPE_SPHERE_3_FINGER",
            "GRASP_TYPE_TIP_PINCH"
        ])
    );
    assert_eq!(
        requirements["excludedGraspTypes"],
        serde_json::json!(["GRASP_TYPE_STICK"])
    );
    assert_eq!(
        requirements["mustTouch"],
        serde_json::json!(["DIGIT_THUMB", "DIGIT_INDEX"])
    );
    assert_eq!(requirements["mustNotTouch"], serde_json::json!(["DIGIT_MIDDLE"]));
    assert_eq!(requirements["thesis"], serde_json::json!({"maxComfort": 0.25}));
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_unknown_grasp_types() {
    for (option, given) in [("--grasp-type", "unclassifiable"), ("--not-grasp-type", "pinch")] {
        let output = run(&[
            "find",
            "--holdout",
            "remote-hold1",
            "--print-request",
            option,
            given,
        ]);
        assert_eq!(code(&output), 2, "{}", text(&output.stdout));
        let message = text(&output.stderr);
        assert!(message.contains(given) && message.contains(option), "{message}");
    }
    let line = "find --holdout remote-hold1 --print-request --not-grasp-type tripod --not-grasp-type ring";
    let output = run(&line.split(' ').collect::<Vec<_>>());
    assert_eq!(
        json(&output.stdout)["requirements"],
        serde_json::json!({"excludedGraspTypes": ["GRASP_TYPE_TRIPOD", "GRASP_TYPE_RING"]})
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn completions_contain_the_commands() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = run(&["completions", shell]);
        assert_eq!(code(&output), 0);
        let script = text(&output.stdout);
        for command in ["objects", "find", "health", "holdout"] {
            assert!(script.contains(command), "{shell}: {command}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn closed_pipe_ends_quietly() {
    let url = Scripted::new((0..6).map(|_| Act::Answer)).serve().await;
    for arguments in [
        vec!["completions", "bash"],
        vec!["--help"],
        vec!["objects", "list", "--server", &url],
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = tokio::task::block_in_place(|| grasp(&arguments).stdout(writer).output().unwrap());
        assert_eq!(code(&output), 0, "{arguments:?}");
        assert_eq!(text(&output.stderr), "", "{arguments:?}");
    }
}

/// Interrupts a process like Ctrl-C, and waits until it ends.
#[cfg(unix)]
fn interrupt(child: Child) -> Output {
    let id = child.id().to_string();
    tokio::task::block_in_place(|| {
        let interrupted = Command::new("kill").args(["-INT", &id]).status().unwrap();
        assert!(interrupted.success());
        child.wait_with_output().unwrap()
    })
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn interrupt_exits_with_130() {
    let service = Scripted::new([Act::Hang]);
    let url = service.serve().await;
    let child = grasp(&["objects", "get", "remote", "--timeout", "5m", "--server", &url])
        .spawn()
        .unwrap();
    while service.calls() == 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let output = interrupt(child);
    assert_eq!(
        (code(&output), text(&output.stderr)),
        (130, "error: interrupted\n")
    );
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn interrupt_ends_a_wait_for_input() {
    let mut child = grasp(&["find", "--request", "-"]).spawn().unwrap();
    // Stays open: the command waits for the rest of the request.
    let mut input = child.stdin.take().unwrap();
    input.write_all(b"{").unwrap();
    // Should the process have no handler yet, the interrupt ends it, too.
    tokio::time::sleep(Duration::from_millis(200)).await;
    let output = interrupt(child);
    assert!(!output.status.success());
    drop(input);
}
