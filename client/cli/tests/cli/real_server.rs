//! The command line with a real server: demo, pictures, replays.

use grasp_cases::cases;
use grasp_client::v1;

use crate::commands::{code, empty_folder, json, run, text};

#[tokio::test(flavor = "multi_thread")]
async fn demo_draws_every_holdout() {
    let folder = empty_folder("the_demo").join("pictures");
    let folder = folder.to_str().unwrap();
    let output = run(&["demo", "--json", "--out", folder, "--view-size", "48x40"]);
    // A slow machine may run out of time for a hard holdout, but not for all.
    assert!(matches!(code(&output), 0 | 3), "{}", text(&output.stderr));
    assert_eq!(text(&output.stderr), "");
    let results = json(&output.stdout);
    let grasps = results["grasps"].as_array().unwrap();
    assert_eq!(grasps.len(), grasp_assets::holdouts::holdouts().len());
    let found = grasps.iter().filter(|grasp| is_found(grasp)).count();
    assert_eq!(results["found"], found);
    assert!(found > 0);
    assert_eq!(code(&output) == 0, found == grasps.len());
    for grasp in grasps {
        let png = std::fs::read(grasp["picture"].as_str().unwrap()).unwrap();
        assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"), "{}", grasp["holdout"]);
        let glb = std::fs::read(grasp["scene"].as_str().unwrap()).unwrap();
        assert!(glb.starts_with(b"glTF"), "{}", grasp["holdout"]);
    }
    let overview = std::fs::read(results["overview"].as_str().unwrap()).unwrap();
    assert!(overview.starts_with(b"\x89PNG\r\n\x1a\n"));
}

