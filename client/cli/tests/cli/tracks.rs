//! Givers who move, at a real server.

use glam::{Affine3A, Quat, Vec3};
use gltf::animation::util::ReadOutputs;

use crate::{
    commands::{code, empty_folder, json, run, run_with_input, text},
    real_server::real_server,
};

/// A motion of half a second. Unoptimised builds search longer than a frame.
const WALK: [&str; 9] = [
    "track",
    "--holdout",
    "remote-hold1",
    "--moving",
    "walk",
    "--length",
    "500ms",
    "--budget",
    "5s",
];

#[tokio::test(flavor = "multi_thread")]
async fn a_track_is_a_line_per_answer_and_a_summary() {
    let url = real_server().await;
    let output = run(&[&WALK[..], &["--server", &url, "--json"]].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let lines: Vec<serde_json::Value> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).expect("each line is JSON"))
        .collect();
    let (summary, answers) = lines.split_last().unwrap();
    assert_eq!(summary["frames"], 45);
    assert_eq!(summary["answered"], answers.len());
    let sequences: Vec<u64> = answers
        .iter()
        // That of the first frame is 0, which is not written.
        .map(|line| {
            line["sequence"]
                .as_str()
                .map_or(0, |number| number.parse().unwrap())
        })
        .collect();
    assert!(sequences.is_sorted_by(|a, b| a < b) && sequences.last() == Some(&44));
    assert_eq!(answers[0]["current"]["status"], "CURRENT_GRASP_STATUS_REPLANNED");
    let table = run(&[&WALK[..], &["--server", &url]].concat());
    let table = text(&table.stdout);
    assert!(
        table.contains("frames") && table.contains("round trip"),
        "{table}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_printed_motion_can_be_played() {
    let url = real_server().await;
    let motion = run(&[&WALK[..], &["--print-motion"]].concat());
    assert_eq!(code(&motion), 0);
    let parsed = json(&motion.stdout);
    assert_eq!(parsed["frames"].as_array().unwrap().len(), 45);
    let file = empty_folder("a_motion").join("motion.json");
    std::fs::write(&file, &motion.stdout).unwrap();
    let play = ["track", "--server", &url, "--predict-ahead", "20ms", "--motion"];
    let played = run(&[&play[..], &[file.to_str().unwrap()]].concat());
    assert_eq!(code(&played), 0, "{}", text(&played.stderr));
    assert!(text(&played.stdout).contains("predicted"));
    // A file that is no motion, and a frame that is wrong, which is answered.
    let output = run_with_input(&["track", "--server", &url, "--motion", "-"], "{\"frames\": []}");
    assert_eq!(code(&output), 2);
    assert!(text(&output.stderr).contains("track"));
    let mut wrong = parsed;
    wrong["frames"][3]["sequence"] = 1.into();
    let output = run_with_input(&["track", "--server", &url, "--motion", "-"], &wrong.to_string());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    assert!(
        text(&output.stdout).contains("1, first: sequence is 1"),
        "{}",
        text(&output.stdout)
    );
}

/// The transforms of a moving node at every moment, as another implementation reads them.
fn node_motion(glb: &[u8], name: &str) -> Vec<Affine3A> {
    let gltf::Gltf { document, blob } = gltf::Gltf::from_slice(glb).unwrap();
    let blob = blob.unwrap();
    let animation = document.animations().next().unwrap();
    let (mut translations, mut rotations) = (Vec::new(), Vec::new());
    let is_wanted = |channel: &gltf::animation::Channel<'_>| channel.target().node().name() == Some(name);
    for channel in animation.channels().filter(is_wanted) {
        match channel.reader(|_| Some(&blob)).read_outputs().unwrap() {
            ReadOutputs::Translations(all) => translations = all.map(Vec3::from).collect(),
            ReadOutputs::Rotations(all) => rotations = all.into_f32().map(Quat::from_array).collect(),
            _ => {}
        }
    }
    let both = rotations.into_iter().zip(translations);
    both.map(|(rotation, translation)| Affine3A::from_rotation_translation(rotation, translation))
        .collect()
}

/// A pose in JSON.
fn pose(value: &serde_json::Value) -> Affine3A {
    let number = |name: &str, axis: &str| value[name][axis].as_f64().unwrap_or(0.0) as f32;
    let orientation = ["x", "y", "z", "w"].map(|axis| number("orientation", axis));
    let position = ["x", "y", "z"].map(|axis| number("position", axis));
    Affine3A::from_rotation_translation(Quat::from_array(orientation), Vec3::from_array(position))
}

#[tokio::test(flavor = "multi_thread")]
async fn an_animation_shows_what_was_sent_and_answered() {
    let url = real_server().await;
    let folder = empty_folder("a_drawn_track");
    let (glb, png) = (folder.join("track.glb"), folder.join("track.png"));
    // Long enough for the hand to arrive, and slow enough for builds without optimisation.
    let motion = [
        "track",
        "--holdout",
        "remote-hold1",
        "--moving",
        "still",
        "--length",
        "4s",
        "--rate",
        "30",
        "--budget",
        "5s",
        "--receiving-hand",
        "right",
    ];
    let sent = json(&run(&[&motion[..], &["--print-motion"]].concat()).stdout);
    let drawn = ["--server", &url, "--json", "--view-size", "48x40"];
    let files = ["--glb", glb.to_str().unwrap(), "--png", png.to_str().unwrap()];
    let output = run(&[&motion[..], &drawn, &files].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    assert!(std::fs::read(png).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));

    let glb = std::fs::read(glb).unwrap();
    let object = node_motion(&glb, "object");
    let giver = node_motion(&glb, "giver_wrist");
    let frames = sent["frames"].as_array().unwrap();
    assert_eq!((object.len(), giver.len()), (frames.len(), frames.len()));
    for (frame, (object, giver)) in frames.iter().zip(object.iter().zip(&giver)) {
        assert!(object.abs_diff_eq(pose(&frame["holdout"]["clientFromObject"]), 1e-5));
        let wrist = &frame["holdout"]["presentingHand"]["pose"]["clientFromWrist"];
        assert!(giver.abs_diff_eq(pose(wrist), 1e-5));
    }
    // In the end, the hand is at the grasp that was answered last, in the object's frame.
    let stdout = text(&output.stdout);
    let mut grasps = stdout.lines().filter_map(|line| {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        line.get("grasp")
            .map(|grasp| grasp["hand"]["objectFromWrist"].clone())
    });
    let answered = pose(&grasps.next_back().expect("a grasp"));
    let receiver = node_motion(&glb, "receiver_wrist");
    let last = frames.len() - 1;
    let reached = object[last].inverse() * receiver[last];
    let off = reached.translation.distance(answered.translation);
    assert!(off < 1e-3, "{off} m off");
    // It came from farther away, without a jump: at most 1.1 m/s and the object's own motion.
    let start = object[0].inverse() * receiver[0];
    assert!(start.translation.distance(answered.translation) > 0.1);
    for pair in receiver.windows(2) {
        let step = pair[0].translation.distance(pair[1].translation);
        assert!(step < 1.3 / 30.0, "{step} m in a frame");
    }
}
