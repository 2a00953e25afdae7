//! Grasps as they come, from a real server.

use crate::{
    commands::{code, empty_folder, run, text},
    real_server::real_server,
};

/// The lines of standard output as JSON.
fn lines(output: &[u8]) -> Vec<serde_json::Value> {
    let lines = text(output).lines().map(serde_json::from_str);
    lines.map(|line| line.expect("each line is JSON")).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_a_line_per_better_grasp_and_a_summary() {
    let url = real_server().await;
    let find = [
        "find",
        "--holdout",
        "remote-hold1",
        "--budget",
        "300ms",
        "--stream",
        "--server",
        &url,
    ];
    let output = run(&[&find[..], &["--json"]].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let lines = lines(&output.stdout);
    let (summary, grasps) = lines.split_last().unwrap();
    assert_eq!(summary["outcome"], "OUTCOME_FOUND");
    assert_eq!(summary.get("grasps"), None);
    let totals: Vec<f64> = grasps
        .iter()
        .map(|line| line["grasps"][0]["score"].as_f64().unwrap())
        .collect();
    assert!(
        !totals.is_empty() && totals.is_sorted_by(|a, b| a < b),
        "{totals:?}"
    );
    let found_after = grasps[0]["report"]["searchTime"]
        .as_str()
        .unwrap()
        .strip_suffix('s');
    assert!(found_after.unwrap().parse::<f64>().unwrap() < 0.3);
    let table = run(&find);
    let table = text(&table.stdout);
    assert!(
        table.lines().count() >= 3 && table.contains("valid grasps"),
        "{table}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn alternatives_are_drawn_into_numbered_files() {
    let url = real_server().await;
    let folder = empty_folder("alternatives");
    let glb = folder.join("scene.glb");
    let output = run(&[
        "find",
        "--holdout",
        "remote-hold1",
        "--budget",
        "500ms",
        "--alternatives",
        "2",
        "--differ-by",
        "approach,type",
        "--glb",
        glb.to_str().unwrap(),
        "--json",
        "--server",
        &url,
    ]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let lines = lines(&output.stdout);
    assert_eq!(lines.len(), 3);
    for number in [1, 2] {
        let scene = std::fs::read(folder.join(format!("scene-{number}.glb"))).unwrap();
        assert!(scene.starts_with(b"glTF"));
    }
    assert!(!glb.exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn options_of_streams_need_each_other() {
    for wrong in [
        &["--differ-by", "type"][..],
        &["--most-per-second", "3"],
        &["--stream", "--alternatives", "2"],
        &["--stream", "--reproducible"],
        &["--alternatives", "2", "--differ-by", "colour"],
    ] {
        let output = run(&[&["find", "--holdout", "remote-hold1"], wrong].concat());
        assert_eq!(code(&output), 2, "{wrong:?}");
    }
}
