//! The commands about objects, with a real server.

use std::net::Ipv6Addr;

use grasp_server::Config;
use serde_json::Value;
use tokio::net::TcpListener;

use crate::commands::{code, empty_folder, json, run, text};

pub(crate) const BOX_OBJ: &str = "\
v -0.02 -0.015 -0.01
v 0.02 -0.015 -0.01
v 0.02 0.015 -0.01
v -0.02 0.015 -0.01
v -0.02 -0.015 0.01
v 0.02 -0.015 0.01
v 0.02 0.015 0.01
v -0.02 0.015 0.01
g lid
f 1 4 3 2
g rest
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
";

/// Starts a server that lives as long as the test; returns its URL.
async fn server() -> String {
    let listener = TcpListener::bind((Ipv6Addr::LOCALHOST, 0)).await.unwrap();
    let address = listener.local_addr().unwrap();
    let config = Config {
        builder_threads: 0,
        place: grasp_server::config::StorePlace::Memory,
        ..Config::default()
    };
    tokio::spawn(grasp_server::run(listener, config, std::future::pending()));
    format!("http://{address}")
}

/// Runs `grasp objects` with arguments and `--json`, which must succeed.
fn objects(url: &str, arguments: &[&str]) -> Value {
    let all = [&["objects"], arguments, &["--json", "--server", url]].concat();
    let output = run(&all);
    assert_eq!(code(&output), 0, "{arguments:?}: {}", text(&output.stderr));
    json(&output.stdout)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_is_created_changed_listed_and_deleted() {
    let url = server().await;
    let folder = empty_folder("the_life_of_an_object");
    let mesh = folder.join("Tea Tin.obj");
    std::fs::write(&mesh, BOX_OBJ).unwrap();
    let mesh = mesh.to_str().unwrap();
    let created = objects(
        &url,
        &[
            "create",
            "--mesh",
            mesh,
            "--mass",
            "0.2",
            "--label",
            "level=kitchen",
            "--label",
            "fragile",
        ],
    );
    assert_eq!(created["name"], "objects/tea-tin");
    assert_eq!(
        created["labels"],
        serde_json::json!({"fragile": "", "level": "kitchen"})
    );

    let etag = created["etag"].as_str().unwrap();
    let update = [
        "update",
        "tea-tin",
        "--etag",
        etag,
        "--mass",
        "0.3",
        "--forbidden-group",
        "lid",
        "--label",
        "level=attic",
    ];
    let changed = objects(&url, &update);
    assert_eq!(changed["forbiddenTriangleCount"], 2);
    assert_eq!(changed["labels"], serde_json::json!({"level": "attic"}));
    let again = run(&[&["objects"], &update[..], &["--server", &url]].concat());
    assert_eq!(code(&again), 4);
    assert!(text(&again.stderr).contains("etag"), "{}", text(&again.stderr));
    let reset = objects(&url, &["update", "tea-tin", "--nothing-forbidden", "--no-labels"]);
    assert_eq!(
        (reset.get("forbiddenTriangleCount"), reset.get("labels")),
        (None, None)
    );
    let nothing = run(&["objects", "update", "tea-tin", "--server", &url]);
    assert_eq!(code(&nothing), 2);

    objects(&url, &["update", "tea-tin", "--label", "level=attic"]);
    let listed = objects(
        &url,
        &[
            "list",
            "--filter",
            "level=attic",
            "--order-by",
            "create_time desc",
        ],
    );
    assert_eq!(listed["objects"].as_array().unwrap().len(), 1);
    let atlases = objects(&url, &["atlas", "tea-tin"]);
    let names = [0, 1].map(|hand| atlases["atlases"][hand]["name"].clone());
    assert_eq!(
        names,
        ["left", "right"].map(|hand| format!("objects/tea-tin/atlases/{hand}"))
    );
    assert_eq!(
        objects(&url, &["delete", "tea-tin"])["deleted"],
        "objects/tea-tin"
    );
    let gone = run(&["objects", "atlas", "tea-tin", "--server", &url]);
    assert_eq!(code(&gone), 4);
    let gone = run(&["objects", "delete", "tea-tin", "--server", &url]);
    assert_eq!(code(&gone), 4);
    let built_in = run(&["objects", "delete", "remote", "--server", &url]);
    assert_eq!(code(&built_in), 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn watching_shows_rows_or_lines_of_json() {
    let url = server().await;
    let people = run(&["objects", "watch", "--present", "--count", "4", "--server", &url]);
    assert_eq!(code(&people), 0, "{}", text(&people.stderr));
    let lines: Vec<&str> = text(&people.stdout).lines().collect();
    assert_eq!(lines.len(), 4, "a header and three objects: {lines:?}");
    assert!(
        lines[1].starts_with("present") && lines[1].contains("objects/remote"),
        "{lines:?}"
    );
    let scripts = run(&[
        "objects",
        "watch",
        "--present",
        "--count",
        "4",
        "--json",
        "--server",
        &url,
    ]);
    let lines: Vec<Value> = text(&scripts.stdout)
        .lines()
        .map(|line| json(line.as_bytes()))
        .collect();
    assert_eq!(lines.len(), 4);
    assert_eq!(lines[0]["object"]["name"], "objects/remote");
    assert_eq!(
        lines[3],
        serde_json::json!({"changes": ["OBJECT_CHANGE_PRESENT_END"]})
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_mesh_can_be_created_again() {
    let url = server().await;
    let file = empty_folder("a_saved_mesh").join("copy.glb");
    let file = file.to_str().unwrap();
    let saved = objects(&url, &["mesh", "scissors", "--out", file]);
    assert_eq!(saved["bytes"], std::fs::metadata(file).unwrap().len());
    let copy = objects(&url, &["create", "--mesh", file, "--mass", "0.05"]);
    assert_eq!(copy["triangleCount"], saved["object"]["triangleCount"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_larger_than_a_message_is_uploaded() {
    let url = server().await;
    let file = empty_folder("a_large_mesh").join("large.obj");
    std::fs::write(&file, format!("{BOX_OBJ}{}", "# a comment\n".repeat(1 << 20))).unwrap();
    let created = objects(
        &url,
        &["create", "--mesh", file.to_str().unwrap(), "--mass", "0.2"],
    );
    assert_eq!(created["triangleCount"], 12);
}
