//! The examples, as processes, against a real server.

use std::{
    path::PathBuf,
    process::{Command, Output},
};

/// Runs an example that cargo built along with this test; its standard output.
async fn run(name: &str, arguments: &[&str]) -> String {
    let url = real_server().await;
    // The test is in `deps`, next to `examples`.
    let test = std::env::current_exe().unwrap();
    let folder = test.parent().and_then(|deps| deps.parent()).unwrap();
    let example: PathBuf = folder
        .join("examples")
        .join(name)
        .with_extension(std::env::consts::EXE_EXTENSION);
    assert!(
        example.exists(),
        "build the examples: cargo build --package grasp-client --examples"
    );
    let mut command = Command::new(example);
    command.arg(&url).args(arguments);
    let output: Output = tokio::task::spawn_blocking(move || command.output())
        .await
        .unwrap()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// Starts a real server on a free port until the test's runtime ends; returns its URL.
async fn real_server() -> String {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let config = grasp_server::Config {
        place: grasp_server::config::StorePlace::Memory,
        ..grasp_server::Config::default()
    };
    tokio::spawn(grasp_server::run(listener, config, std::future::pending()));
    url
}

#[tokio::test(flavor = "multi_thread")]
async fn find_grasp_prints_wrist_and_joints() {
    let output = run("find_grasp", &[]).await;
    assert!(
        output.contains("wrist: at") && output.contains("joint 25: at"),
        "{output}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn register_object_finds_grasp_with_tracked_giver() {
    let output = run("register_object", &[]).await;
    assert!(
        output.starts_with("objects/torch: 92 triangles, 150 g"),
        "{output}"
    );
    assert!(output.contains("Thumb touches triangle"), "{output}");
}

#[tokio::test(flavor = "multi_thread")]
async fn track_prints_changes_and_writes_an_animation() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("example_track");
    let glb = folder.join("track.glb");
    let output = run("track", &[glb.to_str().unwrap()]).await;
    // A slow machine may find none in the first frames.
    assert!(output.contains("s: Replanned after"), "{output}");
    assert!(output.contains("900 frames, "), "{output}");
    assert!(std::fs::read(glb).unwrap().starts_with(b"glTF"));
}
