//! The command line with a real server: demo, pictures, replays.

use grasp_assets::holdouts::holdouts;
use grasp_client::v1;
use serde_json::Value;

use crate::harness::{Ended, assert_png, assert_scene, empty_folder, file, grasp, node_points, real_server};

#[tokio::test(flavor = "multi_thread")]
async fn demo_draws_every_holdout() {
    let folder = empty_folder("the_demo").join("pictures");
    let demo = grasp("demo --view-size 48x40 --out").arg(&folder);
    let Ended { code, stdout, stderr } = demo.with("--json").run();
    // A slow machine may run out of time for a hard holdout, but not for all.
    assert!(matches!(code, 0 | 3) && stderr.is_empty(), "{code}: {stderr}");
    let results: Value = serde_json::from_str(&stdout).unwrap();
    let grasps = results["grasps"].as_array().unwrap();
    assert_eq!(grasps.len(), holdouts().len());
    let found = |grasp: &&Value| grasp["answer"]["outcome"] == "OUTCOME_FOUND";
    let found = grasps.iter().filter(found).count();
    assert_eq!(results["found"], found);
    assert!(found > 0 && (code == 0) == (found == grasps.len()));
    for grasp in grasps {
        assert_png(grasp["picture"].as_str().unwrap());
        assert_scene(grasp["scene"].as_str().unwrap(), &[]);
    }
    assert_png(results["overview"].as_str().unwrap());

    let table = demo.with("--holdout remote-hold1").run().stdout;
    let row = table.lines().find(|line| line.contains("remote"));
    // Times are in milliseconds or microseconds.
    let is_whole = |row: &str| row.contains(" hold1 ") && (row.contains(" ms ") || row.contains(" µs "));
    assert!(row.is_some_and(is_whole), "{table}");
}

#[tokio::test(flavor = "multi_thread")]
async fn found_grasp_is_drawn_and_replayed() {
    let folder = empty_folder("a_found_grasp");
    let (png, glb) = (folder.join("grasp.png"), folder.join("grasp.glb"));
    // Only grasps of an attempt can be replayed, and with an atlas it could start from other grips.
    let find = grasp("find --holdout scissors-hold1 --budget 10s --ignore-atlas").at(&real_server().await);
    let draw = find.with("--view-size 48x40 --png").arg(&png);
    let answer = draw.with("--glb").arg(&glb).json();
    assert_png(png);
    assert_scene(
        glb,
        &["object", "giver_hand", "receiver_hand", "contact_thumb", "force_"],
    );
    let [seed, attempt] = ["seed", "attempt"].map(|name| answer["origin"][name].as_str().unwrap());
    let hand = match answer["grasps"][0]["hand"]["handedness"].as_str().unwrap() {
        "HANDEDNESS_LEFT" => "left",
        _ => "right",
    };
    let replay = format!("--seed {seed} --replay-attempt {attempt} --receiving-hand {hand}");
    let again = find.with(&replay).json();
    assert_eq!(again["grasps"], answer["grasps"]);
    assert_eq!(again["report"]["attempts"], "1");
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_are_listed_and_drawn() {
    let glb = empty_folder("both_hands").join("grasp.glb");
    let request = r#"{"holdout": {"object": "objects/remote"}, "receiver": {"bothHands": true},
        "search": {"seed": "1"}}"#;
    let find = grasp("find --request - --budget 10s --glb").arg(&glb);
    let answer = find.input(request).at(&real_server().await).json();
    for (place, side) in ["HANDEDNESS_RIGHT", "HANDEDNESS_LEFT"].iter().enumerate() {
        assert_eq!(answer["grasps"][place]["hand"]["handedness"], *side);
    }
    let parts = [
        "\"receiver_hand\"",
        "\"other_receiver_hand\"",
        "\"other_receiver_sleeve\"",
    ];
    assert_scene(glb, &parts);
}

#[tokio::test(flavor = "multi_thread")]
async fn pictures_show_the_mesh_that_the_server_has() {
    let url = real_server().await;
    let folder = empty_folder("a_picture_of_a_turned_mesh");
    // A rod of 20 cm along z, the axis that points up, in centimetres.
    let rod = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 20\nv 2 0 20\nv 2 2 20\nv 0 2 20\n\
               f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let rod = file(&folder, "rod.obj", rod);
    let create = grasp("objects create rod --mass 0.1 --unit-metres 0.01 --up-axis z --mesh").arg(rod);
    create.at(&url).ends_with(0);
    let glb = folder.join("rod.glb");
    grasp("find --request - --budget 5s --glb")
        .arg(&glb)
        .input(r#"{"holdout": {"object": "objects/rod"}}"#)
        .at(&url)
        .ends_with(0);
    // It stands up, in metres.
    let points = node_points(&glb, "object");
    let highest = points.iter().map(|point| point[1]).fold(0.0, f32::max);
    assert!((highest - 0.2).abs() < 1e-4, "{highest}");
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_picture_of_a_missing_object_before_the_search() {
    let png = empty_folder("a_picture_of_nothing").join("mug.png");
    grasp("find --request - --png")
        .arg(png)
        .input(r#"{"holdout": {"object": "objects/mug"}}"#)
        .at(&real_server().await)
        .complains(4, "objects/mug");
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_of_created_rigs_are_drawn_with_their_own_skin() {
    let url = real_server().await;
    let folder = empty_folder("a_hand_of_its_own");
    let model = grasp_assets::hands::glb("adult", grasp_synthesis::model::hand::Handedness::Right).unwrap();
    let model = file(&folder, "hand.glb", model);
    let glb = folder.join("own.glb");
    let create = grasp("rigs create twin --hand right --model").arg(&model);
    create.at(&url).ends_with(0);
    let find =
        grasp("find --holdout remote-hold1 --receiving-hand right --receiving-rig twin --ignore-atlas")
            .with("--seed 1 --reproducible --budget 20s --glb")
            .arg(&glb)
            .at(&url);
    find.complains(2, "model");
    let found = find.with("--model").arg(model).json();
    // The rig is a twin of the built-in hand, so joints and skin are as close as there.
    let points = node_points(&glb, "receiver_hand");
    let answer: v1::FindGraspResponse = grasp_client::json::from_json(&found).unwrap();
    let contacts = answer.grasp().unwrap().client_contacts();
    assert!(contacts.len() > 1);
    for contact in contacts {
        let distances = points
            .iter()
            .map(|&point| contact.position().distance(point.into()));
        let nearest = distances.fold(f32::MAX, f32::min);
        assert!(nearest < 0.006, "{nearest} m from a vertex of the skin");
    }
}
