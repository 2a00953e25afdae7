//! A giver's hand that sways at the object: what follows a fallen grasp keeps clear of where the hand was, so that it stays.

use std::f32::consts::TAU;

use glam::Vec3;
use grasp_proto::v1::{self, StandingStatus};
use grasp_synthesis::base::pose::Pose;
use grasp_tests::{TestServer, random_holdouts::ClientHoldout};

use super::{Tracked, setup, status_of, time_of};

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
    let request = swayed.request("objects/any");
    v1::TrackFrame {
        sequence,
        capture_time: Some(time_of(sequence)),
        client_from_object: request.client_from_object,
        presenting_hand: request.presenting_hand,
        ..Default::default()
    }
}

/// A track of an object that either hand may receive.
fn either_hand(object: &str, policy: v1::TrackPolicy) -> v1::TrackSetup {
    let mut setup = setup(policy);
    if let Some(holdout) = &mut setup.holdout {
        holdout.object = format!("objects/{object}");
        holdout.receiving_hand = None;
    }
    setup
}

#[tokio::test(flavor = "multi_thread")]
async fn few_replans_follow_a_swaying_hand_and_none_changes_the_hand() {
    let server = TestServer::start().await;
    for built_in in grasp_assets::holdouts::holdouts().iter().step_by(4) {
        let holdout = ClientHoldout::of_built_in(built_in);
        let setup = either_hand(&built_in.object, v1::TrackPolicy::default());
        let start = v1::track_holdout_request::Message::Setup(setup);
        let mut track = Tracked::start(&server, start).await.expect("the setup is right");
        let (mut replans, mut without) = (0, 0);
        let mut hand = None;
        for sequence in 0..FRAMES {
            let answer = track.ask(swaying(&holdout, sequence)).await;
            match status_of(&answer) {
                StandingStatus::Replanned => replans += 1,
                StandingStatus::None => without += 1,
                _ => {}
            }
            if let Some(grasp) = answer.grasp {
                let first = *hand.get_or_insert(grasp.handedness);
                assert_eq!(grasp.handedness, first, "{}, frame {sequence}", built_in.name);
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
