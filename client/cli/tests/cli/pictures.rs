//! The command line with a real server: demo, pictures, replays.

use grasp_assets::holdouts::holdouts;
use grasp_client::v1;
use serde_json::{Value, json};

use crate::harness::{Ended, assert_png, assert_scene, empty_folder, file, grasp, node_points, real_server};

#[tokio::test(flavor = "multi_thread")]
async fn demo_draws_every_holdout() {
    let folder = empty_folder("the_demo").join("pictures");
    let demo = grasp("demo --json --view-size 48x40 --out").arg(folder).run();
    let Ended { code, stderr, .. } = &demo;
    // A slow machine may run out of time for a hard holdout, but not for all.
    assert!(matches!(code, 0 | 3) && stderr.is_empty(), "{demo:?}");
    let results = demo.json();
    let grasps = results["grasps"].as_array().unwrap();
    assert_eq!(grasps.len(), holdouts().len());
    let found = grasps.iter().filter(|grasp| is_found(grasp)).count();
    assert_eq!(results["found"], found);
    assert!(found > 0);
    assert_eq!(*code == 0, found == grasps.len());
    for grasp in grasps {
        assert_png(grasp["picture"].as_str().unwrap());
        assert_scene(grasp["scene"].as_str().unwrap(), &[]);
    }
    assert_png(results["overview"].as_str().unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn demo_shows_table_without_progress_bar_unless_on_a_terminal() {
    let holdout = &holdouts()[0];
    let folder = empty_folder("the_demo_of_one");
    let demo = grasp("demo --view-size 48x40 --out")
        .arg(&folder)
        .with("--holdout");
    let Ended { stdout, stderr, .. } = demo.arg(&holdout.name).run();
    assert_eq!(stderr, "");
    let mut lines = stdout.lines();
    let row = lines.find(|line| line.contains(&holdout.object)).unwrap();
    let short_name = holdout.name.strip_prefix(&holdout.object).unwrap();
    // Times are in milliseconds or microseconds.
    let has_time = row.contains(" ms ") || row.contains(" µs ");
    assert!(row.contains(&short_name[1..]) && has_time, "{row}");
    assert!(folder.join(format!("{}.glb", holdout.name)).exists());
}

/// Whether a row of a demo has a grasp.
fn is_found(row: &Value) -> bool {
    row["answer"]["outcome"] == "OUTCOME_FOUND"
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
async fn prints_what_the_server_repaired() {
    let hand = include_str!("../../../examples/data/tracked_hand.json");
    let mut hand: Value = serde_json::from_str(hand).unwrap();
    for tip in [5, 10, 15, 20, 25] {
        hand["joints"][tip]["radius"] = 0.into();
    }
    let request = json!({"holdout": {"object": "objects/remote", "presentingHand": {"joints": hand}}});
    let find = grasp("find --request -").input(request.to_string());
    let find = find.at(&real_server().await);
    let printed = find.run().stdout;
    let warning = printed.lines().find(|line| line.contains("warning"));
    assert!(
        warning.is_some_and(|line| line.contains("holdout.presenting_hand.joints.joints: 5 radii are 0")),
        "{printed}"
    );
    let answer = find.with("--json").run().json();
    assert_eq!(answer["report"]["warnings"].as_array().unwrap().len(), 1);
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
async fn the_arm_of_a_body_is_listed_and_drawn() {
    let glb = empty_folder("an_arm").join("grasp.glb");
    let request = r#"{"holdout": {"object": "objects/remote"},
        "receiver": {"clientFromRoot": {"position": {"y": -1.15, "z": 0.45}}, "height": 1.7}, "search": {"seed": "1"}}"#;
    let find = grasp("find --request - --budget 10s")
        .input(request)
        .at(&real_server().await);
    let answer = find.with("--glb").arg(&glb).json();
    let arm = &answer["grasps"][0]["arm"];
    assert!(arm["clientElbow"]["x"].is_f64() && arm["wristFlexion"].is_f64());
    assert_scene(glb, &["\"receiver_forearm\"", "\"receiver_upper_arm\""]);
    let table = find.text();
    let line = table.lines().find(|line| line.trim_start().starts_with("arm "));
    assert!(
        line.is_some_and(|line| line.contains("shoulder") && line.contains("elbow")),
        "{table}"
    );
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
    let points = node_points(&glb, "object");
    for (axis, least, most) in [(0, 0.0, 0.02), (1, 0.0, 0.2), (2, -0.02, 0.0)] {
        let along = points.iter().map(|point| point[axis]);
        let from = along.clone().fold(f32::MAX, f32::min);
        let to = along.fold(f32::MIN, f32::max);
        assert!(
            (from - least).abs() < 1e-4 && (to - most).abs() < 1e-4,
            "{axis}: {from} to {to}"
        );
    }
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
