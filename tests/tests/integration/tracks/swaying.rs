//! A giver's hand that sways at the object: what follows a failed grasp keeps clear of where the hand was, so that it stays.

use std::f32::consts::TAU;

use glam::Vec3;
use grasp_proto::v1::{self, CurrentGraspStatus};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};

use super::{Tracked, frame_of, remote};

/// Frames of a motion: three seconds.
const FRAMES: u64 = 270;

/// A holdout whose giver sways by 8 mm along each axis, three to five times a second.
fn swaying(holdout: &ClientHoldout, sequence: u64) -> v1::TrackFrame {
    let time = sequence as f32 / 90.0;
    let wave = |per_second: f32, phase: f32| (TAU * (per_second * time + phase)).sin();
    let way = 0.008 * Vec3::new(wave(5.0, 0.0), wave(3.9, 0.2), wave(3.0, 0.4));
    let swayed = ClientHoldout {
        giver: holdout.giver.transformed(Pose::from_position(way)),
        ..holdout.clone()
    };
    frame_of(sequence, swayed.request("objects/any"))
}

/// A track of an object that either hand may receive.
fn either_hand(object: &str) -> v1::Track {
    v1::Track {
        receiver: None,
        holdout: Some(v1::Holdout::new(format!("objects/{object}"))),
        ..remote()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn few_replans_follow_a_swaying_hand_and_none_changes_the_hand() {
    let server = TestServer::start().await;
    for built_in in grasp_assets::holdouts::holdouts().iter().step_by(4) {
        let holdout = ClientHoldout::of_built_in(built_in);
        let mut track = Tracked::of(&server, either_hand(&built_in.object)).await;
        let (mut replans, mut without) = (0, 0);
        let mut hand = None;
        for sequence in 0..FRAMES {
            let answer = track.ask(swaying(&holdout, sequence)).await;
            match answer.status() {
                CurrentGraspStatus::Replanned => replans += 1,
                CurrentGraspStatus::None => without += 1,
                _ => {}
            }
            if let Some(grasp) = answer.grasp {
                let posed = grasp.hand.expect("it is set").handedness();
                let first = *hand.get_or_insert(posed);
                assert_eq!(posed, first, "{}, frame {sequence}", built_in.name);
            }
        }
        println!(
            "{}: {replans} re-plans, {without} frames without a grasp",
            built_in.name
        );
        // The first grasp is one of them.
        assert!(replans <= 1 + 4, "{}: {replans}", built_in.name);
        assert!(without <= 2, "{}: {without}", built_in.name);
    }
    server.stop().await;
}
