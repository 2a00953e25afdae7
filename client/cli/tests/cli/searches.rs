//! Searches from the command line: the demo, pictures, replays, streams, current grasps, verdicts, request files, tracks.

use grasp_assets::holdouts::holdouts;
use grasp_client::v1;
use serde_json::{Value, json};

use crate::harness::{
    Call, Ended, assert_contains, assert_png, assert_scene, empty_folder, file, grasp, node_points,
    real_server,
};

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
    // Only grasps of attempts can be replayed, and a replay could start from other grips of an atlas.
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
    assert_scene(glb, &["\"receiver_hand\"", "\"other_receiver_hand\""]);
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
    // Upright, in metres.
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
    // The rig is a copy of the built-in hand, so joints and skin are as close.
    let points = node_points(&glb, "receiver_hand");
    let answer: v1::FindGraspResponse = grasp_client::json::from_json(&found).unwrap();
    let contacts = answer.grasp().unwrap().client_contacts();
    assert!(contacts.len() > 1);
    for contact in contacts {
        let distance = |&point: &[f32; 3]| contact.position().distance(point.into());
        let nearest = points.iter().map(distance).fold(f32::MAX, f32::min);
        assert!(nearest < 0.006, "{nearest} m from a vertex of the skin");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_is_a_line_per_better_grasp_and_a_summary() {
    let url = real_server().await;
    let find = grasp("find --holdout remote-hold1 --budget 300ms --stream").at(&url);
    let lines = find.with("--json").ends_with(0).lines();
    let (summary, grasps) = lines.split_last().unwrap();
    assert_eq!(summary["outcome"], "OUTCOME_FOUND");
    assert_eq!(summary.get("grasps"), None);
    let score = |line: &Value| line["grasps"][0]["score"].as_f64().unwrap();
    let scores: Vec<f64> = grasps.iter().map(score).collect();
    assert!(!scores.is_empty() && scores.is_sorted_by(|a, b| a < b));
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

#[tokio::test(flavor = "multi_thread")]
async fn an_earlier_answer_is_held_on_to() {
    let url = real_server().await;
    let find = grasp("find --holdout remote-hold1 --receiving-hand right --budget 10s").at(&url);
    let first = find.json();
    let folder = empty_folder("the_current_answer");
    let answer = file(&folder, "answer.json", first.to_string());
    let find = find.with("--current").arg(answer);
    let again = find.json();
    assert_eq!(again["current"]["status"], "CURRENT_GRASP_STATUS_KEPT");
    assert_eq!(again["origin"]["source"], "GRASP_SOURCE_CURRENT");
    let wrists = [first, again].map(|answer| answer["grasps"][0]["hand"]["objectFromWrist"].clone());
    assert!(wrists[0] == wrists[1] && wrists[0].is_object());
    let table = find.run().stdout;
    assert_contains(&table, &["current grasp", "kept"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn found_grasps_are_valid_and_moved_ones_are_not() {
    let url = real_server().await;
    let found = grasp("find --holdout remote-hold1 --seed 1").at(&url).json();
    let answer = file(&empty_folder("validated"), "found.json", found.to_string());
    let validate = grasp("validate --holdout remote-hold1").at(&url).with("--grasp");
    let table = validate.arg(answer).text();
    assert_contains(&table, &["✓", "giver clearance"]);
    assert!(!table.contains('✗'), "{table}");

    // The grasp alone, 5 cm away, from standard input.
    let mut grasp = found["grasps"][0].clone();
    let x = &mut grasp["hand"]["objectFromWrist"]["position"]["x"];
    *x = (x.as_f64().unwrap() + 0.05).into();
    let moved = validate.with("-").input(grasp.to_string());
    assert_contains(&moved.ends_with(3).stdout, &["✗"]);
    let nearest = moved.with("--json --find-nearest --budget 500ms");
    let answer = nearest.ends_with(3).json();
    // JSON omits false.
    assert_eq!(answer.get("valid"), None);
    assert_eq!(answer["nearest"].is_null(), answer["nearestMotion"].is_null());

    let nothing = r#"{"outcome": "OUTCOME_BUDGET_EXHAUSTED"}"#;
    validate.with("-").input(nothing).complains(2, "no grasp");
}

#[tokio::test(flavor = "multi_thread")]
async fn givers_are_ranked() {
    let evaluate = grasp("evaluate --holdout remote-hold1").at(&real_server().await);
    let both = evaluate.with("--holdout remote-hold2 --budget 2s");
    assert_contains(&both.text(), &["remote-hold1", "remote-hold2"]);
    let answer = both.with("--json").run().json();
    assert_eq!(answer["ratings"].as_array().map(Vec::len), Some(2));
    let ranking = [0, 1].map(|place| answer["ratings"][place]["presentingHand"].as_u64().unwrap_or(0));
    assert!(ranking == [0, 1] || ranking == [1, 0], "{ranking:?}");
    let other = evaluate.with("--holdout scissors-hold1");
    other.complains(2, "objects/scissors");
}

/// Prints the request of a file and options.
fn print(options: &str, file: &str) -> Call {
    grasp("find --request - --print-request")
        .with(options)
        .input(file)
}

#[tokio::test(flavor = "multi_thread")]
async fn options_override_the_file_and_keep_the_rest() {
    let file = r#"{"holdout": {"object": "objects/remote"},
        "search": {"choice": "GRASP_CHOICE_FIRST_VALID", "refinementTime": "0.01s"},
        "receiver": {"handedness": "HANDEDNESS_LEFT", "client_shoulder": {"y": 1}, "forearmLength": 0.25},
        "requirements": {"excludedGraspTypes": ["GRASP_TYPE_STICK"], "must_not_touch": ["DIGIT_MIDDLE"],
        "thesis": {"max_comfort": 0.5, "strategy": "STRATEGY_A"}}}"#;
    let kept = print("", file).json();
    assert_eq!(print("", &kept.to_string()).json(), kept, "it can be read again");
    assert_eq!(kept["receiver"]["clientShoulder"]["y"], 1.0);
    assert_eq!(kept["search"]["refinementTime"], "0.010s");
    let options = "--choice best --strategy f --validity physical --bend-ratios all --receiving-hand right --receiving-rig adult";
    let request = print(options, file).json();
    assert_eq!(
        request["search"],
        json!({"choice": "GRASP_CHOICE_BEST_WITHIN_BUDGET", "refinementTime": "0.010s"})
    );
    assert_eq!(
        request["receiver"],
        json!({
            "rig": "rigs/adult", "handedness": "HANDEDNESS_RIGHT", "clientShoulder": {"y": 1.0}, "forearmLength": 0.25,
        })
    );
    assert_eq!(
        request["requirements"],
        json!({
            "excludedGraspTypes": ["GRASP_TYPE_STICK"],
            "mustNotTouch": ["DIGIT_MIDDLE"],
            "thesis": {"maxComfort": 0.5, "strategy": "STRATEGY_F", "bendRatios": "BEND_RATIOS_ALL"},
        })
    );
}

/// A motion of half a second. Unoptimised builds search longer than a frame.
const WALK: &str = "track --holdout remote-hold1 --moving walk --length 500ms --budget 5s";

#[tokio::test(flavor = "multi_thread")]
async fn a_track_is_a_line_per_answer_and_a_summary_and_drawn() {
    let walk = grasp(WALK).at(&real_server().await);
    let glb = empty_folder("a_drawn_track").join("track.glb");
    let lines = walk.with("--json --glb").arg(&glb).ends_with(0).lines();
    assert_scene(glb, &["object", "giver_wrist", "receiver_wrist"]);
    let (summary, answers) = lines.split_last().unwrap();
    assert_eq!(summary["frames"], 45);
    assert_eq!(summary["answered"], answers.len());
    // The first sequence number is 0, which JSON omits.
    let sequence = |line: &Value| line["sequence"].as_str().unwrap_or("0").parse().unwrap();
    let sequences: Vec<u64> = answers.iter().map(sequence).collect();
    assert!(sequences.is_sorted_by(|a, b| a < b) && sequences.last() == Some(&44));
    assert_eq!(answers[0]["current"]["status"], "CURRENT_GRASP_STATUS_REPLANNED");
    assert_contains(&walk.run().stdout, &["frames", "round trip"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_printed_motion_can_be_played() {
    let mut motion = grasp(WALK).with("--print-motion").json();
    assert_eq!(motion["frames"].as_array().unwrap().len(), 45);
    let printed = file(&empty_folder("a_motion"), "motion.json", motion.to_string());
    let play = grasp("track").at(&real_server().await).with("--motion");
    let played = play.arg(printed).with("--prediction-horizon 20ms").text();
    assert_contains(&played, &["predicted"]);
    // A file that is not a motion, and invalid frames, which are answered unless others overtake them.
    let play = play.with("-");
    play.input("{\"frames\": []}").complains(2, "track");
    for frame in &mut motion["frames"].as_array_mut().unwrap()[20..40] {
        frame["sequence"] = 1.into();
    }
    let played = play.input(motion.to_string()).text();
    assert_contains(&played, &["first: sequence is 1"]);
}