#[tokio::test(flavor = "multi_thread")]
async fn demo_shows_table_without_progress_bar_unless_on_a_terminal() {
    let holdout = &grasp_assets::holdouts::holdouts()[0];
    let folder = empty_folder("the_demo_of_one");
    let output = run(&[
        "demo",
        "--holdout",
        &holdout.name,
        "--out",
        folder.to_str().unwrap(),
        "--view-size",
        "48x40",
    ]);
    assert_eq!(text(&output.stderr), "");
    let table = text(&output.stdout);
    let row = table.lines().find(|line| line.contains(&holdout.object)).unwrap();
    let short_name = holdout.name.strip_prefix(&holdout.object).unwrap();
    // Times are in milliseconds or microseconds.
    let has_time = row.contains(" ms ") || row.contains(" µs ");
    assert!(row.contains(&short_name[1..]) && has_time, "{row}");
    assert!(folder.join(format!("{}.glb", holdout.name)).exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn everyday_demo_shows_every_object_on_a_page() {
    let folder = empty_folder("the_everyday_demo");
    let mut objects = grasp_everyday::everyday_objects();
    let every = objects.len().div_ceil(cases(objects.len() as u32) as usize);
    let is_beyond = |object: &grasp_everyday::EverydayObject| object.hands != grasp_everyday::Hands::One;
    let beyond = objects.iter().position(is_beyond).unwrap();
    let chosen = |place: usize| place.is_multiple_of(every) || place == beyond;
    objects = objects
        .into_iter()
        .enumerate()
        .filter(|&(place, _)| chosen(place))
        .map(|(_, object)| object)
        .collect();
    let out = folder.to_str().unwrap();
    let mut arguments = vec![
        "demo",
        "--everyday",
        "--json",
        "--out",
        out,
        "--view-size",
        "24x20",
    ];
    for object in &objects {
        arguments.extend(["--object", object.name]);
    }
    let output = run(&arguments);
    assert_eq!(text(&output.stderr), "");
    assert_eq!(code(&output), 0);
    let results = json(&output.stdout);
    let page = std::fs::read_to_string(results["page"].as_str().unwrap()).unwrap();
    let grasps = results["grasps"].as_array().unwrap();
    assert_eq!(grasps.len(), objects.len());
    let (mut one_hand, mut found) = (0, 0);
    for (grasp, object) in grasps.iter().zip(objects) {
        assert_eq!(grasp["object"], object.name);
        assert!(
            page.contains(&format!("src=\"{}.png\"", object.name)),
            "{}",
            object.name
        );
        let png = std::fs::read(grasp["picture"].as_str().unwrap()).unwrap();
        assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"), "{}", object.name);
        match object.hands {
            grasp_everyday::Hands::One => {
                assert!(grasp["beyond_one_hand"].is_null(), "{}", object.name);
                one_hand += 1;
                found += usize::from(is_found(grasp));
            }
            grasp_everyday::Hands::Beyond { why } => {
                assert_eq!(grasp["beyond_one_hand"], why);
                assert!(page.contains(why), "{}", object.name);
            }
        }
    }
    assert_eq!(
        (&results["one_hand"], &results["found"]),
        (&one_hand.into(), &found.into())
    );
    assert!(found > 0);
}

/// Whether a row of a demo has a grasp.
fn is_found(row: &serde_json::Value) -> bool {
    row["answer"]["outcome"] == "OUTCOME_FOUND"
}

/// Starts a real server on a free port until the test's runtime ends; returns its URL.
pub(crate) async fn real_server() -> String {
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
async fn found_grasp_is_drawn_and_replayed() {
    let url = real_server().await;
    let folder = empty_folder("a_found_grasp");
    let (png, glb) = (folder.join("grasp.png"), folder.join("grasp.glb"));
    let find = |options: &[&str]| {
        let common = [
            "find",
            "--holdout",
            "scissors-hold1",
            "--budget",
            "10s",
            "--json",
            "--server",
            &url,
        ];
        let output = run(&[&common[..], options].concat());
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        json(&output.stdout)
    };
    // Only grasps of an attempt can be replayed.
    let answer = find(&[
        "--no-atlas",
        "--png",
        png.to_str().unwrap(),
        "--glb",
        glb.to_str().unwrap(),
        "--view-size",
        "48x40",
    ]);
    assert!(std::fs::read(png).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
    let scene = std::fs::read(glb).unwrap();
    for part in ["object", "giver_hand", "receiver_hand", "contact_thumb", "force_"] {
        assert!(
            scene.windows(part.len()).any(|bytes| bytes == part.as_bytes()),
            "{part}"
        );
    }
    let origin = &answer["origin"];
    let attempt = origin["attempt"].as_str().unwrap();
    let hand = match answer["grasps"][0]["hand"]["handedness"].as_str().unwrap() {
        "HANDEDNESS_LEFT" => "left",
        _ => "right",
    };
    // With an atlas, the attempt could start from other grips.
    let again = find(&[
        "--no-atlas",
        "--seed",
        origin["seed"].as_str().unwrap(),
        "--only-attempt",
        attempt,
        "--receiving-hand",
        hand,
    ]);
    assert_eq!(again["grasps"], answer["grasps"]);
    assert_eq!(again["report"]["attempts"], "1");
}

#[tokio::test(flavor = "multi_thread")]
async fn prints_what_the_server_repaired() {
    let url = real_server().await;
    let folder = empty_folder("tips_without_radius");
    let hand = include_str!("../../../examples/data/tracked_hand.json");
    let mut hand: serde_json::Value = serde_json::from_str(hand).unwrap();
    for tip in [5, 10, 15, 20, 25] {
        hand["joints"][tip]["radius"] = 0.into();
    }
    let file = folder.join("request.json");
    let holdout = serde_json::json!({"object": "objects/remote", "presentingHand": {"joints": hand}});
    let request = serde_json::json!({ "holdout": holdout });
    std::fs::write(&file, request.to_string()).unwrap();
    let find = |options: &[&str]| {
        let common = ["find", "--request", file.to_str().unwrap(), "--server", &url];
        run(&[&common[..], options].concat())
    };
    let output = find(&[]);
    let text_output = text(&output.stdout);
    let printed = text_output.lines().find(|line| line.contains("warning"));
    assert!(
        printed.is_some_and(|line| line.contains("holdout.presenting_hand.joints.joints: 5 radii are 0")),
        "{text_output}{}",
        text(&output.stderr)
    );
    let answer = json(&find(&["--json"]).stdout);
    assert_eq!(answer["report"]["warnings"].as_array().unwrap().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn both_hands_are_listed_and_drawn() {
    let url = real_server().await;
    let folder = empty_folder("both_hands");
    let (request, glb) = (folder.join("request.json"), folder.join("grasp.glb"));
    std::fs::write(
        &request,
        r#"{"holdout": {"object": "objects/remote"}, "search": {"seed": "1"}}"#,
    )
    .unwrap();
    let output = run(&[
        "find",
        "--request",
        request.to_str().unwrap(),
        "--hands",
        "both",
        "--budget",
        "10s",
        "--json",
        "--glb",
        glb.to_str().unwrap(),
        "--server",
        &url,
    ]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let answer = json(&output.stdout);
    let side = |grasp: usize| &answer["grasps"][grasp]["hand"]["handedness"];
    assert_eq!(
        (side(0), side(1)),
        (&"HANDEDNESS_RIGHT".into(), &"HANDEDNESS_LEFT".into())
    );
    let scene = std::fs::read(glb).unwrap();
    for part in ["receiver_hand", "other_receiver_hand", "other_receiver_sleeve"] {
        let name = format!("\"{part}\"");
        assert!(
            scene.windows(name.len()).any(|bytes| bytes == name.as_bytes()),
            "{part}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_arm_of_a_body_is_listed_and_drawn() {
    let url = real_server().await;
    let glb = empty_folder("an_arm").join("grasp.glb");
    let file = empty_folder("a_body").join("request.json");
    std::fs::write(
        &file,
        r#"{"holdout": {"object": "objects/remote"}, "search": {"seed": "1"}}"#,
    )
    .unwrap();
    let find = |options: &[&str]| {
        let common = [
            "find",
            "--request",
            file.to_str().unwrap(),
            "--budget",
            "10s",
            "--receiver-root",
            "0,-1.15,0.45,0",
            "--receiver-height",
            "1.7",
            "--server",
            &url,
        ];
        let output = run(&[&common[..], options].concat());
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        output
    };
    let answer = json(&find(&["--json", "--glb", glb.to_str().unwrap()]).stdout);
    let arm = &answer["grasps"][0]["arm"];
    assert!(arm["clientElbow"]["x"].is_f64() && arm["wristFlexion"].is_f64());
    let scene = std::fs::read(glb).unwrap();
    for part in ["receiver_forearm", "receiver_upper_arm"] {
        let name = format!("\"{part}\"");
        assert!(
            scene.windows(name.len()).any(|bytes| bytes == name.as_bytes()),
            "{part}"
        );
    }
    let output = find(&[]);
    let table = text(&output.stdout);
    let line = table.lines().find(|line| line.trim_start().starts_with("arm "));
    assert!(
        line.is_some_and(|line| line.contains("shoulder") && line.contains("elbow")),
        "{table}"
    );
}

/// The points of a node of a scene.
fn node_points(scene: &[u8], name: &str) -> Vec<[f32; 3]> {
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(scene).unwrap();
    let blob = blob.unwrap();
    let node = document.nodes().find(|node| node.name() == Some(name)).unwrap();
    let primitives = node.mesh().unwrap().primitives().collect::<Vec<_>>();
    let read = |primitive: &gltf::Primitive<'_>| {
        let positions = primitive.reader(|_| Some(&blob)).read_positions().unwrap();
        positions.collect::<Vec<_>>()
    };
    primitives.iter().flat_map(read).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn pictures_show_the_mesh_that_the_server_has() {
    let url = real_server().await;
    let folder = empty_folder("a_picture_of_a_turned_mesh");
    // A rod of 20 cm along z, the axis that points up, in centimetres.
    let rod = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 20\nv 2 0 20\nv 2 2 20\nv 0 2 20\n\
               f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let [mesh, request, glb] = ["rod.obj", "request.json", "rod.glb"].map(|name| folder.join(name));
    std::fs::write(&mesh, rod).unwrap();
    std::fs::write(&request, r#"{"holdout": {"object": "objects/rod"}}"#).unwrap();
    let created = run(&[
        "objects",
        "create",
        "rod",
        "--mesh",
        mesh.to_str().unwrap(),
        "--mass",
        "0.1",
        "--unit-metres",
        "0.01",
        "--up-axis",
        "z",
        "--server",
        &url,
    ]);
    assert_eq!(code(&created), 0, "{}", text(&created.stderr));
    let found = run(&[
        "find",
        "--request",
        request.to_str().unwrap(),
        "--budget",
        "5s",
        "--glb",
        glb.to_str().unwrap(),
        "--server",
        &url,
    ]);
    assert_eq!(code(&found), 0, "{}", text(&found.stderr));
    let points = node_points(&std::fs::read(glb).unwrap(), "object");
    let bounds = |axis: usize| {
        let along = points.iter().map(|point| point[axis]);
        (
            along.clone().fold(f32::MAX, f32::min),
            along.fold(f32::MIN, f32::max),
        )
    };
    for (axis, least, most) in [(0, 0.0, 0.02), (1, 0.0, 0.2), (2, -0.02, 0.0)] {
        let (from, to) = bounds(axis);
        assert!(
            (from - least).abs() < 1e-4 && (to - most).abs() < 1e-4,
            "{axis}: {from} to {to}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn rejects_picture_of_a_missing_object_before_the_search() {
    let url = real_server().await;
    let folder = empty_folder("a_picture_of_nothing");
    let request = folder.join("request.json");
    std::fs::write(&request, r#"{"holdout": {"object": "objects/mug"}}"#).unwrap();
    let output = run(&[
        "find",
        "--request",
        request.to_str().unwrap(),
        "--png",
        folder.join("mug.png").to_str().unwrap(),
        "--server",
        &url,
    ]);
    assert_ne!(code(&output), 0);
    assert!(
        text(&output.stderr).contains("objects/mug"),
        "{}",
        text(&output.stderr)
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn hands_of_created_rigs_are_drawn_with_their_own_skin() {
    let url = real_server().await;
    let folder = empty_folder("a_hand_of_its_own");
    let model = grasp_assets::hands::glb("adult", grasp_synthesis::model::hand::Handedness::Right).unwrap();
    let [file, glb, twin] = ["hand.glb", "own.glb", "adult.glb"].map(|name| folder.join(name));
    std::fs::write(&file, model).unwrap();
    let file = file.to_str().unwrap();
    let created = run(&[
        "rigs", "create", "twin", "--model", file, "--hand", "right", "--server", &url,
    ]);
    assert_eq!(code(&created), 0, "{}", text(&created.stderr));
    let find = |more: &[&str]| {
        let common = [
            "find",
            "--holdout",
            "remote-hold1",
            "--receiving-hand",
            "right",
            "--receiving-rig",
            "twin",
            "--no-atlas",
            "--seed",
            "1",
            "--reproducible",
            "--budget",
            "20s",
            "--json",
            "--server",
            &url,
        ];
        run(&[&common[..], more].concat())
    };
    let without = find(&["--glb", twin.to_str().unwrap()]);
    assert_ne!(code(&without), 0);
    assert!(
        text(&without.stderr).contains("model"),
        "{}",
        text(&without.stderr)
    );
    let found = find(&["--model", file, "--glb", glb.to_str().unwrap()]);
    assert_eq!(code(&found), 0, "{}", text(&found.stderr));
    // The rig is a twin of the built-in hand, so joints and skin are as close as there.
    let points = node_points(&std::fs::read(glb).unwrap(), "receiver_hand");
    let answer: v1::FindGraspResponse = grasp_client::json::from_json(&json(&found.stdout)).unwrap();
    let contacts = answer.grasp().unwrap().client_contacts();
    assert!(contacts.len() > 1);
    for contact in contacts {
        let at = contact.position().to_array();
        let nearest = points
            .iter()
            .map(|point| {
                (0..3)
                    .map(|axis| (point[axis] - at[axis]).powi(2))
                    .sum::<f32>()
                    .sqrt()
            })
            .fold(f32::MAX, f32::min);
        assert!(nearest < 0.006, "{nearest} m from a vertex of the skin");
    }
}
