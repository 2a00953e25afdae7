//! Givers who move, at a real server.

use std::path::Path;

use glam::{Affine3A, Quat, Vec3};
use gltf::animation::util::ReadOutputs;

use crate::harness::{assert_contains, empty_folder, file, grasp, real_server};

/// A motion of half a second. Unoptimised builds search longer than a frame.
const WALK: &str = "track --holdout remote-hold1 --moving walk --length 500ms --budget 5s";

#[tokio::test(flavor = "multi_thread")]
async fn a_track_is_a_line_per_answer_and_a_summary() {
    let walk = grasp(WALK).at(&real_server().await);
    let lines = walk.with("--json").ends_with(0).lines();
    let (summary, answers) = lines.split_last().unwrap();
    assert_eq!(summary["frames"], 45);
    assert_eq!(summary["answered"], answers.len());
    // That of the first frame is 0, which is not written.
    let sequence = |line: &serde_json::Value| line["sequence"].as_str().unwrap_or("0").parse().unwrap();
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
    // A file that is no motion, and a frame that is wrong, which is answered.
    let play = play.with("-");
    play.input("{\"frames\": []}").complains(2, "track");
    motion["frames"][3]["sequence"] = 1.into();
    let played = play.input(motion.to_string()).text();
    assert_contains(&played, &["1, first: sequence is 1"]);
}

/// The transforms of a moving node at every moment, as another implementation reads them.
fn node_motion(glb: &Path, name: &str) -> Vec<Affine3A> {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(glb).unwrap();
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
    let glb = folder.join("track.glb");
    // Long enough for the hand to arrive, and slow enough for builds without optimisation.
    let motion = grasp("track --holdout remote-hold1 --moving still --length 4s --rate 30 --budget 5s")
        .with("--receiving-hand right");
    let sent = motion.with("--print-motion").json();
    let draw = motion.at(&url).with("--json --glb").arg(&glb);
    let answers = draw.ends_with(0).lines();

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
    let last_grasp = answers.iter().rev().find_map(|line| line.get("grasp"));
    let answered = pose(&last_grasp.expect("a grasp")["hand"]["objectFromWrist"]);
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
