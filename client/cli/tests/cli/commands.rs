//! Standard output, standard error and exit codes of the binary.

use std::{io::Write as _, time::Duration};

use grasp_client::v1;
use serde_json::json;
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt as _};

use crate::{
    harness::{Ended, assert_contains, assert_has, grasp, real_server},
    scripted::{Act, Scripted},
};

/// A URL at which no server listens.
fn closed_port() -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    format!("http://{}", listener.local_addr().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_objects_as_table_and_as_json() {
    let list = grasp("objects list").at(&real_server().await);
    assert_contains(&list.text(), &["objects/remote", "objects/scissors"]);
    assert_eq!(list.json()["objects"][0]["name"], "objects/remote");
}

#[tokio::test(flavor = "multi_thread")]
async fn rejections_exit_with_4_and_list_each_violation_on_its_own_line() {
    let mut two = ErrorDetails::with_bad_request_violation("object.mass_kg", "is -1; it must be more than 0");
    two.add_bad_request_violation("mesh", "is empty");
    let one = ErrorDetails::with_bad_request_violation("name", "is \"anvil/1\"");
    let missing =
        ErrorDetails::with_resource_info("grasp/GraspObject", "objects/anvil", "", "does not exist");
    let invalid = Code::InvalidArgument;
    let lines = "\n  object.mass_kg: is -1; it must be more than 0\n  mesh: is empty\n";
    let listed = format!("error: the object has 2 errors{lines}");
    let unlisted = "error: the request has 1 field wrong\n  name: is \"anvil/1\"\n";
    let unknown = "no object is called objects/anvil";
    for (code, message, details, expected) in [
        (invalid, "the object has 2 errors", two, listed),
        // A single violation is not repeated.
        (invalid, "name: is \"anvil/1\"", one, unlisted.to_owned()),
        (Code::NotFound, unknown, missing, format!("error: {unknown}\n")),
    ] {
        let status = Status::with_error_details(code, message, details);
        let service = Scripted::new((0..2).map(|_| Act::Fail(status.clone())));
        let get = grasp("objects get anvil").at(&service.serve().await);
        let people = get.ends_with(4);
        assert_eq!((people.stderr, people.stdout.as_str()), (expected, ""));
        let error = get.with("--json").ends_with(4).error();
        let code = grasp_client::code_name(code);
        assert_has(&error, &json!({"code": code, "kind": code.to_lowercase()}));
        let is_listed = error["field_violations"][0]["field"].is_string();
        assert_eq!(is_listed, code == grasp_client::code_name(invalid), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn servers_that_are_unreachable_or_unavailable_exit_with_5() {
    let health = grasp("health").at(&closed_port());
    health.complains(5, "error: cannot connect to http://127.0.0.1:");
    let scripts = health.with("--json").ends_with(5);
    assert_eq!(scripts.error()["kind"], "connect");
    let service = Scripted::new([Act::unavailable(), Act::unavailable()]);
    let get = grasp("objects get remote --tries 2").at(&service.serve().await);
    assert_eq!(get.ends_with(5).stderr, "error: draining (tried 2 times)\n");
}

#[tokio::test(flavor = "multi_thread")]
async fn health_exits_with_0_when_serving() {
    let health = grasp("health").at(&real_server().await);
    assert_eq!(health.text(), "serving\n");
    assert_eq!(health.json()["health"], "serving");
}

#[tokio::test(flavor = "multi_thread")]
async fn no_grasp_within_the_budget_exits_with_3() {
    let limit = v1::Verdict {
        description: "mass: 80 kg".to_owned(),
        ..v1::Verdict::default()
    };
    let none = v1::FindGraspResponse {
        outcome: v1::Outcome::BudgetExhausted.into(),
        report: Some(v1::SearchReport {
            limits: vec![limit],
            ..v1::SearchReport::default()
        }),
        ..v1::FindGraspResponse::default()
    };
    let service = Scripted::new([0, 1].map(|_| Act::answer(std::slice::from_ref(&none))));
    let find = grasp("find --request - --budget 250ms")
        .input(r#"{"holdout": {"object": "objects/remote"}, "search": {"budget": "1s"}}"#)
        .at(&service.serve().await);
    let people = find.ends_with(3).stdout;
    assert_contains(
        &people,
        &["no grasp within the budget", "limited by  mass: 80 kg\n"],
    );
    let answer = find.with("--json").ends_with(3).json();
    assert_has(
        &answer,
        &json!({"outcome": "OUTCOME_BUDGET_EXHAUSTED", "grasps": null}),
    );
    assert_eq!(answer["report"]["limits"][0]["description"], "mass: 80 kg");
    // The option overrides the file, and the call's deadline grows with it.
    let call = &service.calls()[0];
    let budget = call.messages::<v1::FindGraspRequest>()[0].budget();
    assert_eq!(budget, Some(Duration::from_millis(250)));
    assert!(call.timeout.starts_with("102"), "{}", call.timeout);
}

#[tokio::test(flavor = "multi_thread")]
async fn usage_errors_exit_with_2_without_a_server() {
    let find = grasp("find --holdout remote-hold1 --print-request");
    let input = |request: &str| grasp("find --request -").input(request);
    let current = find.with("--current -");
    for (call, expected) in [
        (grasp(""), "Usage"),
        (
            input(r#"{"holdout": {"objekt": ""}}"#),
            "holdout.objekt: is no field of Holdout; it has object,",
        ),
        (input("{\n\"holdout\": {},\n}"), "line 3"),
        (
            current.input(r#"{"outcome": "OUTCOME_BUDGET_EXHAUSTED"}"#),
            "has no grasp",
        ),
        (grasp("find"), "--holdout"),
        (grasp("find --holdout a --request b"), "cannot be used with"),
        (grasp("find --holdout teapot"), "\"teapot\" is not built in"),
        (grasp("health --server nowhere"), "is not a URL"),
        (find.with("--budget 5"), "500ms"),
        (find.with("--strategy G"), "values: A, B, C, D, E, F, GUIDED]"),
        (find.with("--differ-by type"), "--alternatives"),
        (find.with("--stream --alternatives 2"), "cannot be used with"),
        (find.with("--stream --reproducible"), "cannot be used with"),
        (find.with("--alternatives 2 --differ-by colour"), "'colour'"),
    ] {
        call.complains(2, expected);
        let scripts = call.with("--json").ends_with(2);
        assert!(scripts.error()["message"].is_string());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn completions_contain_the_commands() {
    let script = grasp("completions fish").text();
    assert_contains(&script, &["objects", "find", "health", "holdout"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn closed_pipe_ends_quietly() {
    let list = grasp("objects list").at(&real_server().await);
    for call in [grasp("completions bash"), grasp("--help"), list] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = tokio::task::block_in_place(|| call.command().stdout(writer).output().unwrap());
        let ended = Ended::from(output);
        assert_eq!((ended.code, ended.stderr.as_str()), (0, ""));
    }
}

/// Interrupts a process like Ctrl-C, and waits until it ends.
#[cfg(unix)]
fn interrupt(child: std::process::Child) -> Ended {
    let id = child.id().to_string();
    tokio::task::block_in_place(|| {
        let mut kill = std::process::Command::new("kill");
        assert!(kill.args(["-INT", &id]).status().unwrap().success());
        child.wait_with_output().unwrap().into()
    })
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn interrupt_exits_with_130() {
    let service = Scripted::new([Act::Hang]);
    let get = grasp("objects get remote --timeout 5m").at(&service.serve().await);
    let child = get.command().spawn().unwrap();
    while service.calls().is_empty() {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let ended = interrupt(child);
    assert_eq!((ended.code, ended.stderr.as_str()), (130, "error: interrupted\n"));
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn interrupt_ends_a_wait_for_input() {
    let mut child = grasp("find --request -").command().spawn().unwrap();
    // Stays open: the command waits for the rest of the request.
    let mut input = child.stdin.take().unwrap();
    input.write_all(b"{").unwrap();
    // Without a handler yet, the interrupt ends the process, too.
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert_ne!(interrupt(child).code, 0);
    drop(input);
}
