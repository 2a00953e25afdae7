//! Grasps as they come, from a real server.

use crate::{
    call::{assert_contains, grasp},
    files::{assert_scene, empty_folder},
    servers::real_server,
};

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_a_line_per_better_grasp_and_a_summary() {
    let url = real_server().await;
    let find = grasp("find --holdout remote-hold1 --budget 300ms --stream").at(&url);
    let lines = find.with("--json").ends_with(0).lines();
    let (summary, grasps) = lines.split_last().unwrap();
    assert_eq!(summary["outcome"], "OUTCOME_FOUND");
    assert_eq!(summary.get("grasps"), None);
    let score = |line: &serde_json::Value| line["grasps"][0]["score"].as_f64().unwrap();
    let scores: Vec<f64> = grasps.iter().map(score).collect();
    assert!(
        !scores.is_empty() && scores.is_sorted_by(|a, b| a < b),
        "{scores:?}"
    );
    let found_after = grasps[0]["report"]["searchTime"].as_str().unwrap();
    let seconds: f64 = found_after.strip_suffix('s').unwrap().parse().unwrap();
    assert!(seconds < 0.3);
    let table = find.run().stdout;
    assert!(table.lines().count() >= 3, "{table}");
    assert_contains(&table, &["valid grasps"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn alternatives_are_drawn_into_numbered_files() {
    let url = real_server().await;
    let folder = empty_folder("alternatives");
    let glb = folder.join("scene.glb");
    let find = grasp("find --holdout remote-hold1 --budget 500ms --alternatives 2 --differ-by approach,type");
    let drawn = find.with("--json --glb").arg(&glb).at(&url).ends_with(0);
    assert_eq!(drawn.lines().len(), 3);
    for number in [1, 2] {
        assert_scene(folder.join(format!("scene-{number}.glb")), &[]);
    }
    assert!(!glb.exists());
}
